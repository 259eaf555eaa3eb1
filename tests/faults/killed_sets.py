"""Kills a process that writes a set of files at every step; asserts what it leaves.

A script of its own, because it forks: ``python -m tests.faults.killed_sets FOLDER MODE``.
"""

import os
import sys
from functools import partial
from pathlib import Path

from pgm_places.io.output_set import RECORD_FILE, claim
from tests.faults.sets import content, whole, write_set
from tests.faults.steps import count_steps, killed_at, leftovers


def check_kills(folder: Path, mode: str) -> int:
    """Kill at every step in one way of writing, or at a third of them; the number of kills."""
    shared = mode == "shared"

    def fresh(name: str) -> Path:
        target = folder / name
        if mode != "absent":
            write_set(target, "old", shared=shared)
            (target / "mine.txt").write_text("mine")
            (target / "notes").mkdir()
            (target / "notes" / "mine.txt").write_text("mine")
            if mode == "current":
                os.chdir(target)
        return target

    first = fresh("counted")
    n_steps = count_steps(partial(write_set, first, "new", shared=shared))
    assert n_steps > 10
    ends = []
    every = 1 if os.environ.get("PGM_PLACES_KILLS") else 3
    chosen = [*range(1, n_steps, every), n_steps]
    for number in chosen:
        target = fresh(f"{number}")
        assert killed_at(number, partial(write_set, target, "new", shared=shared))
        if mode == "absent":
            ends.append(whole(target) if target.exists() else "old")
            assert target.exists() or not content(target)
        else:
            if mode == "exchanged":  # no help of a later run is needed
                assert set(content(target).values()) <= {"mine", "old"} or (
                    set(content(target).values()) <= {"mine", "new"}
                )
            ends.append(whole(target, "mine.txt", "notes/mine.txt"))
        write_set(target, "new", shared=shared)
        assert not leftovers(target)
    assert ends == sorted(ends, reverse=True)  # once new, new
    assert {"old", "new"} == set(ends)
    return len(chosen)


def check_claims(folder: Path) -> int:
    """Kill at every step of claiming a folder; the number of kills."""
    n_steps = count_steps(partial(claim, folder / "counted"))
    assert n_steps > 3
    for number in range(1, n_steps + 1):
        for name, again in (("claimed", claim), ("written", partial(write_set, name="new"))):
            target = folder / f"{name}{number}"
            assert killed_at(number, partial(claim, target))
            again(target)
            assert (target / RECORD_FILE).exists()
            assert not leftovers(target)
    return n_steps


if __name__ == "__main__":
    os.fsync = lambda number: None  # type: ignore[assignment]  # no power fails here, and it is slow
    where, how = Path(sys.argv[1]), sys.argv[2]
    n_kills = check_claims(where) if how == "claimed" else check_kills(where, how)
    sys.stdout.write(f"{n_kills}\n")
