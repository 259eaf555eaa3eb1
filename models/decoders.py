"""Registry of decoders by name: built in, registered, or installed as entry points."""

import importlib
from collections.abc import Callable
from typing import Annotated

from pgm_places.errors import ConfigError, InputError, nearest_name
from pgm_places.models.built_in_decoders import DECODERS
from pgm_places.models.decoding_task import DecodingAnswer, DecodingTask, NamedDecoder
from pgm_places.options.marks import NameOf

GROUP = "pgm_places.decoders"
"""Entry-point group of decoders in other packages: ``name = "package.module:function"``."""

_OTHER_NAMES = {
    **dict.fromkeys(("alpha-expansion", "expansion", "maxflow", "min-cut"), "graph-cut"),
    **dict.fromkeys(("bp", "lbp", "loopy-bp", "belief-propagation"), "sum-product"),
    **dict.fromkeys(("junction-tree", "variable-elimination", "viterbi"), "exact"),
    "ilp": "lp",
    "max-sum": "max-product",
    "mf": "mean-field",
}
"""What decoders are called in papers and other libraries."""

_registered: dict[str, NamedDecoder] = {}


def decoder_names() -> list[str]:
    """The names of all decoders: built in, registered, or installed as entry points.

    Examples
    --------
    >>> decoder_names()[:3]
    ['graph-cut', 'lp', 'trw-s']
    """
    return list(dict.fromkeys([*DECODERS, *_registered, *sorted(_installed())]))


def named_decoder(name: str) -> NamedDecoder:
    """The decoder of that name; ConfigError if it is unknown, or its entry point is no function."""
    known = DECODERS.get(name) or _registered.get(name)
    if known is not None:
        return known
    target = _installed().get(name)
    if target is None:
        if name in _OTHER_NAMES:
            raise ConfigError(f"unknown decoder {name!r}; it is called {_OTHER_NAMES[name]!r} here")
        raise ConfigError(f"unknown decoder {name!r}. {nearest_name(name, decoder_names())}")
    module_name, _, attribute = target.partition(":")
    try:
        function = getattr(importlib.import_module(module_name), attribute, None)
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"decoder {name!r} needs {error.name!r}, which is not installed"
        ) from None
    if isinstance(function, NamedDecoder):
        return function
    if not callable(function):
        raise ConfigError(f"decoder {name!r}: {target} is not a function of a DecodingTask")
    return NamedDecoder(function)


def register_decoder(
    name: str,
    run: Callable[[DecodingTask], DecodingAnswer],
    *,
    gives_beliefs: bool = False,
    labels_maps: bool = True,
) -> None:
    """Register a decoder for this process, or replace a registered one.

    Afterwards ``inference = name`` and ``decode(..., name)`` accept it. Packages should use the
    entry points of :data:`GROUP` instead, which are found in every process. Test a decoder with
    :func:`~pgm_places.models.decoder_checks.check_decoder`.

    Parameters
    ----------
    name : str
    run : callable
        From a :class:`~pgm_places.models.decoding_task.DecodingTask` to a
        :class:`~pgm_places.models.decoding_task.DecodingAnswer`.
    gives_beliefs, labels_maps : bool
        See :class:`~pgm_places.models.decoding_task.NamedDecoder`.

    Raises
    ------
    InputError
        The name belongs to a built-in decoder.

    Examples
    --------
    >>> from pgm_places.inference.labeling import Status
    >>> def by_unary(task):
    ...     return DecodingAnswer(task.potentials.unary.argmax(axis=1), Status.CONVERGED)
    >>> register_decoder("by-unary", by_unary)
    >>> "by-unary" in decoder_names()
    True
    """
    if name in DECODERS:
        raise InputError(f"{name!r} is a decoder of this package; choose another name")
    _registered[name] = NamedDecoder(run, gives_beliefs, labels_maps)


def gives_beliefs(name: str) -> bool:
    """Whether the decoder of that name returns beliefs."""
    return named_decoder(name).gives_beliefs


def _installed() -> dict[str, str]:
    from importlib.metadata import entry_points  # slow to import: a tenth of a short command

    return {point.name: point.value for point in entry_points(group=GROUP)}


Decoder = Annotated[str, NameOf(tuple(DECODERS), decoder_names)]
"""Type of options that name a decoder; ``docs/inference.md`` compares them."""
