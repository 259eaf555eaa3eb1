"""What all labelers share: options in the constructor, learned attributes, one signature.

The contract is scikit-learn's, so that its ``clone`` and its grid searches take any labeler, but
scikit-learn is not imported: it takes a second, and labelling does without it.

``Labeler(options)``
    Keeps the options as they are; ``fit`` checks them before anything is learned.
``fit(...)``
    Learns into attributes with a trailing underscore, and returns the labeler.
``scores(thing)``
    The classifier's scores of each node on its own.
``infer(thing, scores)``
    The method's labelling of given scores: a
    :class:`~pgm_places.inference.labeling.Labeling`.
``label(thing)``
    Both.
``save(labeler, folder)``, ``load(folder)``
    Of :mod:`pgm_places.persistence.stored`, for all labelers and backends alike.

The thing is a map for PlaceLabeler, a trajectory for TrajectoryLabeler, a map and a trajectory
through it for JointLabeler, and a problem for StructuredLabeler. Keywords mean the same wherever
they occur:

``method``
    Name of the method to use, where a labeler has several; the last one by default.
``mask``
    (H, W) bool, the cells of a map to label; all free cells by default.
``truth``
    (N,) true label indices or -1: methods that can follow their accuracy add it to their history.
    The labels are the same.
``n_threads``
    Threads to use, all by default; results are the same bits for any number.
``progress``
    Where stages and warnings are reported; nowhere by default.
"""

import copy
import dataclasses
import inspect
import time
from collections.abc import Callable, Hashable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args, get_origin

from pgm_places._argument_kinds import NO, check_of, hints_of
from pgm_places._argument_words import described, words
from pgm_places._arguments import public_options
from pgm_places.errors import ConfigError, NotFittedError, nearest_name
from pgm_places.inference.backends import Learnable, traits_of
from pgm_places.labelers.method import as_backend
from pgm_places.options import check_option, option_values
from pgm_places.progress import report_stage


def learned_with(methods: Mapping[str, tuple[Any, str]]) -> dict[str, str]:
    """For each method that need not learn, the first one that learns the same.

    Parameters
    ----------
    methods : mapping of str to (Backend, str)
        The backends with the unary that each is given. Learned ones that share their arrays are
        told, too.

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
        key = _what_is_learned(backend)
        if key is None:
            continue
        other = first.setdefault((key, unary), name)
        if other != name:
            shared[name] = other
    return shared


def as_fitted(backend: Any, fitted: Any) -> Any:
    """The fitted backend, labelling as another one does that learns the same."""
    chosen = {name: getattr(backend, name) for name in traits_of(backend).labelling_options}
    return dataclasses.replace(fitted, **chosen)


def _what_is_learned(backend: object) -> Hashable | None:
    """What learning depends on; None for what learns nothing, or says nothing of that."""
    if not isinstance(backend, Learnable) or not traits_of(backend).labelling_options:
        return None
    others = set(option_values(backend)) - set(traits_of(backend).labelling_options)
    options = sorted((name, repr(getattr(backend, name))) for name in others)
    arrays = [
        id(getattr(backend, item.name))
        for item in dataclasses.fields(backend)  # type: ignore[arg-type]
        if item.metadata.get("learned")
    ]
    return type(backend), *options, *arrays


@public_options
class Labeler:
    """Base class: scikit-learn parameters, fitted state, repr.

    Attributes
    ----------
    label_names_ : tuple of K str
        The labels that were learned; its presence says that the labeler is fitted.
    """

    label_names_: tuple[str, ...]

    stored_as: ClassVar[str] = ""
    _method_option: ClassVar[str] = "method"
    _call_first: ClassVar[str] = "fit(...)"

    # ------------------------------------------------------------------ options

    def check_options(self) -> None:
        """Refuse options that are not understood; ``fit`` does so before anything is learned.

        The annotations of the constructor say what an option takes.

        Raises
        ------
        ConfigError
            One line: the option, what it takes, what came.
        """
        for name, hint in hints_of(type(self).__init__).items():
            value = getattr(self, name)
            if _is_limited(hint):
                check_option(name, hint, value)
            elif check_of(hint)(value) is NO:
                raise ConfigError(f"{name} must be {words(hint)}, got {described(value)}")

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The options by name; with ``deep`` also options of options: ``sensor__n_beams``."""
        options = {name: getattr(self, name) for name in self._defaults()}
        return _with_inner(options, self._part) if deep else options

    def set_params(self, **params: Any) -> Self:
        """The labeler itself with other options; what it has learned stays until the next fit.

        Raises
        ------
        ConfigError
            There is no such option; the nearest is offered.
        """
        known = list(self._defaults())
        for name, (given, inner) in _grouped(params).items():
            _check_known(type(self).__name__, name, known)
            if given:
                setattr(self, name, params[name])
            if inner:
                setattr(self, name, _changed(self._part(name), inner))
        return self

    def with_options(self, **params: Any) -> Self:
        """A copy that has learned the same and labels with other options.

        Options of a method go to the fitted one as well: ``method__mode="viterbi"``. Options that
        only learning reads take effect when the copy is fitted again.
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
        """The options as notebooks show scikit-learn's estimators."""
        from sklearn.utils import estimator_html_repr

        return str(estimator_html_repr(self))

    @classmethod
    def _defaults(cls) -> dict[str, Any]:
        """The constructor's parameters in order, with their defaults."""
        parameters = list(inspect.signature(cls.__init__).parameters.values())[1:]
        return {item.name: item.default for item in parameters}

    def _part(self, name: str) -> Any:
        """An option as an object with options of its own; a method's name as the method."""
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
        """A labeler per method, the last of them this one, with what ``learn`` makes of each.

        ``learn`` returns the learned attributes by name, the method's with an underscore after the
        option's; ``learn_seconds_`` is how long it took. Methods that learn the same are learned
        once, and the first of them has the seconds.
        """
        shared = learned_with({name: (method, "") for name, method in methods.items()})
        learned: dict[str, Mapping[str, Any]] = {}
        labelers: dict[str, Self] = {}
        option = self._method_option
        for name, method in methods.items():
            start = time.perf_counter()
            if name in shared:
                of_first = learned[shared[name]]
                fitted = as_fitted(method, of_first[f"{option}_"])
                learned[name] = {**of_first, f"{option}_": fitted}
            else:
                with report_stage(f"method {name}".rstrip()):
                    learned[name] = learn(method)
            spent = 0.0 if name in shared else time.perf_counter() - start
            last = len(labelers) == len(methods) - 1
            labeler = self if last else copy.copy(self)
            if len(methods) > 1:
                labeler.set_params(**{option: method})
            labelers[name] = labeler.set_learned(learn_seconds_=spent, **learned[name])
        return labelers

    def check_fitted(self) -> None:
        """Refuse what only a fitted labeler can do.

        Raises
        ------
        NotFittedError
            Before ``fit``.
        """
        if not self.__sklearn_is_fitted__():
            raise NotFittedError(
                f"this {type(self).__name__} has not learned yet; call {self._call_first} first"
            )

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "label_names_")

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import Tags, TargetTags

        return Tags(estimator_type=None, target_tags=TargetTags(required=False))


def _is_limited(hint: object) -> bool:
    """Whether an annotation says more of its values than their type."""
    return get_origin(hint) in (Annotated, Literal) or any(map(_is_limited, get_args(hint)))


def _options_of(value: object, *, deep: bool) -> dict[str, object]:
    """The options of an option: of an estimator, of a dataclass, or the items of a mapping."""
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
    """The options with those of their parts, called ``sensor__n_beams``."""
    every = dict(options)
    for name in options:
        inner = _options_of(part(name), deep=True)
        every |= {f"{name}__{key}": value for key, value in inner.items()}
    return every


def _changed(value: Any, params: Mapping[str, Any]) -> Any:
    """The value with other options; the one that is given stays as it is."""
    if hasattr(value, "set_params"):
        try:
            return copy.deepcopy(value).set_params(**params)
        except ValueError as error:  # scikit-learn's own words for a name that it does not know
            raise ConfigError(str(error)) from None
    known = _options_of(value, deep=False)
    new = {}
    for name, (given, inner) in _grouped(params).items():
        _check_known(type(value).__name__, name, list(known))
        new[name] = params[name] if given else known[name]
        if inner:
            new[name] = _changed(new[name], inner)
    return {**value, **new} if isinstance(value, Mapping) else dataclasses.replace(value, **new)


def _grouped(params: Mapping[str, object]) -> dict[str, tuple[bool, dict[str, object]]]:
    """Per option whether it is given itself, and what is given of its own options."""
    found: dict[str, tuple[bool, dict[str, Any]]] = {}
    for key, value in params.items():
        name, _, inner = key.partition("__")
        given, others = found.get(name, (False, {}))
        found[name] = (given, {**others, inner: value}) if inner else (True, others)
    return found


def _check_known(owner: str, name: str, known: list[str]) -> None:
    if name not in known:
        hint = nearest_name(name, known) if known else "It has none"
        raise ConfigError(f"{owner} has no option {name!r}. {hint}")
