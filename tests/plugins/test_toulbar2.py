"""Branch and bound by toulbar2, a decoder from outside the package."""

import importlib
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pgm_places_plugins.toulbar2 import decode_by_toulbar2, exact_search, search_factors

from pgm_places import LabelGraph, Potentials, Status, decode
from pgm_places.errors import InfeasibleError, InputError
from pgm_places.models.decoder_checks import check_decoder
from pgm_places.models.decoders import register_decoder
from pgm_places.solvers.bucket_tree import BucketTree, Factor
from pgm_places.solvers.pairwise import pairwise_model
from tests.refusals import refused


def test_without_toulbar2_a_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pytoulbar2", None)
    with pytest.raises(InputError, match=r"the decoder 'toulbar2' needs .*pip install pytoulbar2"):
        exact_search(pairwise_model(np.zeros((2, 2)), [(0, 1)]))


class TestSearch:
    """Skipped where toulbar2 is not installed."""

    @pytest.fixture(autouse=True)
    def _needs_toulbar2(self, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip("pytoulbar2", reason="needs pytoulbar2")
        monkeypatch.setattr("pgm_places.models.decoders._registered", {})
        register_decoder("toulbar2", decode_by_toulbar2)

    def test_it_keeps_its_word(self) -> None:
        report = check_decoder("toulbar2", n_problems=120, seed=1)
        assert report.best + report.statuses["infeasible"] == 120

    @pytest.mark.parametrize("seed", range(3))
    def test_hard_grids_of_five_labels_are_solved_to_proof(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        grid = LabelGraph.from_lattice((6, 6))
        unary, tables = rng.normal(size=(36, 5)), rng.normal(size=(grid.n_edges, 5, 5))
        found = decode(grid, Potentials(unary, pairwise=tables), "toulbar2")
        tree = BucketTree.of(pairwise_model(unary, grid.edges, pairwise=tables))
        assert tree is not None
        best = float(tree.solved(unary)[1][0].max())
        assert found.status is Status.EXACT
        assert found.score == pytest.approx(best, rel=1e-12)

    def test_a_limit_ends_the_search_with_a_bound(self) -> None:
        rng = np.random.default_rng(2)
        grid = LabelGraph.from_lattice((10, 10))
        tables = 2 * rng.normal(size=(grid.n_edges, 5, 5))
        potentials = Potentials(rng.normal(size=(100, 5)), pairwise=tables)
        found = decode(grid, potentials, "toulbar2", max_iterations=20)
        assert found.status is Status.STOPPED
        assert found.gap is not None and found.gap > 0
        assert found.info["backtracks"] >= 20

    def test_large_numbers_for_rules_do_not_make_it_coarse(self) -> None:
        rng = np.random.default_rng(4)
        grid = LabelGraph.from_lattice((5, 5))
        tables = rng.normal(size=(grid.n_edges, 4, 4))
        tables[rng.random(tables.shape) < 0.3] = -1e12
        found = decode(grid, Potentials(rng.normal(size=(25, 4)), pairwise=tables), "toulbar2")
        assert found.status is Status.EXACT

    def test_factors_of_any_order_and_nodes_of_different_labels(self) -> None:
        rng = np.random.default_rng(5)
        sizes = [2, 3, 2, 4, 3]
        scopes = [(0, 1, 2), (4, 2, 1, 3), (3, 0), (2,)]
        factors = [Factor(s, rng.normal(size=[sizes[i] for i in s])) for s in scopes]
        factors[0].table[0, 1] = -np.inf
        found = search_factors(sizes, factors)
        every = np.indices(sizes).reshape(len(sizes), -1)
        scores = sum(f.table[tuple(every[list(f.scope)])] for f in factors)
        assert found.complete
        assert found.labels.tolist() == every[:, scores.argmax()].tolist()
        assert found.bound == pytest.approx(scores.max(), rel=1e-12)

    def test_one_cost_may_be_nearly_all_that_the_first_labelling_loses(self) -> None:
        """The first loses 5 twice, the best 8 at once."""
        pair = np.array([[-5.0, -5.0], [0.0, 0.0]])
        factors = [Factor((0,), np.array([0.0, -8.0])), Factor((0, 1), pair), Factor((0, 2), pair)]
        found = search_factors([2, 2, 2], factors, initial=np.zeros(3, np.int64))
        assert found.labels[0] == 1
        assert found.bound == pytest.approx(-8.0, rel=1e-12)

    def test_what_forbids_everything_is_proved_to(self) -> None:
        unlike = np.where(np.eye(2, dtype=np.bool_), -np.inf, 0.0)
        factors = [Factor(s, unlike) for s in [(0, 1), (1, 2), (0, 2)]]
        refused(InfeasibleError, "forbids every labelling", search_factors, [2, 2, 2], factors)
        with pytest.raises(InfeasibleError, match="forbids every labelling"):
            search_factors([2], [Factor((0,), np.full(2, -np.inf))])

    def test_nodes_of_one_label_take_part_in_factors(self) -> None:
        """In a factor of four nodes one of them ended the process."""
        rng = np.random.default_rng(3)
        sizes, scopes = [4, 1, 1, 2, 2, 2], [(5, 1, 3, 0), (3, 1), (2, 1), (1,)]
        factors = [Factor(s, rng.normal(size=[sizes[i] for i in s])) for s in scopes]
        every = np.indices(sizes).reshape(len(sizes), -1)
        scores = sum(f.table[tuple(every[list(f.scope)])] for f in factors)
        found = search_factors(sizes, factors)
        assert found.labels[[5, 3, 0]].tolist() == every[[5, 3, 0], scores.argmax()].tolist()
        assert found.bound == pytest.approx(scores.max(), rel=1e-12)
        alone = search_factors([1, 1], [Factor((0, 1), np.array([[2.5]]))])
        assert alone.labels.tolist() == [0, 0]
        assert alone.bound == pytest.approx(2.5, rel=1e-12)
        with pytest.raises(InfeasibleError, match="forbids every labelling"):
            search_factors([1, 2], [Factor((0,), np.array([-np.inf]))])


def test_the_entry_point_names_the_decoder() -> None:
    path = Path(__file__).parents[2] / "examples" / "plugins" / "pyproject.toml"
    entry = tomllib.loads(path.read_text())["project"]["entry-points"]["pgm_places.decoders"]
    module, _, name = entry["toulbar2"].partition(":")
    assert getattr(importlib.import_module(module), name) is decode_by_toulbar2
