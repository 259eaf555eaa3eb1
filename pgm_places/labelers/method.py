"""Methods of labelers: resolving by name, checks of capabilities, inference alone or batched."""

import dataclasses
import inspect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._arguments import public_options
from pgm_places._arguments.words import described
from pgm_places._checks import integer_array, set_frozen, stacked_rows
from pgm_places.errors import ConfigError, quoted
from pgm_places.graph.edge_list import EdgeList
from pgm_places.graph.known_labels import known_beside
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.raster_edges import EdgeKind
from pgm_places.inference.backends import BACKENDS, METHODS, Backend, build, traits_of
from pgm_places.inference.labeling import Labeling, keep_evidence
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.decoders import named_decoder
from pgm_places.options import check_options
from pgm_places.solvers.adjacency import adjacency, is_forest
from pgm_places.unary.map_model import sees_spaces

Unary = Literal["auto", "laser", "context", "laser+space", "space", "floor"]


def as_backend(method: object) -> Backend:
    """A backend, or the backend of a method's name; ConfigError for other values."""
    backend = build(method) if isinstance(method, str) else method
    is_labeler = hasattr(backend, "set_learned")
    if isinstance(backend, type) or is_labeler or not isinstance(backend, Backend):
        raise ConfigError(f"a method must be a backend or a method's name, got {described(method)}")
    return backend


@public_options
@dataclass(frozen=True)
class PlaceMethod:
    """A backend and the kind of unary that it labels.

    Parameters
    ----------
    backend : Backend or str
        Any method of :mod:`pgm_places.inference.backends`, or its name.
    unary : {"auto", "laser", "context", "laser+space", "space", "floor"}
        Scores of the list on laser features (``laser``, the paper's), of the list with the features
        of the neighbourhood (``context``), of the list with space features (``space``), the
        geometric mean of ``laser`` and ``space``, or ``space`` fused with floor networks
        (``floor``). ``auto`` is the choice of
        :class:`~pgm_places.labelers.place_labeler.PlaceLabeler` for all methods: by default, the
        best on held-out scores.
    """

    backend: Any
    unary: Unary = "auto"

    def __post_init__(self) -> None:
        set_frozen(self, backend=as_backend(self.backend))
        check_options(self)

    @property
    def sees_spaces(self) -> bool:
        """Whether its unary uses space features."""
        return sees_spaces((self.unary,))


def place_methods(
    methods: Mapping[str, Any] | Sequence[str],
    has_context: bool,
    has_spaces: bool,
    has_networks: bool = False,
    unary: Unary = "auto",
) -> dict[str, PlaceMethod]:
    """The methods by name, built, with their unary; ``auto`` is resolved in training.

    ConfigError if there is no method, or one needs scores that the labeler does not compute.
    """
    if isinstance(methods, str) or not isinstance(methods, Iterable):
        raise ConfigError(f"methods must be a mapping or a list of names, got {quoted(methods)}")
    named = methods if isinstance(methods, Mapping) else {name: name for name in methods}
    if not named:
        raise ConfigError("a labeler needs at least one method")
    built = {}
    for name, entry in named.items():
        method = entry if isinstance(entry, PlaceMethod) else PlaceMethod(entry)
        method = with_unary({name: method}, unary)[name]
        missing = ""
        if method.unary == "context" and not has_context:
            missing = "context_m is empty; give the half-widths of its windows, for example "
            missing += "context_m=(0.3, 0.75, 1.5, 3.0)"
        elif method.sees_spaces and not has_spaces:
            missing = "space is None; give its options, for example space=SpaceOptions()"
        elif method.unary == "floor" and not has_networks:
            missing = "floor is None; give the networks, for example floor=trained_floor()"
        if missing:
            raise ConfigError(f"method {name!r} needs unary={method.unary!r} but {missing}")
        built[name] = method
    return built


def with_unary(methods: Mapping[str, PlaceMethod], unary: str) -> dict[str, PlaceMethod]:
    """The methods, with ``unary`` for each method whose unary is "auto"."""
    return {
        name: replace(method, unary=unary) if method.unary == "auto" else method  # type: ignore[arg-type]
        for name, method in methods.items()
    }


def unfitted(backend: Any) -> Any:
    """The backend with its options, without learned arrays."""
    learned = [field.name for field in dataclasses.fields(backend) if field.metadata.get("learned")]
    return dataclasses.replace(backend, **dict.fromkeys(learned))


def with_edge_kinds(backend: Any) -> Any:
    """The backend with a weight for each kind of edge, if its edge features are ``auto``."""
    if getattr(backend, "edge_features", None) != ("auto",):
        return backend
    return dataclasses.replace(backend, edge_features=("constant", "kind"))


def with_shares(backend: Any, truths: Sequence[NDArray[np.int64]], n_labels: int) -> Any:
    """The backend with the labels' shares in training, if it divides by the prior."""
    learn = getattr(backend, "with_shares", None)
    return backend if learn is None else learn(truths, n_labels)


def check_labels_any_graph(name: str, backend: object, what: str) -> None:
    """Raise ConfigError, with the methods for any graph, if a method can label only chains."""
    if traits_of(backend).chains_only:
        others = [other for other in BACKENDS if not traits_of(METHODS.find(other)).chains_only]
        raise ConfigError(
            f"{name} ({type(backend).__name__}) labels only chains such as trajectories, and "
            f"{what} is not a chain; use one of {', '.join(others)}"
        )


def check_labels_maps(name: str, backend: object) -> None:
    """Raise ConfigError if a method or its decoder cannot label maps, whose graphs have cycles."""
    check_labels_any_graph(name, backend, "a map")
    decoder = getattr(backend, "inference", None)
    if decoder not in (None, "auto") and not named_decoder(decoder).labels_maps:
        raise ConfigError(
            f"{name}: inference = {decoder!r} labels only graphs of few cycles, and a map has "
            "many; use 'graph-cut' or 'trw-s'"
        )


def infer(backend: Any, problem: LabelingProblem, truth: ArrayLike | None = None) -> Labeling:
    """A backend's labelling of a problem; with ``truth`` it records its accuracy if it can.

    Observed labels are enforced, also for plug-ins that ignore them.
    """
    if truth is not None:
        shape = (problem.graph.n_nodes,)
        truth = integer_array("truth", truth, shape, low=-1, high=problem.n_labels)
    follows = truth is not None and "truth" in inspect.signature(backend.infer).parameters
    options = {"truth": truth} if follows else {}
    return keep_evidence(problem, backend.infer(problem, **options))


def infer_further(
    backend: Any,
    problem: LabelingProblem,
    further: NDArray[np.float64],
    truth: ArrayLike | None = None,
) -> Labeling:
    """:func:`infer` with log-likelihoods (N, K) of further observations.

    Backends with an observation model get them separately; for others they are added to the unary.
    """
    if "further" in inspect.signature(backend.infer).parameters:
        labeling: Labeling = backend.infer(problem, further=further)
        return labeling
    assert problem.unary is not None
    unary = problem.unary + further
    unary = unary - np.logaddexp.reduce(unary, axis=1, keepdims=True)
    return infer(backend, dataclasses.replace(problem, unary=unary), truth)


# Decoders that label each tree of a forest as if it were alone.
EXACT_ON_FORESTS = ("max-product", "sum-product", "exact")

# Edge features that need kinds of edges, or whose units depend on the complete graph.
WHOLE_GRAPH_FEATURES = {"diagonal", "kind", "raw-difference"}


def label_many(backend: Any, problems: Sequence[LabelingProblem]) -> list[Labeling]:
    """The labelling of each problem by a method, such as ``build("crf").fit(...)``.

    Networks and fields (``amn``, ``crf``) label graphs without cycles in one call, if the decoder
    is exact on them and no edge feature depends on the complete graph (as ``raw-difference`` does).
    Labels and beliefs are equal up to rounding, at a fraction of the time; score, bound and
    ``info`` are omitted. Other problems are labelled one by one.
    """
    stack = stack_problems(problems) if _is_stackable(backend, problems) else None
    if stack is None or _decoder(backend, stack) not in EXACT_ON_FORESTS:
        return [infer(backend, problem) for problem in problems]
    return unstack(infer(backend, stack), problems)


def stack_problems(problems: Sequence[LabelingProblem]) -> LabelingProblem | None:
    """Several problems as one problem on the disjoint union of their graphs.

    None if stacking could change the labels: for different label names, features that only some
    problems have, cycles, cliques, or diagonals of grids. Layouts and kinds of edges are dropped.
    """
    first = problems[0]
    sizes = [problem.graph.n_nodes for problem in problems]
    starts = np.cumsum([0, *sizes])
    alike = all(
        problem.label_names == first.label_names
        and problem.cliques is None
        and not _has_diagonals(problem)
        and (problem.unary is None) == (first.unary is None)
        and (problem.node_features is None) == (first.node_features is None)
        and (problem.edge_features is None) == (first.edge_features is None)
        for problem in problems
    )
    if not alike:
        return None
    edges = np.concatenate(
        [problem.graph.edges + start for problem, start in zip(problems, starts[:-1], strict=True)]
    )
    if not is_forest(adjacency(int(starts[-1]), edges)):
        return None
    return LabelingProblem(
        LabelGraph(int(starts[-1]), EdgeList(edges)),
        first.label_names,
        _stacked([problem.unary for problem in problems]),
        _stacked([problem.node_features for problem in problems]),
        _stacked([problem.edge_features for problem in problems]),
        known_beside([(problem.known, problem.graph.n_nodes) for problem in problems]),
        unseen=_unobserved_stacked(problems),
    )


def unstack(stack: Labeling, problems: Sequence[LabelingProblem]) -> list[Labeling]:
    """The labelling of each of the stacked problems."""
    ends = np.cumsum([problem.graph.n_nodes for problem in problems])[:-1]
    labels = np.split(stack.labels, ends)
    if stack.beliefs is None:
        return [Labeling(each, stack.status) for each in labels]
    beliefs = np.split(stack.beliefs, ends)
    return [
        Labeling(each, stack.status, belief) for each, belief in zip(labels, beliefs, strict=True)
    ]


def _is_stackable(backend: Any, problems: Sequence[LabelingProblem]) -> bool:
    if len(problems) < 2 or not traits_of(backend).sees_parts_alone:
        return False
    return WHOLE_GRAPH_FEATURES.isdisjoint(backend.edge_names(problems[0]))


def _decoder(backend: Any, problem: LabelingProblem) -> str:
    """The name of the decoder that a network or field uses for a problem."""
    chosen = getattr(backend, "decoder_for", None)
    return str(backend.inference if chosen is None else chosen(problem))


def _has_diagonals(problem: LabelingProblem) -> bool:
    kinds = problem.graph.edge_kind
    return kinds is not None and bool((kinds == EdgeKind.DIAGONAL).any())


def _unobserved_stacked(problems: Sequence[LabelingProblem]) -> NDArray[np.bool_] | None:
    if all(problem.unseen is None for problem in problems):
        return None
    return np.concatenate(
        [
            np.zeros(problem.graph.n_nodes, np.bool_) if problem.unseen is None else problem.unseen
            for problem in problems
        ]
    )


def _stacked(arrays: Sequence[Any]) -> Any:
    return None if arrays[0] is None else stacked_rows(arrays)
