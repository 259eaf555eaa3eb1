"""Drawings in pixels, by Pillow, which is imported faster than matplotlib."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.io.atomic import write_bytes
from pgm_places.io.maps.raster_image import encoded
from pgm_places.kernels.threads import resolve_threads
from pgm_places.pictures.canvas import Canvas

if TYPE_CHECKING:
    from PIL import ImageDraw, ImageFont

INK, MUTED = "#1a202c", "#5a6472"
"""Colours of text and lines."""

_FINER = 4
"""Factor of oversampling: shapes are drawn larger and averaged, for smooth edges."""

_RIM = 1.4
"""Width of the rim of discs and squares in pixels."""

_Scaling: TypeAlias = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Drawing:
    """A white picture; positions are pixels from its upper left corner, x to the right, y down."""

    def __init__(self, width: int, height: int) -> None:
        from PIL import Image

        self.image = Image.new("RGB", (width, height), "white")

    @classmethod
    def of(cls, canvas: Canvas, scale: int) -> "Drawing":
        """The canvas, each of its pixels enlarged to ``scale`` x ``scale``."""
        height, width = canvas.indices.shape
        drawing = cls(scale * width, scale * height)
        drawing.image.paste(canvas.image().resize(drawing.image.size, resample=0))  # 0: nearest
        return drawing

    def paste(self, other: "Drawing", x: int, y: int) -> None:
        """Insert another drawing with its upper left corner at (x, y)."""
        self.image.paste(other.image, (x, y))

    def text(
        self,
        x: float,
        y: float,
        content: str,
        *,
        size: float = 14,
        colour: str = INK,
        bold: bool = False,
        centred: bool = False,
        halo: int = 0,
    ) -> None:
        """A line of text that begins at x, or is centred there; y is half its height.

        ``halo`` is the width of a white rim, which keeps the text legible on any ground.
        """
        from PIL import ImageDraw

        ImageDraw.Draw(self.image).text(
            (round(x, 3), round(y, 3)),  # rounding moves no glyph
            content,
            fill=colour,
            font=_font(size, bold),
            anchor="mm" if centred else "lm",
            stroke_width=halo,
            stroke_fill="white",
        )

    def box(
        self, x: float, y: float, width: float, height: float, *, fill: str, edge: str | None = None
    ) -> None:
        """A rectangle on whole pixels."""
        from PIL import ImageDraw

        left, top = round(x), round(y)
        right, bottom = max(left, round(x + width) - 1), max(top, round(y + height) - 1)
        ImageDraw.Draw(self.image).rectangle((left, top, right, bottom), fill=fill, outline=edge)

    def hatched_box(self, x: float, y: float, side: int, *, fill: str, hatch: str) -> None:
        """A square with diagonal lines."""
        from PIL import ImageDraw

        square = Drawing(side, side)
        square.box(0, 0, side, side, fill=fill)
        draw = ImageDraw.Draw(square.image)
        for offset in range(0, 2 * side, 5):
            draw.line((offset, 0, offset - side, side), fill=hatch)
        draw.rectangle((0, 0, side - 1, side - 1), outline=hatch)
        self.paste(square, round(x), round(y))

    def line(
        self,
        points: ArrayLike,
        *,
        colour: str,
        width: float,
        dashes: tuple[float, float] | None = None,
    ) -> None:
        """A line (n, 2) with round corners and ends; ``dashes`` are the lengths of dash and gap."""
        xy = np.asarray(points, np.float64).reshape(-1, 2)
        radius = _FINER * width / 2

        def paint(draw: "ImageDraw.ImageDraw", on_mask: _Scaling) -> None:
            points = on_mask(part)
            if len(points) > 1:
                draw.line(points.ravel().tolist(), fill=255, width=round(2 * radius))
            for x, y in points:
                draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=255)

        for part in [xy] if dashes is None else _dashes(xy, *dashes):
            self._stamp(part, width / 2, colour, paint)

    def polygon(self, rings: Sequence[ArrayLike], *, fill: str) -> None:
        """The area inside the first ring (n, 2), without the other rings, which are holes."""
        outer, *holes = (np.asarray(ring, np.float64) for ring in rings)

        def paint(draw: "ImageDraw.ImageDraw", on_mask: _Scaling) -> None:
            draw.polygon(on_mask(outer).ravel().tolist(), fill=255)
            for hole in holes:
                draw.polygon(on_mask(hole).ravel().tolist(), fill=0)

        self._stamp(outer, 0.0, fill, paint)

    def disc(self, at: ArrayLike, *, diameter: float, fill: str, edge: str) -> None:
        """A disc with a rim."""
        for colour, size in ((edge, diameter + _RIM), (fill, diameter - _RIM)):
            self.line(at, colour=colour, width=size)

    def square(self, at: ArrayLike, *, side: float, fill: str, edge: str) -> None:
        """A square with a rim."""
        corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        for colour, size in ((edge, side + _RIM), (fill, side - _RIM)):
            self.polygon([np.asarray(at) + size * corners], fill=colour)

    def png(self) -> bytes:
        """The picture as a PNG file, without a date or a version in it."""
        return encoded(self.image)

    def _stamp(
        self,
        points: NDArray[np.float64],
        reach: float,
        colour: str,
        paint: Callable[["ImageDraw.ImageDraw", _Scaling], None],
    ) -> None:
        """Fill a mask with a colour; ``paint`` draws the mask within ``reach`` of the points."""
        # paint is given the map from positions on the picture to positions on the mask.
        from PIL import Image, ImageDraw

        if not len(points):
            return
        low = np.floor(points.min(axis=0) - reach - 1).clip(0)
        high = np.ceil(points.max(axis=0) + reach + 1).clip(None, self.image.size)
        if (high <= low).any():
            return  # outside the picture
        width, height = (int(side) for side in high - low)
        mask = Image.new("L", (_FINER * width, _FINER * height))
        paint(ImageDraw.Draw(mask), lambda xy: np.round(_FINER * (xy - low)))
        self.image.paste(colour, (int(low[0]), int(low[1])), mask.reduce(_FINER))


def _dashes(xy: NDArray[np.float64], dash: float, gap: float) -> Iterator[NDArray[np.float64]]:
    """The dashes of a line (n, 2)."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    for start in np.arange(0.0, along[-1], dash + gap):
        end = min(start + dash, along[-1])
        between = along[(along > start) & (along < end)]
        at = np.concatenate([[start], between, [end]])
        yield np.stack([np.interp(at, along, xy[:, k]) for k in range(2)], axis=1)


@cache
def _font(size: float, bold: bool = False) -> "ImageFont.FreeTypeFont | ImageFont.ImageFont":
    """DejaVu Sans, which covers many scripts, from matplotlib's folder; else Pillow's own font."""
    from PIL import ImageFont

    matplotlib = find_spec("matplotlib")  # does not import it
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    for folder in (matplotlib and matplotlib.submodule_search_locations) or ():
        path = Path(folder) / "mpl-data" / "fonts" / "ttf" / name
        if path.is_file():
            return ImageFont.truetype(path, size)
    return ImageFont.load_default(size)


def text_width(content: str, size: float, *, bold: bool = False) -> float:
    """Width in pixels of a line of text of a size in pixels."""
    return float(_font(size, bold).getlength(content))


class Packing:
    """A second thread that makes PNG files of drawings, written at the end of the block.

    After an exception nothing is written; with one thread, or without a block, each at once.
    """

    def __init__(self, n_threads: int | None = None) -> None:
        self._n_threads = resolve_threads(n_threads)
        self._pool: ThreadPoolExecutor | None = None
        self._waiting: list[tuple[Path, Future[bytes]]] = []

    def __enter__(self) -> Self:
        if self._n_threads > 1:
            self._pool = ThreadPoolExecutor(1)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        pool, self._pool = self._pool, None
        if pool is None:
            return
        try:
            for path, packed in self._waiting if kind is None else ():
                write_bytes(path, packed.result())
        finally:
            pool.shutdown(cancel_futures=True)

    def write(self, path: Path, picture: Drawing) -> Path:
        """Write a picture at the end of the block at the latest; the path."""
        return self.write_made(path, picture.png)

    def write_made(self, path: Path, make: Callable[[], bytes]) -> Path:
        """Write a file whose content a function makes, at the end of the block at the latest."""
        if self._pool is None:
            return write_bytes(path, make())
        self._waiting.append((path, self._pool.submit(make)))
        return path
