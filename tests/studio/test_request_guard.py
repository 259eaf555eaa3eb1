"""The guard refuses whatever the studio's own page would not send."""

import json
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from pgm_places.studio.request_guard import MOST_BYTES, POLICY
from pgm_places.studio.server import static_files
from pgm_places.studio.session import MapSession
from tests.studio.conftest import HOST, PORT, TOKEN, Client

UNDO = {"kind": "undo"}


def test_its_own_page_is_served_under_a_policy_that_allows_nothing_else(
    client: Client,
) -> None:
    found = client.get("")
    assert found.status_code == 200
    assert found.headers["content-security-policy"] == POLICY
    assert "unsafe" not in POLICY and "*" not in POLICY
    assert found.headers["x-content-type-options"] == "nosniff"
    assert found.headers["referrer-policy"] == "no-referrer"
    assert "access-control-allow-origin" not in found.headers


@pytest.mark.parametrize("path", ["/", "/state", "/x/state", f"/{TOKEN[:-1]}/state", f"/{TOKEN}x/"])
def test_an_address_without_the_token_is_refused(stranger: Client, path: str) -> None:
    found = stranger.get(path)
    assert found.status_code == 403
    assert "token" in found.text
    assert found.headers["content-security-policy"] == POLICY


@pytest.mark.parametrize("host", ["evil.example", f"evil.example:{PORT}", "127.0.0.1:1", "[::1]"])
def test_a_name_that_was_bound_to_this_computer_is_refused(stranger: Client, host: str) -> None:
    found = stranger.get(f"/{TOKEN}/state", headers={"host": host})
    assert found.status_code == 403
    assert "answers only as" in found.text


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "", None])
def test_another_page_may_neither_write_nor_read(stranger: Client, origin: str | None) -> None:
    headers = {} if origin is None else {"origin": origin}
    assert stranger.post(f"/{TOKEN}/edit", json=UNDO, headers=headers).status_code == 403
    if origin:
        assert stranger.get(f"/{TOKEN}/state", headers=headers).status_code == 403


@pytest.mark.parametrize(
    ("method", "headers", "code"),
    [
        *(("POST", {"content-type": kind}, 415) for kind in ("text/plain", "a/form-data", "")),
        *((method, {}, 405) for method in ("PUT", "DELETE", "OPTIONS", "PATCH")),
        ("GET", {"sec-fetch-site": "cross-site"}, 403),
    ],
)
def test_what_a_form_or_another_method_sends_is_refused(
    client: Client, method: str, headers: dict[str, str], code: int
) -> None:
    path = "state" if method == "GET" else "edit"
    found = client.request(method, path, content=json.dumps(UNDO), headers=headers)
    assert found.status_code == code


@pytest.mark.parametrize(
    "name", ["host", "origin", "content-type", "content-length", "sec-fetch-site"]
)
def test_a_header_given_twice_is_refused(stranger: Client, name: str) -> None:
    body, address = json.dumps({"kind": "learn", "on": False}), f"/{TOKEN}/edit"
    good = {
        "host": HOST.removeprefix("http://"),
        "origin": HOST,
        "content-type": "application/json",
        "content-length": str(len(body)),
        "sec-fetch-site": "same-origin",
    }
    assert stranger.post(address, content=body, headers=good).status_code == 200
    twice = [*good.items(), (name.title(), good[name])]
    assert stranger.post(address, content=body, headers=twice).status_code == 400


def test_a_body_that_is_too_large_is_refused_whatever_its_length_says(client: Client) -> None:
    headers = {"content-type": "application/json"}
    body = b" " * (MOST_BYTES + 1)
    assert client.post("edit", content=body, headers=headers).status_code == 413

    async def pieces() -> AsyncIterator[bytes]:  # sent without a length
        for _ in range(MOST_BYTES // 1000 + 1):
            yield body[:1000]

    assert client.post("edit", content=pieces(), headers=headers).status_code == 413


@pytest.mark.parametrize(
    "path",
    ["static/../server.py", "static/%2e%2e%2fserver.py", "static/server.py", "static//etc/passwd"],
)
def test_no_other_file_is_read(client: Client, path: str) -> None:
    assert client.get(path).status_code in (403, 404)


def test_the_page_needs_nothing_from_elsewhere_and_nothing_inline() -> None:
    files = static_files()
    page = files["index.html"].decode()
    assert "<style" not in page and " style=" not in page and "onclick" not in page
    for name, content in files.items():
        text = content.decode().replace("http://www.w3.org/2000/svg", "")
        assert "http://" not in text and "https://" not in text, name


def test_exports_stay_in_the_folder(
    client: Client, open_session: Callable[[], MapSession], map_yaml: Path
) -> None:
    before = sorted(map_yaml.parent.iterdir())
    for what in ("../x", "/tmp/x", "labels"):
        assert client.post("export", json={"what": what}).status_code == 400
    assert sorted(map_yaml.parent.iterdir()) == before
