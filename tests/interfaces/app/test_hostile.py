"""No request of one who may enter ends in a fault of the program, and the page opens whatever lies in its folders."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

from tests.interfaces.app.server import Served, served, test_files

LONG = "x" * 5000
HALF = "\ud800"
ODD = "n" * 240 + "\udcff.npz"
DEEP = b"[" * 100_000
NESTED = "[" * 400 + "]" * 400


@pytest.fixture(scope="module")
def rubbish(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A server whose folder and place hold what nobody should have put there."""
    folder, place = test_files(tmp_path_factory.mktemp("rubbish")), tmp_path_factory.mktemp("place")
    odd = os.fsencode(folder) + b"/" + b"n" * 240 + b"\xff.npz"
    Path(os.fsdecode(odd)).write_bytes((folder / "plain.npz").read_bytes())
    (folder / "loop.uff").symlink_to(folder / "loop.uff")
    (folder / "gone.uff").symlink_to(folder / "nothing-there.uff")
    (folder / "line\nbreak.npz").write_bytes((folder / "plain.npz").read_bytes())
    os.mkfifo(folder / "pipe.csv")
    (place / "documents").mkdir()
    (place / "uploads").mkdir()
    (place / "uploads" / "stray").write_text("")
    entries = {"plain": '{"name": "a", "place": 0, "history": []}', "deep": DEEP.decode(), "text": "no JSON"}
    entries |= {"list": "[]", "null": "null", "numbers": '{"name": 1, "place": "x", "history": [1]}'}
    entries |= {"name": '{"name": "a", "place": 1e999, "history": [{}]}', "nested": f'{{"name": {NESTED}}}'}
    entries |= {
        "many": '{"name": "a", "place": 0, "history": 5}',
        "half": '{"name": "\\ud800", "place": 0, "history": [{}]}',
    }
    for name, text in entries.items():
        (place / "documents" / f"{name}.json").write_text(text)
    (place / "documents" / "folder.json").mkdir()
    (place / "documents" / "gone.json").symlink_to(place / "none")
    documents = {"deep": DEEP.decode(), "files": '{"analysis": {"files": null}}', "list": '{"analysis": []}'}
    documents |= {
        "path": '{"analysis": {"files": [{"path": 5}]}}',
        "half": '{"analysis": {"files": [{"path": "\\ud800"}]}}',
    }
    documents |= {
        "long": json.dumps({"analysis": {"files": [{"path": LONG}]}}),
        "nul": '{"analysis": {"files": [{"path": "a\\u0000"}]}}',
    }
    documents |= {
        "nested": f'{{"analysis": {{"options": {{"a": {NESTED}}}}}}}',
        "infinite": '{"analysis": {"bands": [[1, 1e999]]}}',
    }
    for name, text in documents.items():
        (folder / f"{name}.analysis.json").write_text(text)
    kept = json.loads((folder / "plain.analysis.json").read_text())
    for name, given in {"nan": {"x": float("nan")}, "infinity": {"x": [float("inf")]}, "big": {"x": 10**400}}.items():
        kept["analysis"]["options"] = given
        (folder / f"{name}.analysis.json").write_text(json.dumps(kept))
    kept["analysis"]["options"] = {}
    for name, given in {"null": None, "mapping": {"a": 1}, "numbers": [1, 2], "empty": [], "half": HALF}.items():
        kept["analysis"]["files"][0]["reading"] = {"geometry": given}
        (folder / f"geometry-{name}.analysis.json").write_text(json.dumps(kept))
    with served(folder, place) as made:
        yield made


def answered(server: Served, method: str, path: str, body: Any = None, **headers: str) -> int:
    status, _, answer = server.request(method, path, body, **headers)
    assert status < 500, (status, method, path, answer)
    return status


def test_the_page_opens_whatever_lies_in_its_folders(rubbish: Served) -> None:
    listed = rubbish.ask("GET", "/api/start")
    assert len(listed["files"]) > 10
    for entry in listed["documents"]:
        answered(rubbish, "GET", f"/api/documents/{entry['key']}")
        answered(rubbish, "POST", f"/api/documents/{entry['key']}/cancel", {})
    for name in ("plain", "deep", "list", "null", "numbers", "name", "nested", "many", "half", "folder", "gone"):
        assert answered(rubbish, "GET", f"/api/documents/{name}") in (200, 400)
    for entry in listed["files"]:
        status, _, answer = rubbish.request("POST", "/api/open", {"files": [entry["name"]]})
        assert status in ((200,) if entry["name"] == ODD else (200, 400)), (entry["name"], answer)
        if status == 200:
            answered(rubbish, "POST", f"/api/documents/{json.loads(answer)['key']}/close", {})


def test_names_that_are_none_are_answered(rubbish: Served) -> None:
    for name in (
        LONG,
        HALF,
        "a\0b",
        "",
        ".",
        "..",
        "/",
        "upload:",
        f"upload:{LONG}",
        f"upload:{HALF}",
        "loop.uff",
        "pipe.csv",
    ):
        for files in ([name], ["plain.npz", name]):
            assert answered(rubbish, "POST", "/api/open", {"files": files}) == 400
    for key in (LONG, "%00", "%ff", "²", ".", "plain%2f..", quote("\u0660" * 200)):
        path = f"/api/documents/{quote(key, safe='%')}"
        for method, tail in (
            ("GET", ""),
            ("POST", "/act"),
            ("POST", "/close"),
            ("POST", "/cancel"),
            ("POST", "/compare"),
        ):
            answered(rubbish, method, path + tail, {"action": "again"} if method == "POST" else None)
        for tail in ("/blob/modes", "/blob/%00", "/channel?output=0&input=0", "/export/json"):
            answered(rubbish, "GET", path + tail)
    for path in (
        "/static/%00",
        f"/static/{LONG}",
        "/static/..%2f..%2fserve.py",
        "/static/%ff",
        "//",
        "/%00",
        f"/{LONG}",
    ):
        assert answered(rubbish, "GET", path) in (400, 404)
    for name in (LONG, "%00", "%ff", "%ed%a0%80", "..", ""):
        assert answered(rubbish, "POST", f"/api/upload?name={name}", b"x") == 200


def test_bodies_that_are_none_are_answered(rubbish: Served) -> None:
    bodies = [
        DEEP,
        b'{"a":' * 20_000,
        b"\xff",
        b"",
        b"null",
        b"5",
        b"NaN",
        b'{"files": NaN}',
        b'{"files": 1e999}',
        b"9" * 5000,
    ]
    bodies += [
        NESTED.encode(),
        f'{{"files": {NESTED}}}'.encode(),
        b'{"files": {}}',
        b'{"files": [[]]}',
        b'{"files": "a"}',
    ]
    for body in bodies:
        for path in ("/api/open", "/api/documents/none/act", "/api/documents/none/against"):
            answered(rubbish, "POST", path, body)


#: Values that arguments of actions are not.
WRONG: list[Any] = [
    None,
    5,
    -1,
    0,
    1e300,
    float("inf"),
    float("nan"),
    10**400,
    True,
    "",
    "a",
    LONG,
    HALF,
    "a\0",
    [],
    [[]],
    {},
]
WRONG += [
    [None],
    [1, "a"],
    [[1, 2, 3]],
    [[None, None]],
    [HALF],
    {"a": {}},
    {"x": HALF},
    {"array": ["a"]},
    json.loads(NESTED),
]


@pytest.mark.slow
def test_actions_with_wrong_arguments_are_answered(rubbish: Served) -> None:
    key = rubbish.open("plain.analysis.json")
    state = rubbish.settled(key)
    calls = {
        "set": (
            "bands",
            "exclude",
            "route",
            "reciprocal",
            "method",
            "domain",
            "orders",
            "options",
            "refine",
            "remarks",
            "no",
        )
    }
    calls |= {
        "take": ("frequency", "x"),
        "refuse": ("frequency",),
        "name": ("frequency", "name"),
        "geometry": ("files",),
    }
    calls |= {"exact_nodes": ("exact",), "reading": ("columns", "rows", "sampling_rate"), "none": ("a",), HALF: ("a",)}
    for action, names in calls.items():
        for name in names:
            for value in WRONG:
                given = {name: value} if action != "name" or name == "frequency" else {"frequency": 1.0, name: value}
                body = {"action": action, "given": given, "edition": None}
                if answered(rubbish, "POST", f"/api/documents/{key}/act", body) == 200:
                    answered(rubbish, "GET", f"/api/documents/{key}")
                    assert rubbish.act(key, "undo")["document"] == state["document"], (action, name, value)
    for value in WRONG:
        for body in ({"action": value}, {"action": "again", "edition": value}, {"action": "take", "given": value}):
            answered(rubbish, "POST", f"/api/documents/{key}/act", body)
        answered(rubbish, "POST", f"/api/documents/{key}/against", {"file": value})
    answered(rubbish, "POST", f"/api/documents/{key}/cancel", {})


@pytest.mark.slow
def test_questions_with_wrong_numbers_are_answered(rubbish: Served) -> None:
    key = rubbish.open("plain.analysis.json")
    rubbish.settled(key)
    for number in ("%C2%B2", "%D9%A1", "-1", "1e3", "", "0x1", "999999999", "9" * 4000, "%00", "%ff"):
        assert answered(rubbish, "GET", f"/api/documents/{key}/channel?output={number}&input=0") == 400
        assert answered(rubbish, "GET", f"/api/documents/{key}/export/gif?mode={number}") == 400
    for suffix in (LONG, "%00", "exe", "%C2%B2", "..%2fx"):
        answered(rubbish, "GET", f"/api/documents/{key}/export/{suffix}")


@pytest.mark.slow
def test_files_of_odd_names_are_exported(rubbish: Served) -> None:
    key = rubbish.open(ODD)
    rubbish.act(key, "set", orders=[8, 10])
    rubbish.settled(key)
    assert answered(rubbish, "GET", f"/api/documents/{key}/export/analysis.json") == 200


@pytest.mark.parametrize(
    "other", ['a="b', 'x={"a":1}', "a=b=c", "=", "ü=1", "a b=c", 'q="x;y"', "theme=dark, light", "a;;b"]
)
def test_the_cookie_is_found_among_those_of_other_programs(rubbish: Served, other: str) -> None:
    for cookies in (f"{other}; {rubbish.cookie}", f"{rubbish.cookie}; {other}"):
        assert rubbish.request("GET", "/api/start", Cookie=cookies.encode().decode("latin-1"))[0] == 200
    assert rubbish.request("GET", "/api/start", Cookie=other.encode().decode("latin-1"))[0] == 401


def test_a_request_that_does_not_come_on_ends(rubbish: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """A head in parts has its time once, a body for each part; a stream of events is no request that waits."""
    monkeypatch.setattr("modalscope.interfaces.app.serve._PATIENCE", 0.5)
    host, _, port = rubbish.base.removeprefix("http://").partition(":")
    head = f"POST /api/upload?name=a.csv HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: {rubbish.base}\r\nCookie: {rubbish.cookie}\r\n"
    whole = f"{head}Content-Length: 6\r\n\r\n"
    for sent, answered in ((["GET / HT", *"TP/1."], False), ([whole, "1"], False), ([whole, *"123456"], True)):
        with socket.create_connection((host, int(port)), timeout=20) as line:
            for part in sent:
                with contextlib.suppress(OSError):
                    line.sendall(part.encode())
                time.sleep(0.2)
            begun = time.monotonic()
            assert (line.recv(100)[:12] == b"HTTP/1.1 200") == answered
            assert time.monotonic() - begun < 5


def test_lengths_that_are_none_are_answered(rubbish: Served) -> None:
    host = rubbish.base.removeprefix("http://")
    for length in ("²", "-1", "1e9", "99999999999999999999", "a"):
        connection = http.client.HTTPConnection(host, timeout=20)
        connection.putrequest("POST", "/api/upload?name=a.csv")
        for name, value in (("Origin", rubbish.base), ("Cookie", rubbish.cookie), ("Content-Length", length)):
            connection.putheader(name, value.encode("latin-1"))
        connection.endheaders()
        assert connection.getresponse().status < 500
        connection.close()
