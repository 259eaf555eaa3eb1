"""Base class of all labelers: options, learned attributes and common signatures.

The interface is scikit-learn's, so that ``clone`` and grid searches work with any labeler. But
scikit-learn is not imported, which would take a second; labelling does not need it.

``Labeler(options)``
    Stores the options unchanged; ``fit`` checks them before training.
``fit(...)``
    Sets the learned attributes, which end with an underscore, and returns the labeler.
``scores(x)``
    The classifier's scores of each node before inference.
``infer(x, scores)``
    The method's labelling of given scores: a
    :class:`~pgm_places.inference.labeling.Labeling`.
``label(x)``
    Both.
``save(labeler, folder)``, ``load(folder)``
    Functions of :mod:`pgm_places.persistence.stored` for all labelers and backends.

``x`` is a map for PlaceLabeler, a trajectory for TrajectoryLabeler, a map and a trajectory through
it for JointLabeler, and a problem for StructuredLabeler. Common keywords:

``method``
    Name of the method to use, where a labeler has several; the last one by default.
``mask``
    (H, W) bool, the cells of a map to label; all free cells by default.
``truth``
    (N,) true label indices or -1, for methods that record their accuracy in each iteration. The
    labels do not depend on it.
``n_threads``
    Number of threads, all by default; results are bit-identical for any number.
``progress``
    Reporter of stages and warnings; none by default.
"""

import copy
import dataclasses
import inspect
import time
from collections.abc import Callable, Hashable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, get_args, get_origin

from pgm_places._arguments import public_options
from pgm_places._arguments.kinds import NO, check_of, hints_of
from pgm_places._arguments.words import described, words
from pgm_places.errors import ConfigError, NotFittedError, nearest_name
from pgm_places.inference.backends import Learnable, traits_of
from pgm_places.labelers.method import as_backend
from pgm_places.options import check_option, option_values
from pgm_places.progress import report_stage

T = TypeVar("T")


def learned_with(methods: Mapping[str, tuple[Any, str]]) -> dict[str, str]:
    """For each method with the same training as an earlier one, the name of the earlier one.

    ``methods`` are backends with their unary. Fitted backends count as equal if they share their
    arrays.

    Examples
    --------
    >>> from pgm_places import build
    >>> names = {"cut": "graph-cut", "lp": "lp"}
    >>> methods = {name: (build("amn", {"inference": how}), "") for name, how in names.items()}
    >>> learned_with({**methods, "other": (build("amn", {"C": 10.0}), "")})
    {'lp': 'cut'}
    """
    first: dict[Hashable, str] = {}
    shared = {}
    for name, (backend, unary) in methods.items():
        key = _training_key(backend)
        if key is None:
            continue
        other = first.setdefault((key, unary), name)
        if other != name:
            shared[name] = other
    return shared


def as_fitted(backend: Any, fitted: Any) -> Any:
    """A fitted backend with the labelling options of ``backend``, which has the same training."""
    chosen = {name: getattr(backend, name) for name in traits_of(backend).labelling_options}
    return dataclasses.replace(fitted, **chosen)


def train_once(
    methods: Mapping[str, tuple[Any, str]],
    train: Callable[[str], T],
    adapt: Callable[[str, T], T],
) -> dict[str, tuple[T, float]]:
    """The result of each method's training, and its time (s).

    Methods with the same training (:func:`learned_with`) are trained once, with the time of the
    first of them; ``adapt`` makes the result of the others from it.
    """
    shared, trained = learned_with(methods), dict[str, tuple[T, float]]()
    for name in methods:
        if name in shared:
            trained[name] = adapt(name, trained[shared[name]][0]), 0.0
            continue
        start = time.perf_counter()
        result = train(name)
        trained[name] = result, time.perf_counter() - start
    return trained


def _training_key(backend: Any) -> Hashable | None:
    """A key of everything that training depends on; None if there is no training to share."""
    if not isinstance(backend, Learnable) or not traits_of(backend).labelling_options:
        return None
    others = set(option_values(backend)) - set(traits_of(backend).labelling_options)
    options = sorted((name, repr(getattr(backend, name))) for name in others)
    arrays = [
        id(getattr(backend, field.name))
        for field in dataclasses.fields(backend)  # type: ignore[arg-type]
        if field.metadata.get("learned")
    ]
    return type(backend), *options, *arrays


@public_options
class Labeler:
    """Base class: scikit-learn parameters, fitted state, repr.

    Attributes
    ----------
    label_names_ : tuple of K str
        The learned labels; present only if the labeler is fitted.
    """

    label_names_: tuple[str, ...]

    stored_as: ClassVar[str] = ""
    _method_option: ClassVar[str] = "method"
    _call_first: ClassVar[str] = "fit(...)"

    # ------------------------------------------------------------------ options

    def check_options(self) -> None:
        """Check the options against the annotations of the constructor, as ``fit`` does first.

        ConfigError, one line with the option's name, the permitted values and its value, if one is
        invalid.
        """
        for name, hint in hints_of(type(self).__init__).items():
            value = getattr(self, name)
            if _is_limited(hint):
                check_option(name, hint, value)
            elif check_of(hint)(value) is NO:
                raise ConfigError(f"{name} must be {words(hint)}, got {described(value)}")

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The options by name; with ``deep`` also nested options: ``sensor__n_beams``."""
        options = {name: getattr(self, name) for name in self._defaults()}
        return _with_inner(options, self._part) if deep else options

    def set_params(self, **params: Any) -> Self:
        """Set options; learned attributes do not change until the next fit. Returns the labeler.

        ConfigError for an unknown option; the message suggests the nearest name.
        """
        known = list(self._defaults())
        for name, (is_set, inner) in _grouped(params).items():
            _check_known(type(self).__name__, name, known)
            if is_set:
                setattr(self, name, params[name])
            if inner:
                setattr(self, name, _changed(self._part(name), inner))
        return self

    def with_options(self, **params: Any) -> Self:
        """A fitted copy with other options.

        Options of the method are set on the fitted method, too: ``method__mode="viterbi"``. Options
        of training take effect when the copy is fitted again.
        """
        other = copy.copy(self).set_params(**params)
        for name, (_, inner) in _grouped(params).items():
            learned = getattr(self, f"{name}_", None)
            if inner and learned is not None:
                setattr(other, f"{name}_", _changed(learned, inner))
        other.check_options()
        return other

    def __repr__(self) -> str:
        shown = [
            f"{name}={getattr(self, name)!r}"
            for name, default in self._defaults().items()
            if repr(getattr(self, name)) != repr(default)
        ]
        return f"{type(self).__name__}({', '.join(shown)})"

    def _repr_html_(self) -> str:
        """The HTML representation of scikit-learn's estimators, for notebooks."""
        from sklearn.utils import estimator_html_repr

        return str(estimator_html_repr(self))

    @classmethod
    def _defaults(cls) -> dict[str, Any]:
        """The constructor's parameters in order, with their defaults."""
        parameters = list(inspect.signature(cls.__init__).parameters.values())[1:]
        return {parameter.name: parameter.default for parameter in parameters}

    def _part(self, name: str) -> Any:
        """An option with nested options; a method's name is replaced by the method."""
        value = getattr(self, name)
        return as_backend(value) if name == self._method_option else value

    # ------------------------------------------------------------------ what was learned

    def set_learned(self, **learned: Any) -> Self:
        """Replace all fitted attributes."""
        for name in [name for name in vars(self) if name.endswith("_")]:
            delattr(self, name)
        vars(self).update(learned)
        return self

    def set_learned_with(
        self, methods: Mapping[str, Any], learn: Callable[[Any], Mapping[str, Any]]
    ) -> dict[str, Self]:
        """Fit a labeler per method with ``learn``; the last one is this labeler.

        ``learn`` returns the learned attributes by name, among them the fitted method
        (``method_``). Methods with the same training are trained once, and the time
        (``learn_seconds_``) counts for the first of them.
        """
        option, labelers = f"{self._method_option}_", dict[str, Self]()

        def train(name: str) -> Mapping[str, Any]:
            with report_stage(f"method {name}".rstrip()):
                return learn(methods[name])

        def adapt(name: str, learned: Mapping[str, Any]) -> Mapping[str, Any]:
            return {**learned, option: as_fitted(methods[name], learned[option])}

        trained = train_once({name: (each, "") for name, each in methods.items()}, train, adapt)
        for name, (learned, seconds) in trained.items():
            labeler = self if len(labelers) == len(methods) - 1 else copy.copy(self)
            if len(methods) > 1:
                labeler.set_params(**{self._method_option: methods[name]})
            labelers[name] = labeler.set_learned(learn_seconds_=seconds, **learned)
        return labelers

    def check_fitted(self) -> None:
        """Raise NotFittedError before ``fit``."""
        if not self.__sklearn_is_fitted__():
            raise NotFittedError(
                f"this {type(self).__name__} is not fitted yet; call {self._call_first} first"
            )

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "label_names_")

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import Tags, TargetTags

        return Tags(estimator_type=None, target_tags=TargetTags(required=False))


def _is_limited(hint: object) -> bool:
    """Whether an annotation limits the values beyond their type."""
    return get_origin(hint) in (Annotated, Literal) or any(map(_is_limited, get_args(hint)))


def _options_of(value: object, *, deep: bool) -> dict[str, object]:
    """The nested options of an estimator, a dataclass or a mapping."""
    if hasattr(value, "get_params") and not isinstance(value, type):
        return dict(value.get_params(deep))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        options = option_values(value)
    elif isinstance(value, Mapping):
        options = dict(value)
    else:
        return {}
    return _with_inner(options, options.__getitem__) if deep else options


def _with_inner(options: dict[str, object], part: Callable[[str], Any]) -> dict[str, object]:
    """The options, and nested ones by names such as ``sensor__n_beams``."""
    every = dict(options)
    for name in options:
        inner = _options_of(part(name), deep=True)
        every |= {f"{name}__{key}": value for key, value in inner.items()}
    return every


def _changed(value: Any, params: Mapping[str, Any]) -> Any:
    """A copy of the value with other options."""
    if hasattr(value, "set_params"):
        try:
            return copy.deepcopy(value).set_params(**params)
        except ValueError as error:  # scikit-learn's message for an unknown name
            raise ConfigError(str(error)) from None
    known = _options_of(value, deep=False)
    new = {}
    for name, (is_set, inner) in _grouped(params).items():
        _check_known(type(value).__name__, name, list(known))
        new[name] = params[name] if is_set else known[name]
        if inner:
            new[name] = _changed(new[name], inner)
    return {**value, **new} if isinstance(value, Mapping) else dataclasses.replace(value, **new)


def _grouped(params: Mapping[str, object]) -> dict[str, tuple[bool, dict[str, object]]]:
    """Per option, whether it is set itself, and the values of its nested options."""
    groups: dict[str, tuple[bool, dict[str, Any]]] = {}
    for key, value in params.items():
        name, _, inner = key.partition("__")
        is_set, others = groups.get(name, (False, {}))
        groups[name] = (is_set, {**others, inner: value}) if inner else (True, others)
    return groups


def _check_known(owner: str, name: str, known: list[str]) -> None:
    if name not in known:
        hint = nearest_name(name, known) if known else "It has none"
        raise ConfigError(f"{owner} has no option {name!r}. {hint}")
