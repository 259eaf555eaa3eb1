"""Names of places: the user's, those of earlier maps, or class and id."""

from pgm_places.topology.place_ids import name_places


def test_a_place_is_known_by_one_number() -> None:
    """Names of before, with numbers of their own, give way to ids; chosen names stay."""
    classes = ["room", "corridor", "room", "room"]
    known = {2: "corridor 1", 6: "room 4", 7: "lab"}
    assert name_places([1, 2, 6, 7], classes, known=known) == [
        "room 1",
        "corridor 2",
        "room 6",
        "lab",
    ]


def test_a_chosen_name_that_looks_like_a_number_keeps_it() -> None:
    assert name_places([3, 7], ["room", "room"], own={7: "room 3"}) == ["room 3 (id 3)", "room 3"]
    called = name_places([3, 7], ["room", "room"], known={3: "room 3 (id 3)"})
    assert called == ["room 3", "room 7"]
