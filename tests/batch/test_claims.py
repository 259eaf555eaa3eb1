"""Several batches on one folder: claims of maps, and what a batch leaves that was killed."""

import contextlib
import time
from pathlib import Path
from typing import Any

import pytest

from pgm_places.batch.batch_folder import claim_of
from pgm_places.errors import OutputError
from pgm_places.io.output_set import claim
from pgm_places.io.staging import claimed, open_own
from tests.batch.shared import Batch, Hanging, RecordingWorkers


def test_a_map_that_somebody_else_labels_is_left_to_them_and_looked_at_later(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = maps.parent / "out"
    claim(out)
    other = contextlib.ExitStack()
    assert other.enter_context(claimed(claim_of(out, "floor1/map")))
    waits = []

    def let_go(_: float) -> None:
        waits.append([path.parents[2].name for path in out.rglob("manifest.json")])
        other.close()

    monkeypatch.setattr(time, "sleep", let_go)
    watched = RecordingWorkers()
    batch(watched)
    assert watched.labelled == ["floor2/map", "floor1/map"]
    assert waits == [["floor2"]]


def test_what_the_dead_left_is_removed(batch: Batch, maps: Path) -> None:
    batch()
    out = maps.parent / "out"
    left = out / "floor1" / ".map.0123456789ab.tmp"
    for name in ("floor1/map", "../maps"):
        claim_of(out, name).parent.mkdir(exist_ok=True)
        claim_of(out, name).write_text(name)
        left.mkdir(exist_ok=True)
        held = maps.parent / ".maps.0123456789ab.tmp"
        held.mkdir(exist_ok=True)
    batch()
    assert (left.exists(), held.exists()) == (False, True)
    assert not claim_of(out, "floor1/map").parent.exists()


def test_a_claim_is_made_though_another_batch_removes_the_folder_of_claims(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = claim_of(tmp_path, "hall")
    opened: list[Path] = []

    def remove_first(path: Path, flags: int) -> int:
        if not opened:
            path.parent.rmdir()
        opened.append(path)
        return open_own(path, flags)

    monkeypatch.setattr("pgm_places.io.staging.open_own", remove_first)
    with claimed(file) as is_ours:
        assert is_ours and file.exists()


def test_an_interrupted_batch_leaves_no_claim_and_no_stage(
    batch: Batch, maps: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as changed, pytest.raises(KeyboardInterrupt):
        changed.setattr("pgm_places.batch.batch_index.BatchIndex.add", interrupt)
        batch(Hanging(2))
    out = maps.parent / "out"
    assert not claim_of(out, "floor1/map").parent.exists()
    assert not [path for path in out.rglob(".*") if path.suffix == ".tmp"]


def test_a_link_in_place_of_the_claims_is_refused_and_nothing_behind_it_touched(
    batch: Batch, maps: Path
) -> None:
    batch()
    out, home = maps.parent / "out", maps.parent / "home"
    home.mkdir()
    (home / "id_rsa").write_text("secret")
    claims = claim_of(out, "floor1/map").parent
    claims.symlink_to("../home")
    with pytest.raises(OutputError, match="claims: it is a symbolic link; remove it"):
        batch()
    with (
        pytest.raises(OutputError, match="it is a symbolic link"),
        claimed(claim_of(out, "floor1/map"), "floor1/map"),
    ):
        pass
    assert [path.name for path in home.iterdir()] == ["id_rsa"]


def test_files_among_the_claims_and_what_lies_behind_links_stay(batch: Batch, maps: Path) -> None:
    batch()
    out, home = maps.parent / "out", maps.parent / "home"
    held = home / ".map.0123456789ab.tmp"
    held.mkdir(parents=True)
    (home / "notes").write_text("floor1/map")
    claims = claim_of(out, "floor1/map").parent
    claims.mkdir()
    (claims / "notes").write_text("mine")
    (claims / ("0" * 32)).symlink_to(home / "notes")
    (out / "elsewhere").symlink_to("../home")
    claim_of(out, "elsewhere/map").write_text("elsewhere/map")
    batch()
    assert (claims / "notes").read_text() == "mine"
    assert (home / "notes").read_text() == "floor1/map"
    assert held.exists()
