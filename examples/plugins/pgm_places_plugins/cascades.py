"""Objects found in images by Haar cascades (Viola and Jones), as in the paper's section 4.1."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import set_frozen
from pgm_places.errors import InputError
from pgm_places.options import Whole, check_options
from pgm_places.options.marks import Ge, Gt
from pgm_places.plugins import install_command, needed

OPENCV_CASCADES = {
    "frontal face": "haarcascade_frontalface_default.xml",
    "face profile": "haarcascade_profileface.xml",
    "full human body": "haarcascade_fullbody.xml",
    "upper human body": "haarcascade_upperbody.xml",
}
"""The paper's objects whose cascades come with OpenCV."""

# Cascades of profiles, which are also applied to the mirrored image.
ONE_SIDED = ("haarcascade_profileface.xml",)


@dataclass(frozen=True, eq=False)
class CascadeDetector:
    """Counts the windows that cascades of boosted Haar features accept, over all images.

    Parameters
    ----------
    files : mapping of str to path
        A cascade (OpenCV's XML) for each class of objects; see :meth:`of_people`.
    scale_factor : float
        Factor from each search window to the next larger one.
    min_neighbours : int
        Least number of overlapping windows of an object that counts.
    min_size_px : int
        Least size of an object in pixels.

    Raises
    ------
    InputError
        OpenCV is not installed, or a file is missing or no cascade.

    Examples
    --------
    >>> detector = CascadeDetector.of_people()  # doctest: +SKIP
    >>> detector.count(panorama)  # doctest: +SKIP
    array([1, 0, 0, 0])
    """

    files: Mapping[str, Path | str]
    scale_factor: Annotated[float, Gt(1)] = 1.1
    min_neighbours: Annotated[int, Ge(0)] = 3
    min_size_px: Whole = 24
    _cascades: tuple[tuple[Any, bool], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.files:
            raise InputError("a cascade detector needs at least one cascade file, got none")
        check_options(self)
        loaded = tuple(_load(name, Path(path)) for name, path in self.files.items())
        set_frozen(self, _cascades=loaded)

    @classmethod
    def of_people(cls, further: Mapping[str, Path | str] | None = None, **options: Any) -> Self:
        """The four cascades of people that come with OpenCV, and further ones.

        Parameters
        ----------
        further : mapping of str to path, optional
            Cascades for monitors, coffee machines, cupboards and the like, which OpenCV has not.
        **options
            As of the class.

        Raises
        ------
        InputError
            This OpenCV has no cascades: version 5 moved them elsewhere.
        """
        folder = Path(_opencv().data.haarcascades)
        own = {name: folder / file for name, file in OPENCV_CASCADES.items()}
        return cls({**own, **(further or {})}, **options)

    @property
    def object_names(self) -> tuple[str, ...]:
        """The classes of objects, in the order of ``files``."""
        return tuple(self.files)

    def count(self, observation: Sequence[ArrayLike]) -> NDArray[np.int64]:
        """(D,) total number of objects of each class in the images of a panorama.

        Parameters
        ----------
        observation : sequence of (H, W) or (H, W, 3) uint8
            Grey or BGR images, eight in the paper; any number here.

        Raises
        ------
        InputError
            An image is not an array of bytes.
        """
        counts = np.zeros(len(self._cascades), np.int64)
        for image in observation:
            grey = _grey(image)
            for k, (cascade, both_sides) in enumerate(self._cascades):
                counts[k] += self._found(cascade, grey)
                if both_sides:
                    counts[k] += self._found(cascade, np.ascontiguousarray(grey[:, ::-1]))
        return counts

    def _found(self, cascade: Any, grey: NDArray[np.uint8]) -> int:
        size = (self.min_size_px, self.min_size_px)
        return len(cascade.detectMultiScale(grey, self.scale_factor, self.min_neighbours, 0, size))


def _opencv() -> Any:
    cv2 = needed("cv2", extra="vision", purpose="finding objects by Haar cascades")
    if not hasattr(cv2, "CascadeClassifier"):
        raise InputError(
            f"OpenCV {cv2.__version__} has no Haar cascades; install an older one with: "
            f"{install_command('vision')}"
        )
    return cv2


def _load(name: str, path: Path) -> tuple[Any, bool]:
    cv2 = _opencv()
    if not path.is_file():
        raise InputError(f"the cascade of {name!r} should be at {path}, but there is no such file")
    try:
        cascade = cv2.CascadeClassifier(str(path))
    except (cv2.error, SystemError) as error:
        raise InputError(
            f"{path}, the cascade of {name!r}, is not a Haar cascade: {error}"
        ) from None
    if cascade.empty():
        raise InputError(f"{path}, the cascade of {name!r}, is not a Haar cascade of OpenCV")
    return cascade, path.name in ONE_SIDED


def _grey(image: ArrayLike) -> NDArray[np.uint8]:
    """(H, W) a grey image of even contrast, as cascades are trained on."""
    cv2 = _opencv()
    pixels = np.asarray(image)
    if (
        pixels.dtype != np.uint8
        or pixels.size == 0
        or not (pixels.ndim == 2 or (pixels.ndim == 3 and pixels.shape[2] == 3))
    ):
        raise InputError(
            "an image must be (H, W) grey or (H, W, 3) BGR in bytes, got "
            f"{pixels.dtype} {pixels.shape}"
        )
    if pixels.ndim == 3:
        pixels = cv2.cvtColor(np.ascontiguousarray(pixels), cv2.COLOR_BGR2GRAY)
    equal: NDArray[np.uint8] = cv2.equalizeHist(np.ascontiguousarray(pixels))
    return equal
