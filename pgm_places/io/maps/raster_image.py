"""Raster images: reading PNG, PGM/PPM, BMP, TIFF and JPEG in strips, and writing PNG."""

import importlib
import io
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.input_file import open_input

if TYPE_CHECKING:
    from PIL.Image import Image

# Twice a map of 10 000 x 10 000 cells; memory is one byte per pixel.
MAX_PIXELS = 200_000_000

# Strips are whole rows; Pillow refuses to cut out more pixels than 179 million.
_MAX_SIDE = 1_000_000

# zlib shrinks no input by more than this factor (its documentation: 1032 : 1).
_DEFLATE_LIMIT = 1040

# Every scan of a JPEG goes over all of its pixels; encoders write about ten.
_MAX_JPEG_SCANS = 100

_JPEG_SCAN = b"\xff\xda"

# A JPEG takes at least a bit for each block of 8 x 8 pixels.
_JPEG_PIXELS_A_BYTE = 8 * 64

_DECODERS = {
    "Png": (b"\x89PNG\r\n\x1a\n",),
    "Ppm": (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6"),
    "Bmp": (b"BM",),
    "Tiff": (b"II*\0", b"MM\0*"),
    "Jpeg": (b"\xff\xd8\xff",),
}
"""The first bytes of each of Pillow's formats."""

PICTURES = (".png", ".pgm", ".pbm", ".ppm", ".bmp", ".tif", ".tiff", ".jpg", ".jpeg")
"""The file name endings of these formats."""

FORMATS = "PNG, PGM, PBM, PPM, BMP or TIFF"

_PNG_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}

_MODES = {"1", "L", "LA", "P", "PA", "RGB", "RGBA", "I", "I;16", "I;16B", "I;16L", "I;16N"}

_DAMAGED: tuple[type[Exception], ...] = (OSError, ValueError, SyntaxError, EOFError, LookupError)
_DAMAGED += (TypeError, AttributeError, ArithmeticError, struct.error)
"""Exceptions of Pillow's decoders on damaged bytes."""


class Strip(NamedTuple):
    """Rows of an image from ``row`` (0 = top) on, 16-bit values rounded to 8 bits."""

    row: int
    channels: NDArray[np.uint8]  # (h, W, C): C = 1 grey, 3 red, green, blue
    alpha: NDArray[np.uint8] | None  # (h, W), 255 = opaque; None: no transparency in the image


@dataclass
class RasterImage:
    """An open image with a checked size; ``strips`` decodes it from top to bottom.

    Indexed: pixels are indices into a palette. Lossy: compression changes values. Deep: more than 8
    bits of grey.
    """

    path: Path
    shape: tuple[int, int]
    is_indexed: bool
    is_lossy: bool
    is_deep: bool
    _error: type[InputError]
    _picture: "Image | None"
    _png_bits: int = 0

    def palette_rgb(self) -> NDArray[np.uint8]:
        """(n, 3) colours of an indexed image; (0, 3) for others."""
        with self._reported():
            colours = self._picture.getpalette("RGB") if self._picture is not None else None
        return np.array(colours or [], np.uint8).reshape(-1, 3)

    def stored(self) -> NDArray[np.integer]:
        """(H, W) values of a grey image, from the top, unconverted."""
        with self._reported():
            return np.asarray(self._picture)

    def strips(self, *, indices: bool = False, _pixels: int = 1 << 20) -> Iterator[Strip]:
        """Strips of about a million pixels; with ``indices``, of a palette image's indices."""
        height, width = self.shape
        rows = max(1, _pixels // width)
        for top in range(0, height, rows):
            with self._reported():
                strip = self._decoded(top, min(top + rows, height), indices)
            yield strip

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Turn a decoder's exceptions into this image's error."""
        try:
            yield
        except MemoryError:
            height, width = self.shape
            raise self._error(
                f"{self.path}: not enough memory to decode {width} x {height} pixels; "
                "crop the map or coarsen it"
            ) from None
        except _DAMAGED as problem:
            raise self._error(
                f"{self.path}: the image is damaged or truncated ({problem}); save it again"
            ) from None

    def _decoded(self, top: int, bottom: int, indices: bool) -> Strip:
        picture = self._picture
        if picture is None:
            raise ValueError("it was closed")
        part = picture.crop((0, top, self.shape[1], bottom))
        if indices and self.is_indexed:
            return Strip(top, np.asarray(part)[:, :, None], None)
        channels, alpha = _channels(part)
        return Strip(top, channels, alpha)


def _wanted(lossy: bool) -> str:
    return f"an image ({FORMATS.replace(' or', ',')} or JPEG)" if lossy else f"an image ({FORMATS})"


@contextmanager
def open_image(
    path: Path, error: type[InputError], *, max_pixels: int = MAX_PIXELS, lossy: bool = False
) -> Iterator[RasterImage]:
    """An image of at most ``max_pixels`` whose header fits the file's length.

    The first bytes decide on the format: PNG, PGM, PBM, PPM, BMP, TIFF, or JPEG if ``lossy``.
    """
    with open_input(path, error, _wanted(lossy)) as file:
        image = _opened(path, file, error, _wanted(lossy))
        if image.is_lossy and not lossy:
            raise error(
                f"{path}: a JPEG, whose compression changes values; save the image as PNG from its "
                "source"
            )
        height, width = image.shape
        if height < 1 or width < 1:
            raise error(f"{path}: the image has no pixels ({width} x {height})")
        if height * width > max_pixels:
            raise error(
                f"{path}: the image's header states {width} x {height} = {height * width} pixels, "
                f"more than the limit of {max_pixels}; raise max_pixels if the map really is that "
                "large"
            )
        if max(height, width) > _MAX_SIDE:
            raise error(
                f"{path}: the image is {width} x {height} pixels; no side may be longer than "
                f"{_MAX_SIDE}"
            )
        _check_length(image, path.stat().st_size, error)
        if image.is_lossy:
            _check_scans(path, file, error)
        try:
            yield image
        finally:
            image._picture = None  # four bytes a pixel, for colour


def _opened(path: Path, file: IO[bytes], error: type[InputError], what: str) -> RasterImage:
    head = file.read(32)
    file.seek(0)
    picture = _picture(path, file, head, error, what)
    if picture.mode not in _MODES:
        raise error(
            f"{path}: pixels of kind {picture.mode} cannot be read; save the image as greyscale, "
            "RGB or indexed, with at most 16 bits a channel"
        )
    width, height = picture.size
    mode = picture.mode
    kinds = mode == "P", picture.format == "JPEG", mode.startswith("I")
    image = RasterImage(path, (height, width), *kinds, error, picture)
    if picture.format == "PNG":  # bit depth and colour type of the IHDR chunk
        image._png_bits = head[24] * _PNG_CHANNELS.get(head[25], 1)
    return image


def _picture(
    path: Path, file: IO[bytes], head: bytes, error: type[InputError], what: str
) -> "Image":
    """Open an image directly with a Pillow plugin for the format of its first bytes.

    ``Image.open`` refuses maps of more than 89 million pixels, by a limit of the process.
    """
    kind = next((kind for kind, starts in _DECODERS.items() if head.startswith(starts)), None)
    if kind is None:
        raise error(f"{path}: not {what}; save it in one of these formats")
    try:
        plugin = importlib.import_module(f"PIL.{kind}ImagePlugin")
        picture: Image = getattr(plugin, f"{kind}ImageFile")(file)
        return picture
    except _DAMAGED as problem:
        raise error(f"{path}: the image's header is damaged ({problem}); save it again") from None


def _check_length(image: RasterImage, n_bytes: int, error: type[InputError]) -> None:
    """Refuse a header that states more pixels than the file can hold."""
    height, width = image.shape
    picture = image._picture
    assert picture is not None  # just opened
    if picture.format == "PPM":  # plain ones (P1 to P3) take at least a character for each number
        bits = {"1": 1, "RGB": 24}.get(picture.mode, 8)
        least = height * ((width * bits + 7) // 8)
    elif picture.format == "PNG":
        least = height * ((width * image._png_bits + 7) // 8) // _DEFLATE_LIMIT
    elif picture.format == "JPEG":
        least = height * width // _JPEG_PIXELS_A_BYTE
    else:  # BMP and TIFF: at least a bit for each pixel, compressed as far as anything is
        least = height * width // 8 // _DEFLATE_LIMIT
    if n_bytes < least:
        raise error(
            f"{image.path}: the header states {width} x {height} pixels, which take at least "
            f"{least} bytes, but the file has {n_bytes}; it is truncated or its header is wrong"
        )


def _check_scans(
    path: Path,
    file: IO[bytes],
    error: type[InputError],
    most: int = _MAX_JPEG_SCANS,
    n_bytes: int = 1 << 20,
) -> None:
    """Refuse a JPEG with many scans, which takes long to decode."""
    at, n_scans, last = file.tell(), 0, b""
    file.seek(0)
    while part := file.read(n_bytes):
        n_scans += (last + part).count(_JPEG_SCAN)  # within coded data, every 255 is followed by 0
        last = part[-1:]
    file.seek(at)
    if n_scans > most:
        raise error(
            f"{path}: a JPEG of {n_scans} scans, more than the limit of {most}; save it again"
        )


def _channels(part: "Image") -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """(h, W, C) colour or grey channels and (h, W) alpha of a decoded strip, as 8 bits."""
    if part.mode.startswith("I"):
        return _eight_bits(part)
    transparent = "transparency" in part.info or part.mode in ("LA", "PA", "RGBA", "RGBa", "La")
    if part.mode in ("1", "L", "LA"):
        target = "LA" if transparent else "L"
    else:
        target = "RGBA" if transparent else "RGB"
    if part.mode == "1" and transparent:
        part = part.convert("L")
    data = np.asarray(part if part.mode == target else part.convert(target))
    data = data.reshape(*data.shape[:2], -1)
    if not transparent:
        return data, None
    return data[:, :, :-1], data[:, :, -1]


def _eight_bits(part: "Image") -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """16-bit grey values rounded to 8 bits (65535 becomes 255), and alpha if any."""
    values = np.asarray(part).astype(np.int64)
    if values.min() < 0 or values.max() > 65535:
        raise ValueError("grey values outside 0..65535")
    grey = ((values + 128) // 257).astype(np.uint8)
    clear = part.info.get("transparency")
    alpha = None if clear is None else np.where(values == clear, 0, 255).astype(np.uint8)
    return grey[:, :, None], alpha


def raster_png(picture: "Image") -> bytes:
    """A picture as reproducible PNG bytes, without date or version.

    Run-length compression is two to three times as fast as zlib's default, and as small on floors.
    """
    return encoded(picture, compress_type=zlib.Z_RLE)


def encoded(picture: "Image", kind: str = "PNG", **options: object) -> bytes:
    """A picture as the bytes of a file, with options of Pillow's ``save``."""
    buffer = io.BytesIO()
    picture.save(buffer, kind, **options)
    return buffer.getvalue()
