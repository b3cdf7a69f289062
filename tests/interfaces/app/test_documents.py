"""Documents endure: bad files, two jobs at once, a cancel, a worker that is killed, a server that starts again; nothing is lost."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

import modalscope as ms
from modalscope.interfaces.app.guard import Limits
from modalscope.io.analysis import analysis_from
from tests.interfaces.app.server import SMALL, Served, served, until

#: Orders that a job is done with in a moment.
FEW = list(range(2, 21, 2))


@pytest.mark.slow
def test_the_modes_are_those_of_replay_to_the_last_digit(server: Served, key: str) -> None:
    server.act(key, "refuse", frequency=server.modes(key)["modes"][1]["frequency"])
    state = server.settled(key)
    again = ms.replay(analysis_from(state["document"])).modes
    _, headers, text = server.request("GET", f"/api/documents/{key}/export/json")
    assert 'filename="plain.json"' in headers["content-disposition"]
    place = Path(server.store.files.place) / "back.json"
    place.write_bytes(text)
    assert (ms.read(place).poles == again.poles).all()
    assert [m["frequency"] for m in server.modes(key)["modes"]] == list(again.frequencies)
    assert len(again) == 4


def test_undo_and_redo_are_documents_and_cost_no_sweep(server: Served, key: str) -> None:
    first = server.settled(key)
    frequency = server.modes(key)["modes"][0]["frequency"]
    server.act(key, "refuse", frequency=frequency)
    assert server.settled(key)["document"]["refused"][-1] == frequency
    count = server.state(key)["blobs"]["poles"]
    assert server.act(key, "undo")["document"] == first["document"]
    assert server.act(key, "redo")["document"]["refused"][-1] == frequency
    state = server.settled(key)
    assert (state["undo"], state["redo"], state["blobs"]["poles"]) == (True, False, count)
    assert frequency not in [m["frequency"] for m in server.modes(key)["modes"]]


@pytest.mark.parametrize("name", ["broken.uff"])
def test_a_bad_file_says_what_is_wrong_with_it(server: Served, name: str) -> None:
    failed = server.settled(server.open(name))["failed"]
    assert all(failed[part] for part in ("asked", "found", "change"))


@pytest.mark.parametrize("name", ["../pyproject.toml", "/etc/passwd", "none.uff", ""])
def test_what_is_not_in_the_folder_is_not_opened(server: Served, name: str) -> None:
    assert server.ask("POST", "/api/open", {"files": [name]}, status=400)["change"]


def test_points_alone_are_told_to_be_a_geometry(server: Served, folder: Path) -> None:
    (folder / "alone.csv").write_text("node,x,y,z\nP1,0,0,0\nP2,1,0,0\n")
    parts = server.ask("POST", "/api/open", {"files": ["alone.csv"]}, status=400)
    assert "it is a geometry" in parts["found"]
    assert "Drop the measurement with it" in parts["change"]


def test_the_example_beam_can_be_opened_without_a_file(server: Served) -> None:
    key = server.open("example:beam_hammer")
    (file,) = server.state(key)["document"]["files"]
    assert Path(file["path"]).read_bytes() == (ms.datasets.folder("beam_hammer") / "beam_hammer.uff").read_bytes()
    assert Path(file["path"]).is_relative_to(server.store.files.place)
    server.ask("POST", f"/api/documents/{key}/close", {})
    assert server.ask("POST", "/api/open", {"files": ["example:../../secret"]}, status=400)["found"]


@pytest.mark.slow
def test_a_table_of_points_among_the_files_is_their_geometry(server: Served, folder: Path) -> None:
    ms.write(folder / "labels.npz", replace(ms.read(folder / "plain.npz"), output_dofs=("P1", "P2", "P3", "P4")))
    (folder / "points.csv").write_text("node,x,y,z\n" + "".join(f"{k},{k},0,0\n" for k in (1, 2, 3, 4)))
    (folder / "lines.csv").write_text("1,2\n2,4\n")
    opened = server.ask("POST", "/api/open", {"files": ["lines.csv", "points.csv", "labels.npz"]})
    (file,) = opened["document"]["files"]
    assert [Path(name).name for name in file["reading"]["geometry"]] == ["points.csv", "lines.csv"]
    server.act(opened["key"], "set", orders=FEW)
    server.settled(opened["key"])
    assert server.modes(opened["key"])["nodes"] == ["1", "2", "3", "4"]


def test_a_document_reads_no_geometry_outside_of_the_folder(server: Served, folder: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret.csv"
    secret.write_text("node,x,y,z\n1,1,0,0\n")
    kept = json.loads((folder / "plain.analysis.json").read_text())
    kept["analysis"]["files"][0]["reading"] = {"geometry": str(secret)}
    (folder / "bad.analysis.json").write_text(json.dumps(kept))
    told = server.ask("POST", "/api/open", {"files": ["bad.analysis.json"]}, status=400)
    assert "its geometry, secret.csv" in told["found"]


def test_an_upload_too_large_is_refused_before_and_while_it_comes(server: Served) -> None:
    status, _, answer = server.request("POST", "/api/upload?name=a.uff", b"x" * (SMALL + 1))
    assert (status, b"more than" in answer) == (400, True)
    assert server.request("POST", f"/api/documents/{'a' * 16}/act", b"x" * (2 << 20))[0] == 400


@pytest.mark.slow
def test_two_jobs_run_at_once_and_one_is_stopped(server: Served) -> None:
    first, second = server.open("plain.npz"), server.open("chain.uff")
    server.act(second, "set", orders=FEW)
    until(lambda: server.state(first)["stage"]["stage"] != "waiting")
    server.request("POST", f"/api/documents/{first}/cancel", {})
    assert server.settled(first)["stage"]["stage"] in ("stopped", "done")  # .3 s on an idle machine
    assert server.settled(second)["stage"]["stage"] == "done"


@pytest.mark.slow
def test_a_process_that_is_killed_says_so_and_the_document_stays(server: Served, key: str) -> None:
    before = server.settled(key)
    server.store.find(key)._worker.process.kill()
    failed = until(lambda: server.state(key)["failed"])
    assert "its process ended" in failed["found"]
    assert server.state(key)["document"] == before["document"]
    server.act(key, "again")
    assert server.settled(key)["stage"]["stage"] == "done"
    assert server.modes(key)["modes"]


def test_a_change_in_another_window_is_told(server: Served, key: str) -> None:
    seen = server.state(key)["edition"]
    server.act(key, "name", edition=seen, frequency=1.0, name="first")
    told = server.act(key, "set", edition=seen, status=409, orders=[2, 4])
    assert "another window" in told["found"]
    assert server.state(key)["document"]["orders"] == FEW


def test_eight_windows_ask_at_once(server: Served, key: str) -> None:
    with ThreadPoolExecutor(8) as windows:
        ask = lambda k: server.request("GET", f"/api/documents/{key}/channel?output={k % 4}&input=0")[0]  # noqa: E731
        assert set(windows.map(ask, range(16))) == {200}


@pytest.mark.parametrize("query", ["output=99&input=0", "output=-1&input=0", "output=a", "output=1"])
def test_a_channel_that_is_not_there_is_said(server: Served, key: str, query: str) -> None:
    assert server.request("GET", f"/api/documents/{key}/channel?{query}")[0] == 400


@pytest.mark.slow
def test_a_server_that_starts_again_has_the_documents_and_refuses_a_changed_file(folder: Path, tmp_path: Path) -> None:
    name = "again.npz"
    (folder / name).write_bytes((folder / "plain.npz").read_bytes())
    with served(folder, tmp_path, Limits(spare=False)) as first:
        key = first.open(name)
        first.act(key, "set", orders=FEW)
        first.act(key, "name", frequency=1.0, name="first")
        cookie = first.cookie
    with served(folder, tmp_path, Limits(spare=False)) as second:
        assert second.request("GET", "/api/start", Cookie=cookie)[0] == 401
        assert [d["name"] for d in second.ask("GET", "/api/start")["documents"]] == [name]
        state = second.settled(key)
        assert (state["document"]["orders"], state["undo"]) == (FEW, True)
        assert state["stage"]["stage"] == "done"
        (folder / name).write_bytes((folder / "hostile.npz").read_bytes())
        second.store.find(key).rest()
        second.act(key, "again")
        assert "hash differs" in second.settled(key)["failed"]["found"]
        second.ask("POST", f"/api/documents/{key}/close")
        assert second.ask("GET", f"/api/documents/{key}", status=400)["found"]
    (folder / name).unlink()


def test_what_to_measure_next_is_answered_a_line_each_and_a_wish_that_cannot_be_read_is_said(
    server: Served, key: str
) -> None:
    at = f"/api/documents/{key}/planned"
    lines = server.ask("POST", at, {"ask": "damping 90 %"})
    assert lines[:2] == ["Asked: damping ±90 % (95 %).", "All of it is reached: stop here."]
    assert "cannot be read" in server.ask("POST", at, {"ask": "dmping 5 %"}, status=400)["found"]
    assert "cannot be read" in server.ask("POST", at, {}, status=400)["found"]
