import numpy as np

from pgm_places.features.laser import (
    LASER_FEATURES,
    distinct_features,
    feature_set_hash,
    first_column,
    laser_feature_names,
)


def test_names_show_the_parameter() -> None:
    names = laser_feature_names()
    assert {"f2_sd", "f3[5]", "f14[0.5]", "f14[10.0]", "f16[-3]", "f30[0.3]", "f21[7]"} <= set(
        names
    )
    assert names[first_column("f16")] == "f16[-100]"


def test_every_feature_says_what_it_is_and_where_it_comes_from() -> None:
    assert all(spec.definition and spec.source for spec in LASER_FEATURES)


def test_the_hash_stands_for_this_set() -> None:
    # a stored model refuses features of another set: change this only with the definitions
    assert feature_set_hash() == (
        "15e472952ae01919cef849df39fd9cb11006abf25cdd0210c34e75fca7aff270"
    )


def test_distinct_features_are_those_that_are_not_functions_of_earlier_ones() -> None:
    kept = distinct_features()
    assert len(kept) == 286
    assert not {"f33", "f34", "f19", "f17_2", "f18_2", "f19_2", "f22"} & {
        LASER_FEATURES[column].id for column in kept
    }
    assert list(kept) == sorted(kept)


def test_cuts_beyond_the_sensors_reach_repeat_the_mean_difference() -> None:
    names = [laser_feature_names()[column] for column in distinct_features(max_range_m=20.0)]
    assert "f3[15]" in names
    assert not {"f3[20]", "f3[25]"} & set(names)


def test_distinct_features_are_linearly_independent() -> None:
    from pgm_places.features.extraction import extract
    from tests.features.scans import rooms

    values = extract(rooms(700, seed=5), max_range_m=80.0).astype(float)
    kept = values[:, list(distinct_features(max_range_m=30.0))]
    kept = kept[:, kept.std(axis=0) > 1e-6]
    kept = (kept - kept.mean(axis=0)) / kept.std(axis=0)
    # without the repetitions no column is a multiple of another
    correlation = np.abs(np.corrcoef(kept.T)) - np.eye(kept.shape[1])
    assert correlation.max() < 1 - 1e-7
