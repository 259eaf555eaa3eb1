"""An experiment: its configuration and folder, and the notes of its runs."""

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
    """A configuration with its folder, and the notes of its runs.

    Parameters
    ----------
    config : ExperimentConfig
    folder : Path
        What the configuration's paths are relative to.
    progress : Progress
    n_threads : int, optional
    feature_cache : FeatureCache, optional
        Keeps the features of training maps from one training to the next.
    selection : mapping, optional
        If options were chosen: the candidates tried (``Selection.to_dict``).
    inputs, seconds, warnings
        Notes, shared by all variants of an experiment (``dataclasses.replace``): the hash of each
        file read, the seconds of each stage, and warnings.
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
        """Work with the experiment's threads and progress; its time is added to the named stage."""
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
        """The wanted sources of ``"train"`` or ``"test"``, in their order.

        ``load`` is given the place of a source in the configuration, to name it in messages.
        """
        sources = enumerate(getattr(self.config, part))
        chosen = [(f"{part}[{index}]", item) for index, item in sources if wanted(item)]
        found: list[Any] = []
        with self.timed("load"), report_stage(f"{part} {what}") as stage:
            for where, source in chosen:
                found.append(load(self, source, where))
                stage.update(len(found) / len(chosen), found[-1].name)
        return found

    @contextmanager
    def learning(self) -> Iterator[None]:
        """The stage ``learn``: its warnings are stored for the results."""
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
        """Keep a warning for the results and show it once."""
        if message not in self.warnings:
            self.warnings.append(message)
            self.progress.warn(message)

    def resolve(self, name: str) -> Path:
        """A path of the configuration, relative to the configuration's folder."""
        return resolved_path(name, self.folder)

    def record_input(self, path: Path) -> None:
        """Record the hash of a file that was read, under the shortest unambiguous name."""
        self.inputs[self._shown(path)] = sha256_of(path)

    def _shown(self, path: Path) -> str:
        """The path relative to the data folder or the configuration: results name no machine."""
        data = os.environ.get(DATA_VARIABLE)
        if data and path.is_relative_to(Path(data).resolve()):
            return f"${DATA_VARIABLE}/{path.relative_to(Path(data).resolve()).as_posix()}"
        if path.is_relative_to(self.folder):
            return path.relative_to(self.folder).as_posix()
        return str(path)
