"""Where the page may have files written, and where not, whoever asks."""

from pathlib import Path

import pytest

from pgm_places.errors import InputError
from pgm_places.studio.export_folders import ExportFolders
from pgm_places.studio.exports import exports_record, write_export
from pgm_places.studio.session import MapSession
from pgm_places.studio.session_pool import SessionPool
from tests.studio.conftest import HOST, TOKEN, Client
from tests.studio.test_exports import paint


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ExportFolders:
    """A studio that was started in ``work``, with ``told`` beside it on the command line."""
    for name in ("work", "told", "secret"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return ExportFolders.started_here([Path("../told")])


def test_below_the_working_folder_and_where_it_was_told(
    folders: ExportFolders, tmp_path: Path
) -> None:
    own = tmp_path / "kept"
    assert folders.chosen("", own) == folders.chosen(" ", own) == own
    assert folders.chosen(str(own), own) == own
    assert folders.chosen("floor/1", own) == (tmp_path / "work" / "floor" / "1").resolve()
    assert folders.chosen("../told/x", own) == (tmp_path / "told" / "x").resolve()
    assert folders.chosen(".", own) == (tmp_path / "work").resolve()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("..", "is neither"),
        ("../secret", "is neither"),
        ("/etc", "is neither"),
        ("../toldx", "is neither"),
        ("link/x", "is neither"),
        ("loop", "cannot be a folder"),
        ("loop/x", "cannot be a folder"),
        (".git/hooks", "is hidden"),
        ("a/.ssh", "is hidden"),
        ("~/.ssh", "write '~/.ssh' out"),
        ("file", "is a file"),
        ("a\0b", "invalid characters"),
        ("a\nb", "invalid characters"),
        ("a" * 2000, "too long"),
    ],
)
def test_elsewhere_nothing_is_written(
    text: str, words: str, folders: ExportFolders, tmp_path: Path
) -> None:
    (tmp_path / "work" / "link").symlink_to(tmp_path / "secret")
    (tmp_path / "work" / "loop").symlink_to("loop")
    (tmp_path / "work" / "file").touch()
    with pytest.raises(InputError, match=words):
        folders.chosen(text, tmp_path / "kept")


def test_the_whole_disk_is_no_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir("/")
    with pytest.raises(InputError, match="is neither"):
        ExportFolders.started_here().chosen("etc", tmp_path)


def test_what_the_studio_was_given_is_never_written_over(
    session: MapSession, folders: ExportFolders, tmp_path: Path
) -> None:
    truth = tmp_path / "work" / "corrections.png"
    truth.write_bytes(b"drawn in a week")
    paint(session, 0, (6, 6), (24, 24))
    careful = ExportFolders.started_here([], [truth])
    with pytest.raises(InputError, match=r"corrections\.png is an input of the studio"):
        write_export(session, "corrections", careful, chosen=".", replaced=["corrections.png"])
    assert truth.read_bytes() == b"drawn in a week"
    assert not (tmp_path / "work" / "corrections.yaml").exists()


def test_only_what_was_seen_is_replaced(
    session: MapSession, tmp_path: Path, folders: ExportFolders
) -> None:
    paint(session, 0, (6, 6), (24, 24))
    pool = SessionPool.of(session, folders)
    client = Client(pool, f"{HOST}/{TOKEN}/", {"origin": HOST})
    request = {"what": "corrections", "folder": "../told"}
    theirs = tmp_path / "told" / "corrections.geojson"
    before = '{"type": "FeatureCollection", "features": []}'
    theirs.write_text(before)
    refused = client.post("export", json=request)
    assert refused.status_code == 400
    assert "corrections.geojson was written there in the meantime" in refused.json()["problem"]
    assert theirs.read_text() == before
    assert not (tmp_path / "told" / "corrections.png").exists()
    items = {item["name"]: item for item in exports_record(session, folders, "../told")["items"]}
    assert items["corrections"]["there"] == ["corrections.geojson"]
    answer = client.post("export", json={**request, "replaced": ["corrections.geojson"]})
    assert answer.status_code == 200, answer.text
    assert theirs.read_text() != before
    assert not (session.folder / "corrections.png").exists()
    for folder in ("../secret", "/etc", ".git"):
        assert client.post("export", json={**request, "folder": folder}).status_code == 400
        assert client.get("exports", params={"folder": folder}).status_code == 400


def test_a_page_from_elsewhere_cannot_choose_a_folder(
    session: MapSession, folders: ExportFolders, tmp_path: Path
) -> None:
    paint(session, 0, (6, 6), (24, 24))
    stranger = Client(SessionPool.of(session, folders), HOST, {"origin": "http://evil.example"})
    request = {"what": "corrections", "folder": "."}
    for path in ("/export", f"/{TOKEN}/export"):
        assert stranger.post(path, json=request).status_code == 403
    assert not list((tmp_path / "work").iterdir())
