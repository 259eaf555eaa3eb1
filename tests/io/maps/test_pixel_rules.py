"""What pixels mean: the table-driven reader against one that looks at a pixel at a time."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pgm_places.io.maps.map_pixels import Compat, Mode, PixelRules, grey_of
from tests.reference.map_pixels import nav2_occupancy, ros1_occupancy

thresholds = st.tuples(st.floats(0.0, 0.5), st.floats(0.5001, 1.0))
modes = st.sampled_from(["trinary", "scale", "raw"])


@given(
    mode=modes,
    compat=st.sampled_from(["nav2", "ros1"]),
    negate=st.booleans(),
    limits=thresholds,
    colours=st.booleans(),
    with_alpha=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_occupancy_is_that_of_the_reference(
    mode: Mode,
    compat: Compat,
    negate: bool,
    limits: tuple[float, float],
    colours: bool,
    with_alpha: bool,
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    channels = rng.integers(0, 256, (3, 4, 3 if colours else 1), np.uint8)
    alpha = rng.choice([0, 100, 254, 255], (3, 4)).astype(np.uint8) if with_alpha else None
    rules = PixelRules(mode, negate, *limits, compat)
    found, cells = rules.read(channels, alpha)
    if compat == "nav2" and mode != "raw":
        trinary = PixelRules("trinary", negate, *limits).read(channels, alpha)
        np.testing.assert_array_equal(cells, trinary[0])
    for index in np.ndindex(3, 4):
        pixel = channels[index].tolist()
        if compat == "nav2":
            opacity = 255 if alpha is None else int(alpha[index])
            expected = nav2_occupancy(pixel, opacity, mode, negate, *limits)
        else:
            opacity_or_none = None if alpha is None else int(alpha[index])
            expected = ros1_occupancy(pixel, opacity_or_none, mode, negate, *limits)
        assert found[index] == expected


def test_grey_205_is_unknown_below_its_probability_and_free_from_it_on() -> None:
    tables = {
        free: PixelRules("trinary", False, free, 0.65).tables()[1][205]
        for free in (0.196, 50 / 255, 0.25)
    }
    assert tables == {0.196: -1, 50 / 255: 0, 0.25: 0}


def test_both_compats_differ_exactly_at_the_thresholds() -> None:
    free, occupied = 51 / 255, 204 / 255  # p of grey 204 and of grey 51
    nav2 = PixelRules("trinary", False, free, occupied, "nav2").tables()[0]
    ros1 = PixelRules("trinary", False, free, occupied, "ros1").tables()[0]
    assert np.flatnonzero(nav2 != ros1).tolist() == [51, 204]
    assert (nav2[204], ros1[204]) == (0, -1)
    assert (nav2[51], ros1[51]) == (100, -1)


def test_raw_cells_follow_the_thresholds_on_the_occupancy() -> None:
    occupancy, cells = PixelRules("raw", False, 0.25, 0.65).tables()
    assert cells[[0, 25, 26, 64, 65, 100, 101, 255]].tolist() == [0, 0, -1, -1, 100, 100, -1, -1]
    assert occupancy[25] == 25


@given(
    limits=thresholds,
    negate=st.booleans(),
    compat=st.sampled_from(["nav2", "ros1"]),
    seed=st.integers(0, 1000),
)
def test_scale_and_trinary_give_the_same_cells(
    limits: tuple[float, float], negate: bool, compat: Compat, seed: int
) -> None:
    channels = np.random.default_rng(seed).integers(0, 256, (4, 5, 3), np.uint8)
    trinary, same = PixelRules("trinary", negate, *limits, compat).read(channels, None)
    scale, cells = PixelRules("scale", negate, *limits, compat).read(channels, None)
    assert same is trinary
    assert (cells == trinary).all()
    assert (scale[cells != -1] == cells[cells != -1]).all()


def test_greys_keep_their_value_and_colours_take_their_luma() -> None:
    equal = np.repeat(np.arange(256, dtype=np.uint8)[:, None, None], 3, axis=2)
    assert grey_of(equal)[:, 0].tolist() == list(range(256))
    primaries = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255]]], np.uint8)
    assert grey_of(primaries).tolist() == [[54, 182, 18]]  # Rec. 709 luma times 255
