"""An experiment: its configuration and folder, and the records of its runs."""

import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pgm_places.errors import LearningWarning
from pgm_places.experiment.config import ExperimentConfig
from pgm_places.experiment.feature_cache import FeatureCache
from pgm_places.experiment.source_config import SourceConfig
from pgm_places.experiment.source_patterns import resolved_path
from pgm_places.io.input_file import sha256_of
from pgm_places.kernels.threads import thread_limit
from pgm_places.progress import Progress, Silent, report_stage, reporting_to

DATA_VARIABLE = "PGM_PLACES_DATA"


@dataclass(frozen=True)
class Experiment:
    """A configuration with the folder of its paths, and the records of its runs.

    ``selection`` has the candidates of a selection of options. Variants of an experiment
    (``dataclasses.replace``) share the records: the hash of each input file, the seconds of each
    stage, and warnings.
    """

    config: ExperimentConfig
    folder: Path
    progress: Progress = field(default_factory=Silent)
    n_threads: int | None = None
    feature_cache: FeatureCache | None = None
    selection: Mapping[str, Any] | None = None
    inputs: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Run a block with the experiment's threads and progress; its time counts for a stage."""
        start = time.perf_counter()
        try:
            with thread_limit(self.n_threads), reporting_to(self.progress):
                yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def loaded(
        self,
        part: str,
        what: str,
        wanted: Callable[[SourceConfig], bool],
        load: Callable[["Experiment", SourceConfig, str], Any],
    ) -> list[Any]:
        """Load the wanted sources of ``"train"`` or ``"test"``, in order.

        The last argument of ``load`` is the position of a source in the file, for messages.
        """
        sources = enumerate(getattr(self.config, part))
        chosen = [(f"{part}[{index}]", source) for index, source in sources if wanted(source)]
        loaded: list[Any] = []
        with self.timed("load"), report_stage(f"{part} {what}") as stage:
            for where, source in chosen:
                loaded.append(load(self, source, where))
                stage.update(len(loaded) / len(chosen), loaded[-1].name)
        return loaded

    @contextmanager
    def learning(self) -> Iterator[None]:
        """The stage ``learn``, whose warnings are recorded."""
        with self.timed("learn"), warnings.catch_warnings():
            warnings.simplefilter("always", LearningWarning)
            show_other = warnings.showwarning

            def show(
                message: Warning | str, category: type[Warning], *where: Any, **named: Any
            ) -> None:
                if issubclass(category, LearningWarning):
                    self.warn(str(message))
                else:
                    show_other(message, category, *where, **named)

            warnings.showwarning = show
            yield

    def warn(self, message: str) -> None:
        """Record a warning and show it once."""
        if message not in self.warnings:
            self.warnings.append(message)
            self.progress.warn(message)

    def resolve(self, name: str) -> Path:
        """The absolute path of a name in the configuration."""
        return resolved_path(name, self.folder)

    def record_input(self, path: Path) -> None:
        """Record the hash of a file that was read, under the shortest unambiguous name."""
        self.inputs[self._shown(path)] = sha256_of(path)

    def _shown(self, path: Path) -> str:
        """The path relative to the data folder or the configuration, for portable results."""
        data = os.environ.get(DATA_VARIABLE)
        if data and path.is_relative_to(Path(data).resolve()):
            return f"${DATA_VARIABLE}/{path.relative_to(Path(data).resolve()).as_posix()}"
        if path.is_relative_to(self.folder):
            return path.relative_to(self.folder).as_posix()
        return str(path)
