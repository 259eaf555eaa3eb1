"""An experiment from its configuration: load the maps, learn, label, evaluate."""

import importlib.metadata
import logging
import os
import platform
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._version import __version__
from pgm_places.errors import ConfigError, LabelError
from pgm_places.evaluation.evaluation import Evaluation, evaluate
from pgm_places.experiment.comparison import (
    Comparison,
    MethodResult,
    TestMap,
    history_of,
    learning_of,
    score_intervals,
)
from pgm_places.experiment.config import (
    ExperimentConfig,
    MapConfig,
    MethodConfig,
    build_features,
    build_method,
)
from pgm_places.experiment.config_changes import changed_config
from pgm_places.graph.layout import GridLayout
from pgm_places.io.checks import sha256_of
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.io.maps.windows import window_mask
from pgm_places.labelers.place_labeler import PlaceLabeler, PlaceMethod
from pgm_places.maps.coarsening import coarsen, coarsen_labels
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.plugins import option_values
from pgm_places.progress import Progress, Silent
from pgm_places.sensing.sensor import Sensor, SensorNoise

if TYPE_CHECKING:
    from pgm_places.experiment.selection import Selection

__all__ = ["Experiment", "compare", "compare_fitted", "load_maps", "make_labeler", "train"]

logger = logging.getLogger(__name__)

DATA_VARIABLE = "PGM_PLACES_DATA"
REPORTED_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba", "cvxpy", "osqp", "networkx")


@dataclass
class Experiment:
    """A configuration with its folder, and what was noticed while it ran."""

    config: ExperimentConfig
    folder: Path
    progress: Progress = field(default_factory=Silent)
    n_threads: int | None = None
    inputs: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    selection: "Selection | None" = None

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Add the time spent in the block to the stage of that name."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def warn(self, message: str) -> None:
        """Keep a warning for the results and show it once."""
        if message not in self.warnings:
            self.warnings.append(message)
            self.progress.warn(message)

    def resolve(self, name: str) -> Path:
        """A path of the configuration, relative to the configuration's folder.

        A leading ``$NAME`` is replaced by that environment variable, taken as a folder.
        """
        if name.startswith("$"):
            variable, _, rest = name[1:].partition("/")
            folder = os.environ.get(variable)
            if not folder:
                raise ConfigError(
                    f"the path {name!r} needs the environment variable {variable}; set it to the "
                    "folder that holds the data"
                )
            return (Path(folder) / rest).resolve()
        return (self.folder / Path(name).expanduser()).resolve()

    def record_input(self, path: Path) -> None:
        """Keep the hash of a file that was read, by the shortest name that says where it was."""
        self.inputs[self._shown(path)] = sha256_of(path)

    def _shown(self, path: Path) -> str:
        """The path from the data folder or the configuration's, so that results name no machine."""
        data = os.environ.get(DATA_VARIABLE)
        if data and path.is_relative_to(Path(data).resolve()):
            return f"${DATA_VARIABLE}/{path.relative_to(Path(data).resolve()).as_posix()}"
        if path.is_relative_to(self.folder):
            return path.relative_to(self.folder).as_posix()
        return str(path)


def load_maps(experiment: Experiment, part: str) -> list[LabelledMap]:
    """The maps of ``"train"`` or ``"test"``, coarsened and windowed as configured."""
    sources: Sequence[MapConfig] = getattr(experiment.config, part)
    with experiment.timed("load"), experiment.progress.stage(f"{part} maps") as stage:
        maps = []
        for index, source in enumerate(sources):
            maps.append(_load_map(experiment, source, f"{part}[{index}]"))
            stage.update((index + 1) / len(sources), maps[-1].name)
    return maps


def _load_map(experiment: Experiment, source: MapConfig, where: str) -> LabelledMap:
    columns = source.columns
    if source.generated is None:
        grid, labels, origin = _read_map(experiment, source)
    else:
        grid, labels, origin, split = _generated(experiment, source.generated, source.drawn)
        if source.half is not None:
            columns = (0, split) if source.half == "left" else (split, None)
    window = window_mask(grid, columns=columns, rows=source.rows, x_m=source.x_m, y_m=source.y_m)
    target_m = experiment.config.resolution_m
    if target_m is not None and not np.isclose(target_m, grid.resolution_m, rtol=1e-3, atol=0):
        coarse = coarsen(grid, target_m)
        labels = coarsen_labels(labels, grid, coarse)
        # A coarse cell belongs to the window that holds its centre.
        centres = coarse.cell_centres_m(np.argwhere(np.ones(coarse.shape, np.bool_)))
        cells = grid.cells_at_m(centres)
        inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
        chosen = np.zeros(len(cells), np.bool_)
        chosen[inside] = window[cells[inside, 0], cells[inside, 1]]
        window, grid = chosen.reshape(coarse.shape), coarse
    name = source.name or _default_name(source, origin)
    found = LabelledMap(grid, labels, window, name, source.building or str(origin))
    if not found.labelled_cells.any():
        raise LabelError(
            f"{where} ({name}): no free cell inside the window has a label; check that the labels "
            "belong to this map and that the window covers them"
        )
    return found


def _read_map(
    experiment: Experiment, source: MapConfig
) -> tuple[OccupancyGrid, NDArray[np.int16], Path]:
    names = experiment.config.labels.names
    yaml_path = experiment.resolve(str(source.map))
    loaded = load_map(yaml_path, compat=source.compat, unknown_value=source.unknown_value)
    for message in loaded.warnings:
        experiment.warn(message)
    for path in (loaded.yaml_path, loaded.image_path):
        experiment.record_input(path)
    if source.labels is not None:
        label_path = experiment.resolve(source.labels)
        labels = load_labels(label_path, names, grid=loaded.grid)
    else:
        label_path = experiment.resolve(str(source.regions))
        labels = load_regions(label_path, names, loaded.grid, classes=source.classes)
    experiment.record_input(label_path)
    return loaded.grid, labels, yaml_path


def _title(seed: int, drawn: dict[str, Any]) -> str:
    how = ", ".join(f"{key} {value}" for key, value in drawn.items())
    return f"generated building {seed}" + (f" ({how})" if how else "")


def _generated(
    experiment: Experiment, seed: int, drawn: dict[str, Any]
) -> tuple[OccupancyGrid, NDArray[np.int16], Path, int]:
    """A generated building, its labels those of the configuration by name, and where to cut it."""
    from pgm_places.datasets.building import generate_building

    building = generate_building(seed, **drawn)
    names = experiment.config.labels.names
    numbers = [names.index(name) if name in names else -1 for name in building.label_names]
    # The entry after the last serves -1, "no label".
    labels = np.array([*numbers, -1], np.int16)[building.labels]
    return building.grid, labels, Path(_title(seed, drawn)), building.split_column


def _default_name(source: MapConfig, origin: Path) -> str:
    name = origin.stem if origin.stem != "map" else origin.parent.name
    parts = [] if source.half is None else [f"{source.half} half"]
    for axis in ("columns", "rows", "x_m", "y_m"):
        limits = getattr(source, axis)
        if limits is not None:
            low, high = ("" if value is None else f"{value:g}" for value in limits)
            parts.append(f"{axis} {low}..{high}")
    return f"{name} ({', '.join(parts)})" if parts else name


def make_labeler(config: ExperimentConfig) -> PlaceLabeler:
    """The unfitted labeler that a configuration describes."""
    from pgm_places.models.decision_list import DecisionListClassifier

    names = tuple(config.labels.names)
    noise = config.sensor.noise
    sensor = Sensor(
        n_beams=config.sensor.n_beams,
        max_range_m=config.sensor.max_range_m,
        stop_at_unknown=config.sensor.stop_at_unknown,
        noise=None if noise is None else SensorNoise(**noise.model_dump()),
    )
    settings = config.classifier
    order: Any = settings.order
    if isinstance(order, list):
        rest = [name for name in names if name not in order]
        order = [names.index(name) for name in (*order, *rest)]
    classifier = DecisionListClassifier(
        n_rounds=settings.n_rounds,
        order=order,
        decision=settings.decision,
        calibration=settings.calibration,
        prior_weight=settings.prior_weight,
    )
    context_m = tuple(config.context.half_widths_m)
    methods = {
        method.id: PlaceMethod(build_method(method), resolved_unary(method, bool(context_m)))
        for method in config.methods
    }
    if all(method.unary == "laser" for method in methods.values()):
        context_m = ()  # nobody asks for it
    return PlaceLabeler(
        names,
        methods,
        sensor,
        classifier,
        config.connectivity,
        context_m,
        settings.learn_on,
        settings.n_folds,
        settings.node_features,
        settings.max_examples_per_map,
        build_features(config),
    )


def resolved_unary(method: MethodConfig, has_context: bool) -> str:
    """Which unary a method gets: AdaBoost alone stays the paper's, structure takes context."""
    if method.unary != "auto":
        return method.unary
    return "context" if has_context and method.name != "independent" else "laser"


def train(experiment: Experiment) -> PlaceLabeler:
    """The labeler of the configuration, fitted on its training maps.

    Where the configuration has a table ``[select]``, options are chosen first on the training maps
    alone; ``experiment.config`` is then the chosen configuration, and ``experiment.selection`` says
    what was tried.
    """
    maps = load_maps(experiment, "train")
    if experiment.config.select is not None:
        from pgm_places.experiment.selection import select  # which learns experiments itself

        with experiment.timed("select"):
            experiment.selection = select(experiment, maps)
        experiment.config = changed_config(experiment.config, experiment.selection.chosen.options)
    labeler = make_labeler(experiment.config)
    with experiment.timed("learn"):
        return labeler.fit(maps, n_threads=experiment.n_threads, progress=experiment.progress)


def compare(experiment: Experiment) -> Comparison:
    """All methods of the configuration, learned on its training maps, on all of its test maps.

    Raises
    ------
    ConfigError
        There are no test maps.
    """
    if not experiment.config.test:
        raise ConfigError("a comparison needs at least one [[test]] map; there is none")
    # Test maps are read before anything is learned: what is wrong with them shows at once.
    tests = load_maps(experiment, "test")
    return compare_fitted(experiment, train(experiment), tests)


def compare_fitted(
    experiment: Experiment, labeler: PlaceLabeler, tests: Sequence[LabelledMap]
) -> Comparison:
    """All methods of a fitted labeler on test maps with their labels."""
    config = experiment.config
    maps, scored = [], []
    for item in tests:
        with experiment.timed("score cells"):
            graph, scores = labeler.scores(
                item.grid,
                mask=item.cells,
                n_threads=experiment.n_threads,
                progress=experiment.progress,
            )
        assert isinstance(graph.layout, GridLayout)  # from_grid made it
        window = np.ones(item.grid.shape, np.bool_) if item.window is None else item.window
        maps.append(TestMap(item.name, item.grid, item.labels, graph.layout, window))
        scored.append((graph, scores, item.truth(graph)))
    methods = [_run_method(experiment, labeler, name, scored, maps) for name in labeler.methods]
    return Comparison(
        title=config.title or "Place labelling",
        label_names=tuple(config.labels.names),
        maps=tuple(maps),
        methods=tuple(methods),
        stage_seconds=dict(experiment.seconds),
        config=resolved_config(config, labeler),
        versions=versions(),
        inputs=dict(experiment.inputs),
        warnings=tuple(experiment.warnings),
        selection=None if experiment.selection is None else experiment.selection.to_dict(),
    )


def _run_method(
    experiment: Experiment,
    labeler: PlaceLabeler,
    name: str,
    scored: Sequence[Any],
    maps: Sequence[TestMap],
) -> MethodResult:
    method = labeler.method(name)
    labelings, evaluations = [], []
    start = time.perf_counter()
    with experiment.progress.stage(f"labelling with {name}") as stage:
        for index, (graph, scores, _) in enumerate(scored):
            labelings.append(labeler.infer(graph, scores, name))
            stage.update((index + 1) / len(scored))
    infer_seconds = time.perf_counter() - start
    histories = [history_of(labeling) for labeling in labelings]
    if labeler.follows_truth(name):  # once more, as following takes time of its own
        histories = [
            history_of(labeler.infer(graph, scores, name, truth=truth))
            for graph, scores, truth in scored
        ]
    for labeling, (_, _, truth) in zip(labelings, scored, strict=True):
        evaluations.append(
            evaluate(truth, labeling.labels, labeler.label_names, beliefs=labeling.beliefs)
        )
    return MethodResult(
        id=name,
        name=type(method.backend).__name__,
        options={"unary": method.unary, **option_values(method.backend)},
        labelings=tuple(labelings),
        evaluations=tuple(evaluations),
        evaluation=Evaluation.merged(evaluations),
        seconds={"learn": method.seconds, "infer": infer_seconds},
        learned=dict(getattr(method.backend, "summary", None) or {}),
        intervals=score_intervals(maps, labelings, len(labeler.label_names)),
        histories=tuple(histories),
        learning=learning_of(method.backend),
    )


def resolved_config(config: ExperimentConfig, labeler: PlaceLabeler) -> dict[str, Any]:
    """The configuration with every default written out, as plain data."""
    content: dict[str, Any] = config.model_dump(mode="json")
    content["methods"] = [
        {
            "id": method.id,
            "name": method.name,
            "unary": labeler.methods[method.id].unary,
            **option_values(labeler.methods[method.id].backend),
        }
        for method in config.methods
    ]
    return content


def versions() -> Mapping[str, str]:
    """The versions that a result depends on."""
    found = {"pgm-places": __version__, "python": platform.python_version()}
    for package in REPORTED_PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found
