"""Every public record is pickled and copied as it is, and stays read-only on the other side."""

import copy
import pickle  # noqa: TID251  as process pools do
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pgm_places as p
from tests.right_calls import Things, things


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Things:
    return things(tmp_path_factory.mktemp("made"))


def _through_pickle(item: Any) -> Any:
    return pickle.loads(pickle.dumps(item))  # noqa: S301  our own


COPIES: list[Callable[[Any], Any]] = [_through_pickle, copy.deepcopy, copy.copy]


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(one, other)) and one.flags.writeable == other.flags.writeable
    if hasattr(one, "__dict__") and not callable(one):
        names = [name for name in vars(one) if not name.startswith("_")]
        return all(_same(getattr(one, n), getattr(other, n)) for n in names if hasattr(other, n))
    return type(one) is type(other)


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", Things._fields)
def test_records_are_the_same_on_the_other_side(made: Things, name: str, how: Any) -> None:
    item = getattr(made, name)
    assert _same(item, how(item))


@pytest.mark.parametrize("how", COPIES)
def test_a_labeling_stays_read_only(made: Things, how: Any) -> None:
    other = how(made.labeling)
    assert other.labels.tolist() == made.labeling.labels.tolist()
    with pytest.raises(ValueError, match="read-only"):
        other.labels[0] = 1
    with pytest.raises(TypeError, match="does not support item assignment"):
        other.info["seconds"] = 0
    with pytest.raises(AttributeError, match="cannot assign"):
        other.score = 0.0


def test_what_is_labelled_after_the_way_is_the_same(made: Things) -> None:
    labeler = _through_pickle(made.places)
    labels = labeler.label(_through_pickle(made.grid)).labels
    np.testing.assert_array_equal(labels, made.places.label(made.grid).labels)
    again = _through_pickle(made.problem)
    assert (
        made.method.infer(again).labels.tolist() == made.method.infer(made.problem).labels.tolist()
    )


def test_a_pool_of_processes_labels_problems(made: Things) -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        (found,) = pool.map(p.build("potts").infer, [made.problem])
    assert found.labels.tolist() == made.method.infer(made.problem).labels.tolist()
    assert Path(found.info["decoder"]).name == "graph-cut"
