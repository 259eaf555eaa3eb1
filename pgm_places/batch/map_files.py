"""The files of one labelled map, written as one set while large arrays wait in files."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.batch.ready_model import ReadyModel
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.output_set import OutputSet
from pgm_places.kernels.pages import return_freed
from pgm_places.labelers.label_map import LabelledPlaces, label_map
from pgm_places.pictures.drawing import Packing
from pgm_places.progress import Progress
from pgm_places.report.label_files import Outputs, write_labels, write_places
from pgm_places.spaces.unentered import Unentered
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap


@dataclass(frozen=True, eq=False)
class LabelledFile:
    """What labelling a map's file gave.

    Parameters
    ----------
    summary : str
        One line: the area of each label and how the method ended.
    labels : (H, W) int16
        Label index per free cell in the map's order, -1 elsewhere.
    area_m2 : dict of str to float
        Area of each label.
    warnings : tuple of str
        Of the file and of the labelling.
    topology : TopologicalMap
        The places.
    unentered : Unentered or None
        Free space without labels because it was never entered.
    """

    summary: str
    labels: NDArray[np.int16]
    area_m2: dict[str, float]
    warnings: tuple[str, ...]
    topology: TopologicalMap
    unentered: Unentered | None = None


def label_file(
    model: ReadyModel,
    source: MapFile,
    files: OutputSet,
    *,
    known: NDArray[np.int16] | None = None,
    max_cells: int | None = None,
    outputs: Outputs | None = None,
    n_threads: int | None = None,
    progress: Progress,
) -> LabelledFile:
    """Label a map that has been read and write everything that ``pgm-places label`` promises.

    ``known`` (H, W) holds labels that are known, -1 elsewhere; no map is refined to more cells than
    ``max_cells``; ``outputs`` leaves some files out.
    """
    return write_labelled(
        label_map(  # without a name here, so that the labels of a huge map's nodes can be freed
            model.labeler,
            source.grid,
            method=model.method,
            known=known,
            entered=model.entered,
            max_cells=max_cells,
            n_threads=n_threads,
            progress=progress,
        ),
        source,
        files,
        model.rules,
        progress,
        outputs=outputs,
        n_threads=n_threads,
    )


def write_labelled(
    result: LabelledPlaces,
    source: MapFile,
    files: OutputSet,
    rules: TopologyOptions,
    progress: Progress,
    *,
    outputs: Outputs | None = None,
    n_threads: int | None = None,
) -> LabelledFile:
    """Write a labelled map and its places; ``outputs`` leaves some files out."""
    outputs = outputs or Outputs()
    with Packing(n_threads) as packing:
        with progress.stage("writing files"):
            write_labels(result, source, files.stage, packing=packing, outputs=outputs)
        summary, labels, area_m2 = result.summary(), result.labels, result.shares()
        unentered = result.unentered
        warnings = (*source.warnings, *result.warnings)
        inputs = _inputs_of_places(result, files.stage, gates=rules.doorways == "gates")
        title = f"{source.name}: {result.method}"
        del result  # the labels of a huge map's nodes are not needed any more
        return_freed()
        with progress.stage("places"):
            topology = write_places(
                files,
                title,
                rules,
                packing=packing,
                picture=outputs.pictures,
                grid=source.grid,
                **inputs,
            )
    return LabelledFile(summary, labels, area_m2, warnings, topology, unentered)


def _inputs_of_places(result: LabelledPlaces, folder: Path, *, gates: bool) -> dict[str, object]:
    beliefs = result.labeling.beliefs
    if beliefs is not None:  # a huge map's wait in a file until its places are known
        beliefs = set_aside(beliefs, folder)
    return {
        "labels": result.labels,
        "label_names": result.label_names,
        "beliefs": beliefs,
        "layout": result.layout,
        "doorways": result.doorways if gates else None,
    }


def set_aside(array: NDArray[Any], folder: Path, *, at_least: int = 2**27) -> NDArray[Any]:
    """The same values, read-only, from a file without a name, which goes when they do.

    Arrays of fewer bytes than ``at_least`` stay in memory; so do those for which the folder has no
    room.

    Parameters
    ----------
    array : array
        Of any shape; whoever holds it must let it go for the memory to be free.
    folder : Path
        On the disk that the file is to lie on.
    at_least : int
    """
    if array.nbytes < max(at_least, 1):
        return array
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            array.tofile(file)
            file.flush()
            return np.memmap(file, array.dtype, "r", shape=array.shape)
    except OSError:
        return array
