"""What the application answers about a session that has learned."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pgm_places.experiment.config import load_config
from pgm_places.io.maps.label_image import load_labels
from pgm_places.persistence.stored import load
from pgm_places.studio.layers import GivenLabels
from pgm_places.studio.session import MapSession
from tests.studio.conftest import HOST, TOKEN, Client, rectangle, wait


@pytest.fixture
def taught(session: MapSession, client: Client) -> Client:
    """Two rooms, one of them painted corridor, and the door between them; all learned."""
    session.start()
    for label, left, right in ((0, 6, 24), (1, 27, 45)):
        client.post("edit", json=rectangle(label, [left, 6], [right, 24])).raise_for_status()
    client.post("edit", json=rectangle(2, [25, 13], [26, 17])).raise_for_status()
    wait(session, 3)
    return client


def test_a_taught_desk_tells_shows_and_exports_what_it_has_learned(
    taught: Client, session: MapSession, map_yaml: Path
) -> None:
    state = taught.get("state").json()
    assert list(state["sources"]) == ["taught", "before", "unary"]
    assert state["relabelling"]["revision"] == 3
    cell = taught.get("cell", params={"x": 10.5, "y": 10.5}).json()
    assert (cell["ground"], cell["paint"], cell["label"]) == ("free", "corridor", "corridor")
    assert cell["probabilities"]["corridor"] == pytest.approx(1.0)
    assert (cell["x_m"], cell["y_m"]) == pytest.approx((3.1, 0.1))
    for layer in ("labels-taught", "labels-unary", "entropy", "probability-0", "probability-2"):
        assert taught.get(f"tile/{layer}/0/0/0.png", params={"theme": "dark"}).status_code == 200

    where = {"x_m": cell["x_m"], "y_m": cell["y_m"]}
    reasons = taught.get("reasons", params=where).json()
    assert reasons["painted"] and len(reasons["scan_m"]) > 90
    for question in reasons["questions"]:
        votes = [vote["log_odds"] for vote in question["votes"]]
        assert votes == [v for v in votes if v > 0] + [v for v in votes if v < 0]
    units = {vote["unit"] for question in reasons["questions"] for vote in question["votes"]}
    assert {"m", ""} <= units <= {"m", "m²", "1/m", "rad", ""}
    assert taught.get("reasons", params={"x_m": 0, "y_m": 0}).status_code == 400

    places = taught.get("places").json()
    door = next(item for item in places["regions"] if item["class"] == "doorway")
    rooms = [item for item in places["regions"] if item["class"] != "doorway"]
    assert sorted(door["neighbours"]) == sorted(item["id"] for item in rooms)
    assert {check["id"] for check in places["checks"]} <= {i["id"] for i in places["regions"]}

    for item in rooms:
        request = {"kind": "rename", "point_m": item["anchor_m"], "name": "kitchen"}
        found = taught.post("edit", json=request)
        if item is rooms[0]:
            found.raise_for_status()
        else:
            assert "another place is called 'kitchen'" in found.json()["problem"]

    exports = taught.get("exports").json()
    assert exports["folder"] == str(session.folder.resolve())
    assert not any(item["written"] for item in exports["items"])
    seen: list[str] = []
    for what in (item["name"] for item in exports["items"]):
        written = taught.post("export", json={"what": what, "replaced": seen}).json()["files"]
        seen += [Path(path).name for path in written]
        assert written and all(Path(path).exists() for path in written)
        assert all(Path(path).is_relative_to(session.folder) for path in written)
    for item in taught.get("exports").json()["items"]:
        assert item["written"] and not item["older"]
        assert all((session.folder / file).exists() for file in item["files"])
    names = ("corridor", "room", "doorway")
    kept = load_labels(session.folder / "corrections.png", names, grid=session.grid)
    assert (kept == session.painting.labels).all()
    topology = json.loads((session.folder / "places.json").read_text())
    assert "kitchen" in [item["name"] for item in topology["regions"]]
    assert load_config(session.folder / "train.toml").labels.names == names
    assert set(load(session.folder / "model").label_names_) == set(names)

    taught.post("edit", json={"kind": "version", "name": "v"}).raise_for_status()
    assert not any(item["older"] for item in taught.get("exports").json()["items"])
    one, other = (item["id"] for item in rooms)
    taught.post("edit", json={"kind": "merge", "first": one, "second": other}).raise_for_status()
    painted = session.painting.labels[session.painting.labels >= 0]
    assert np.unique(painted).size == 1  # the door between them, too
    assert session.painting.labels[15, 25] == painted[0]


def test_a_question_for_news_is_answered_when_there_are_some(
    client: Client, session: MapSession
) -> None:
    client.pool.news_s = 0.1
    tick = client.get("state").json()["tick"]
    assert client.get("state", params={"after": tick}).json()["tick"] == tick
    client.post("edit", json=rectangle(0, [6, 6], [9, 9]))
    found = client.get("state", params={"after": tick}).json()
    assert found["tick"] > tick and found["painted"] == 9


def test_a_doorway_says_where_it_will_end_and_that_it_parts_nothing(client: Client) -> None:
    where = {"x1": 25.5, "y1": 14.5, "x2": 25.5, "y2": 15.5}
    ends = client.get("door-line", params=where).json()["ends"]
    assert sorted(y for _, y in ends) == pytest.approx([13.5, 16.5], abs=0.6)
    stroke = {"tool": "doorway", "points": [[25.5, 14.5], [25.5, 15.5]], "radius": 0.6}
    request = {"kind": "stroke", "label": 2, "stroke": stroke}
    assert client.post("edit", json=request).json()["remark"] == ""
    stroke["points"] = [[10.5, 9.0], [10.5, 11.0]]
    found = client.post("edit", json=request).json()
    assert found["remark"].startswith("This doorway parts nothing: there is a way around it.")
    assert client.get("door-line", params=dict.fromkeys(where, "nan")).status_code == 400


@pytest.mark.parametrize(
    "path", ["cell", "cell?x=1", "cell?x=nan&y=1", "cell?x=1e300&y=1", "state?after=x"]
)
def test_questions_that_make_no_sense_are_refused(client: Client, path: str) -> None:
    assert client.get(path).status_code == 400


def test_the_classes_of_a_file_to_compare_with_are_offered(
    map_yaml: Path, open_session: Callable[[], MapSession]
) -> None:
    from pgm_places.io.maps.map_server import load_map

    loaded = load_map(map_yaml)
    truth = np.where(loaded.grid.free, 1, -1).astype(np.int16)
    given = [GivenLabels("truth.png", truth, ("hall", "lab"))]
    session = MapSession(loaded, map_yaml.parent / "k", None, given=given)
    try:
        assert session.painting.classes.names == ("hall", "lab")
        assert session.layers.sources == {"file:0": "truth.png"}
    finally:
        session.close()


@pytest.mark.parametrize(
    "body",
    [
        *(
            b"",
            b"{",
            b"x",
            b'"x"',
            b"\xff\xfe",
            b"[",
            b"null",
            b"[]",
            b"[" * 100_000,
            b'{"a":' * 100_000,
        ),
        b'{"kind": "undo", "a": NaN}',
        b'{"kind": "undo", "a": -Infinity}',
        b'{"kind": "undo", "a": 1e999}',
        b'{"kind": "undo", "a": ' + b"9" * 5000 + b"}",
    ],
)
def test_an_edit_that_is_not_json_is_refused_in_a_line(session: MapSession, body: bytes) -> None:
    client = Client(
        session, f"{HOST}/{TOKEN}/", {"origin": HOST, "content-type": "application/json"}
    )
    answer = client.post("edit", content=body)
    assert answer.status_code == 400
    assert answer.json() == {"problem": "a request must be a JSON object"}
