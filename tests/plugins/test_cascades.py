"""Haar cascades on drawn faces: no pictures of people are kept here."""

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pgm_places_plugins.cascades import OPENCV_CASCADES, CascadeDetector

from pgm_places.errors import InputError
from pgm_places.features.object_counts import PAPER_OBJECTS, Detector, count_objects
from tests.refusals import refused


def drawn_face(side: int = 100) -> NDArray[np.uint8]:
    """A grey oval with brows, eyes, a nose and a mouth: enough for the cascade."""
    y, x = np.mgrid[:side, :side] / side - 0.5

    def oval(at: tuple[float, float], half: tuple[float, float]) -> NDArray[np.bool_]:
        inside: NDArray[np.bool_] = (x - at[0]) ** 2 / half[0] ** 2 + (y - at[1]) ** 2 / half[
            1
        ] ** 2 <= 1
        return inside

    image = np.full((side, side), 120, np.uint8)
    image[oval((0, 0), (0.28, 0.38))] = 200
    for eye in (-0.11, 0.11):
        image[oval((eye, -0.08), (0.06, 0.025))] = 60
        image[oval((eye, -0.14), (0.08, 0.02))] = 90
    image[(abs(x) <= 0.015) & (abs(y + 0.01) <= 0.07)] = 225
    image[oval((0, 0.08), (0.03, 0.02))] = 150
    image[oval((0, 0.19), (0.10, 0.03))] = 90
    return image


@pytest.fixture(scope="module")
def detector() -> CascadeDetector:
    return CascadeDetector.of_people()


def test_faces_are_summed_over_the_images(detector: CascadeDetector) -> None:
    assert isinstance(detector, Detector)
    assert set(detector.object_names) <= set(PAPER_OBJECTS)
    face, wall = drawn_face(), np.full((80, 120), 127, np.uint8)
    panorama = [wall, face, wall, np.repeat(face[..., None], 3, axis=2), wall, wall, wall, wall]
    counts = count_objects(detector, [panorama, [wall] * 8, []])
    faces = detector.object_names.index("frontal face")
    assert counts[:, faces].tolist() == [2, 0, 0]
    assert counts[1:].sum() == 0


def test_an_image_is_not_changed(detector: CascadeDetector) -> None:
    face = drawn_face()
    before = face.copy()
    detector.count([face])
    assert (face == before).all()


def test_further_cascades_come_after_opencvs_own() -> None:
    cv2: Any = importlib.import_module("cv2")
    eyes = Path(cv2.data.haarcascades) / "haarcascade_eye.xml"
    detector = CascadeDetector.of_people({"eye": eyes}, min_neighbours=5)
    assert detector.object_names == (*OPENCV_CASCADES, "eye")
    assert detector.count([np.zeros((50, 50), np.uint8)]).tolist() == [0] * 5


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((5, 5)),
        np.zeros(5, np.uint8),
        np.zeros((5, 5, 4), np.uint8),
        np.zeros((0, 5), np.uint8),
    ],
)
def test_what_is_no_image_is_refused(image: NDArray[np.uint8], detector: CascadeDetector) -> None:
    refused(InputError, "an image must be", detector.count, [image])


def test_files_that_are_no_cascades(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        CascadeDetector({"monitor on": tmp_path / "monitor.xml"})
    (tmp_path / "monitor.xml").write_text("<opencv_storage></opencv_storage>")
    with pytest.raises(InputError, match="not a Haar cascade"):
        CascadeDetector({"monitor on": tmp_path / "monitor.xml"})
    refused(InputError, "at least one cascade", CascadeDetector, {})


def test_without_opencv_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    refused(InputError, r'pip install .*\[vision\]"', CascadeDetector.of_people)


def test_opencv_5_is_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    cv2: Any = importlib.import_module("cv2")
    monkeypatch.delattr(cv2, "CascadeClassifier")
    refused(InputError, "has no Haar cascades; install an older one", CascadeDetector.of_people)
