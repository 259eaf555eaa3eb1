"""Maps with rays through a window, labelled: the rays have no label and are no place."""

from functools import cache

import numpy as np

from pgm_places import OccupancyGrid, PlaceLabeler
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelling.label import label_map
from pgm_places.maps.coarsening import refine
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.spaces.unentered import find_unentered
from pgm_places.topology.from_labels import topological_map
from pgm_places.trained import trained_labeler
from tests.spaces.test_unentered import two_rooms, with_window

EVERYTHING = EnteredOptions(unentered=True)


@cache
def labeler() -> PlaceLabeler:
    return trained_labeler("generated")


@cache
def rays() -> tuple[OccupancyGrid, np.ndarray]:
    """A room with rays through its window; and which cells these are."""
    cells, added = with_window()
    return OccupancyGrid(cells, 0.05), added


@cache
def found() -> LabelledPlaces:
    return label_map(labeler(), rays()[0])


@cache
def everything() -> LabelledPlaces:
    return label_map(labeler(), rays()[0], entered=EVERYTHING)


def test_rays_have_no_label_and_all_other_cells_have_theirs() -> None:
    grid, added = rays()
    left_out, unentered = found().labels < 0, found().unentered
    assert unentered is not None
    np.testing.assert_array_equal(unentered.cells, left_out & grid.free)
    assert left_out[added].mean() > 0.9
    assert not left_out[grid.free & ~added].any()
    assert everything().unentered is None
    np.testing.assert_array_equal(found().labels[~left_out], everything().labels[~left_out])
    np.testing.assert_array_equal(everything().labels >= 0, grid.free)


def test_probabilities_are_those_of_the_cells_that_are_left() -> None:
    places, all_of_it = found(), everything()
    assert places.labeling.beliefs is not None
    assert all_of_it.labeling.beliefs is not None
    assert places.layout.n_nodes == len(places.labeling.beliefs) == (places.labels >= 0).sum()
    ours = places.on_map(places.labeling.beliefs, -1.0)
    theirs = all_of_it.on_map(all_of_it.labeling.beliefs, -1.0)
    inside = places.labels >= 0
    np.testing.assert_array_equal(ours[inside], theirs[inside])
    assert (ours[~inside] == -1).all()


def test_no_place_holds_them() -> None:
    places = found()
    topology = topological_map(
        *(places.grid, places.labels, places.label_names), doorways=places.doorways
    )
    assert places.unentered is not None
    assert not topology.region[places.unentered.cells].any()


def test_a_finer_map_leaves_out_what_it_shows() -> None:
    fine = refine(rays()[0], 0.025)
    places = label_map(labeler(), fine)
    assert places.unentered is not None
    np.testing.assert_array_equal(places.labels < 0, ~fine.free | places.unentered.cells)
    shown = places.on_map(places.labeling.labels.astype(np.int16), -1)
    np.testing.assert_array_equal(shown, places.labels)


def test_a_map_without_any_is_labelled_as_ever() -> None:
    grid = OccupancyGrid(two_rooms(16), 0.05)
    assert not find_unentered(grid)
    one, other = (label_map(labeler(), grid, entered=how) for how in (EnteredOptions(), EVERYTHING))
    assert one.unentered is None
    np.testing.assert_array_equal(one.labels, other.labels)
    np.testing.assert_array_equal(one.labeling.beliefs, other.labeling.beliefs)


def test_known_labels_stay() -> None:
    grid, added = rays()
    known = np.where(added, 1, -1)
    places = label_map(labeler(), grid, known=known)
    assert (places.labels[added] == 1).all()
