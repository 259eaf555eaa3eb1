"""Images: every format and depth, and headers that lie."""

import struct
import tracemalloc
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pgm_places.errors import MapError
from pgm_places.io.maps.raster_image import _check_scans, open_image
from tests.refusals import refused

GREY = np.array([[0, 17, 255], [100, 205, 254]], np.uint8)


def read(path: Path, **options: Any) -> tuple[np.ndarray, np.ndarray | None]:
    """All channels (H, W, C) and alpha of an image."""
    with open_image(path, MapError, **options) as image:
        strips = list(image.strips())
        channels = np.concatenate([strip.channels for strip in strips])
        assert channels.shape[:2] == image.shape
        alphas = [strip.alpha for strip in strips if strip.alpha is not None]
    return channels, np.concatenate(alphas) if alphas else None


def png(width: int, height: int, data: bytes = b"") -> bytes:
    """A PNG of 8-bit grey with any size in its header and any pixel data."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        check = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


@pytest.mark.parametrize("name", ["x.png", "x.pgm", "x.bmp", "x.tiff", "x.no_suffix_that_is_known"])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_formats_are_known_by_their_first_bytes(tmp_path: Path, name: str, mode: str) -> None:
    suffix = {"x.pgm": "PPM", "x.bmp": "BMP", "x.tiff": "TIFF"}.get(name, "PNG")
    Image.fromarray(GREY).convert(mode).save(tmp_path / name, suffix)
    channels, alpha = read(tmp_path / name)
    assert alpha is None
    assert (channels == GREY[:, :, None]).all()


def jpeg(path: Path, *, width: int = 40, progressive: bool = False) -> bytes:
    """A JPEG of noise, as bytes and as a file."""
    noise = np.random.default_rng(3).integers(0, 256, (30, width), np.uint8)
    Image.fromarray(noise).save(path, "JPEG", progressive=progressive)
    return path.read_bytes()


@pytest.mark.parametrize("progressive", [False, True])
def test_jpegs_are_read_where_values_need_not_be_exact(tmp_path: Path, progressive: bool) -> None:
    path = tmp_path / "x.png"
    jpeg(path, progressive=progressive)
    with Image.open(path) as picture:
        expected = np.asarray(picture)
    assert (read(path, lossy=True)[0][:, :, 0] == expected).all()
    refused(MapError, r"x\.png: a JPEG, whose compression changes values; save", read, path)


def test_bad_jpegs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.jpg"
    data = jpeg(path, progressive=True)
    size = data.index(struct.pack(">HH", 30, 40))
    for content, message in (
        (data[: len(data) // 2], "the image is damaged or truncated"),
        (data[:12], "the image's header is damaged"),
        (data[:-2] + 100 * b"\xff\xda" + data[-2:], "scans, more than the limit of 100"),
        (
            data[:size] + struct.pack(">HH", 9000, 9000) + data[size + 4 :],
            "which take at least 158203 bytes, but the file has",
        ),
    ):
        path.write_bytes(content)
        with pytest.raises(MapError) as caught:
            read(path, lossy=True)
        assert message in str(caught.value)


def test_scans_of_a_jpeg_are_counted_across_parts(tmp_path: Path) -> None:
    path = tmp_path / "x.jpg"
    one, several = jpeg(path), jpeg(path, progressive=True)
    _check_scans(path, BytesIO(one), MapError, most=1, n_bytes=1)
    with pytest.raises(MapError, match=r"a JPEG of \d+ scans, more than the limit of 1;"):
        _check_scans(path, BytesIO(several), MapError, most=1, n_bytes=1)
    path.write_bytes(one + 100 * b"\xff\xda")
    refused(MapError, "a JPEG of 101 scans, more than the limit of 100;", read, path, lossy=True)


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        ("1", [[0, 0, 255], [0, 255, 255]]),
        ("P", GREY.tolist()),
        ("LA", GREY.tolist()),
        ("RGBA", GREY.tolist()),
    ],
)
def test_kinds_of_pixels(tmp_path: Path, mode: str, expected: list[list[int]]) -> None:
    picture = Image.fromarray(GREY)
    if mode == "P":
        picture.putpalette([v for grey in range(256) for v in (grey, grey, grey)])
    else:
        picture = picture.convert(mode, dither=Image.Dither.NONE)
    picture.save(tmp_path / "x.png")
    channels, alpha = read(tmp_path / "x.png")
    assert (channels == np.array(expected)[:, :, None]).all()
    assert (alpha is not None) == (mode in ("LA", "RGBA"))
    assert alpha is None or (alpha == 255).all()


@pytest.mark.parametrize("mode", ["L", "P", "RGB"])
def test_a_transparent_colour_is_alpha(tmp_path: Path, mode: str) -> None:
    picture = Image.fromarray(GREY)
    if mode == "P":
        picture.putpalette([v for grey in range(256) for v in (grey, grey, grey)])
    picture = picture.convert(mode)
    picture.save(tmp_path / "x.png", transparency=(205, 205, 205) if mode == "RGB" else 205)
    channels, alpha = read(tmp_path / "x.png")
    assert alpha is not None
    assert (alpha == np.where(GREY == 205, 0, 255)).all()
    assert (channels == GREY[:, :, None]).all()


def test_indices_of_a_palette_can_be_asked_for(tmp_path: Path) -> None:
    picture = Image.fromarray(np.array([[0, 1], [2, 1]], np.uint8)).convert("P")
    picture.putpalette([9, 9, 9, 200, 0, 0, 0, 0, 250])
    picture.save(tmp_path / "x.png")
    with open_image(tmp_path / "x.png", MapError) as image:
        assert image.is_indexed
        (strip,) = image.strips(indices=True)
        assert strip.channels[:, :, 0].tolist() == [[0, 1], [2, 1]]
        assert image.palette_rgb()[1].tolist() == [200, 0, 0]


@pytest.mark.parametrize("suffix", ["png", "tiff"])
def test_sixteen_bits_are_rounded_to_eight(tmp_path: Path, suffix: str) -> None:
    deep = np.array([[0, 128, 129, 385, 386, 65535]], np.uint16)
    Image.fromarray(deep).save(tmp_path / f"x.{suffix}")
    assert read(tmp_path / f"x.{suffix}")[0][:, :, 0].tolist() == [[0, 0, 1, 1, 2, 255]]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"P5\n3 2\n255\n" + GREY.tobytes(), GREY.tolist()),
        (b"P5 # CREATOR: gimp\n3 2\n# grey\n255\r" + GREY.tobytes(), GREY.tolist()),
        (b"P5 3 1 100 " + bytes([0, 50, 101]), [[0, 128, 255]]),
        (b"P5 2 1 65535\n" + struct.pack(">2H", 257, 65535), [[1, 255]]),
        (b"P5 2 1 1000\n" + struct.pack(">2H", 500, 1000), [[128, 255]]),
        (b"P2\n# plain\n3 1\n255\n0 17\n255\n", [[0, 17, 255]]),
        (b"P1\n3 1\n0 1 0\n", [[255, 0, 255]]),
        (b"P4\n3 1\n" + bytes([0b01000000]), [[255, 0, 255]]),
        (b"P5 1 1 255 " + bytes([10]), [[10]]),
    ],
)
def test_portable_graymaps(tmp_path: Path, content: bytes, expected: list[list[int]]) -> None:
    (tmp_path / "x.pgm").write_bytes(content)
    assert read(tmp_path / "x.pgm")[0][:, :, 0].tolist() == expected


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"P5\n3 2\n255\n" + bytes(5), "the image is damaged or truncated"),
        (b"P5\n100000 100000\n255\n" + bytes(9), "more than the limit of 200000000"),
        (b"P5\n99999999999 1\n255\n", "Token too long in file header"),
        (b"P5\n-3 2\n255\n", "the image's header is damaged"),
        (b"P5\n3 x\n255\n", "the image's header is damaged"),
        (b"P5\n3 2", "the image's header is damaged"),
        (b"P5\n#" + b"c" * 100_000, "the image's header is damaged"),
        (b"P5\n3 2\n0\n" + bytes(6), "maxval must be greater than 0"),
        (b"P5\n3 2\n65536\n" + bytes(12), "maxval must be greater than 0"),
        (b"P5\n0 2\n255\n", "the image's header is damaged"),
        (b"P6\n100 100\n255\n" + bytes(9), "take at least 30000 bytes, but the file has 24"),
        (b"P2\n2 2\n255\n1 2 3\n", "the image is damaged or truncated"),
        (b"P2\n2 x\n255\n1 2 3\n", "the image's header is damaged"),
        (b"BM" + bytes(60), "the image's header is damaged"),
        (b"II*\0" + bytes(4), "the image's header is damaged"),
        (b"\x89PNG\r\n\x1a\n", "the image's header is damaged"),
        (b"GIF89a" + bytes(20), "not an image (PNG, PGM, PBM, PPM, BMP or TIFF); save it in one"),
        (b"", "not an image (PNG, PGM, PBM, PPM, BMP or TIFF)"),
        (png(30_000, 20_000), "more than the limit of 200000000; raise max_pixels if the map "),
        (png(10_000, 10_000), "which take at least 96153 bytes, but the file has"),
        (png(0, 20), "the image's header is damaged"),
    ],
)
def test_bad_images_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "x").write_bytes(content)
    with pytest.raises(MapError) as caught:
        read(tmp_path / "x")
    assert str(caught.value).startswith(f"{tmp_path / 'x'}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize("suffix", ["png", "bmp", "tiff", "pgm"])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_truncated_images_are_refused(tmp_path: Path, suffix: str, share: float) -> None:
    noise = np.random.default_rng(3).integers(0, 256, (40, 50), np.uint8)
    path = tmp_path / f"x.{suffix}"
    Image.fromarray(noise).save(path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    refused(MapError, r"truncated|damaged", read, path)


def test_a_huge_header_allocates_nothing(tmp_path: Path) -> None:
    (tmp_path / "x.png").write_bytes(png(14_000, 14_000))
    tracemalloc.start()
    refused(MapError, "its header is wrong", read, tmp_path / "x.png")
    assert tracemalloc.get_traced_memory()[1] < 10_000_000
    tracemalloc.stop()


def test_the_limit_can_be_lowered_and_raised(tmp_path: Path) -> None:
    Image.fromarray(GREY).save(tmp_path / "x.png")
    with pytest.raises(MapError, match="states 3 x 2 = 6 pixels, more than the limit of 5; raise"):
        read(tmp_path / "x.png", max_pixels=5)
    assert read(tmp_path / "x.png", max_pixels=6)[0].shape == (2, 3, 1)


def test_large_images_come_in_strips(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (11, 3), np.uint8)
    for suffix in ("png", "pgm"):
        path = tmp_path / f"x.{suffix}"
        Image.fromarray(noise).save(path)
        with open_image(path, MapError) as image:
            strips = list(image.strips(_pixels=7))
        assert [strip.row for strip in strips] == [0, 2, 4, 6, 8, 10]
        assert (np.concatenate([strip.channels for strip in strips])[:, :, 0] == noise).all()


def test_kinds_without_a_meaning_are_refused(tmp_path: Path) -> None:
    Image.fromarray(GREY.astype(np.float32)).save(tmp_path / "x.tiff")
    with pytest.raises(MapError, match="pixels of kind F cannot be read; save the image as grey"):
        read(tmp_path / "x.tiff")
    Image.fromarray(GREY.astype(np.int32) + 70_000).save(tmp_path / "y.tiff")
    with pytest.raises(MapError, match=r"damaged or truncated \(grey values outside 0\.\.65535\)"):
        read(tmp_path / "y.tiff")


def test_a_missing_image_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"absent\.png: no such file; expected an image"):
        read(tmp_path / "absent.png")
