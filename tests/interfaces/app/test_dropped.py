"""What was dropped on the page goes with its document, with time, when there is too much of it, and when that is asked."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from modalscope.interfaces.app.guard import Limits
from modalscope.interfaces.app.processes import ProcessPool, WorkerProcess
from modalscope.interfaces.cli import main
from tests.interfaces.app.server import SMALL, Served, served, until

DAY = 86400


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "place"


@pytest.fixture
def fresh(folder: Path, place: Path) -> Iterator[Served]:
    with served(folder, place, Limits(upload=SMALL, uploads=100_000, spare=False)) as made:
        yield made


def dropped(server: Served, content: bytes, name: str = "a.npz") -> str:
    code, _, answer = server.request("POST", f"/api/upload?name={name}", content)
    assert code == 200, answer
    return str(answer.decode().split('"')[3])


def stored(place: Path) -> int:
    return len(list((place / "uploads").iterdir()))


def test_an_upload_is_deleted_with_the_last_document_that_names_it(fresh: Served, folder: Path, place: Path) -> None:
    data = dropped(fresh, (folder / "plain.npz").read_bytes())
    points = dropped(fresh, b"node,x,y,z\n1,1,0,0\n2,2,0,0\n", "points.csv")
    first, second = fresh.open(data), fresh.open(data)
    fresh.act(first, "geometry", files=[points])
    fresh.act(first, "geometry", files=[])  # a step that can be undone names it still
    other = dropped(fresh, b"x")
    fresh.ask("POST", f"/api/documents/{second}/close", {})
    assert stored(place) == 3
    fresh.ask("POST", f"/api/documents/{first}/close", {})
    assert [folder.name for folder in (place / "uploads").iterdir()] == [other.split(":")[1].split("/")[0]]
    assert (folder / "plain.npz").is_file()


def test_files_of_the_folder_stay_when_their_document_is_closed(fresh: Served, folder: Path) -> None:
    fresh.ask("POST", f"/api/documents/{fresh.open('plain.npz')}/close", {})
    assert (folder / "plain.npz").is_file()


@pytest.mark.parametrize(("days", "left"), [(29.9, 2), (30.1, 0)])
def test_uploads_are_kept_thirty_days(fresh: Served, folder: Path, place: Path, days: float, left: int) -> None:
    used = fresh.open(dropped(fresh, (folder / "plain.npz").read_bytes()))
    dropped(fresh, b"never opened")
    of_folder = fresh.open("plain.npz")
    for path in (*place.glob("documents/*"), *place.glob("uploads/*")):
        os.utime(path, (time.time() - days * DAY,) * 2)
    fresh.store.age()
    assert stored(place) == left
    assert (place / "documents" / f"{used}.json").exists() is bool(left)
    assert (place / "documents" / f"{of_folder}.json").exists()


def test_an_old_upload_stays_while_its_document_changes(fresh: Served, folder: Path, place: Path) -> None:
    fresh.open(dropped(fresh, (folder / "plain.npz").read_bytes()))
    for path in place.glob("uploads/*"):
        os.utime(path, (0, 0))
    fresh.store.age()
    assert stored(place) == 1


def test_the_number_of_uploads_is_bounded(folder: Path, place: Path) -> None:
    with served(folder, place, Limits(upload=SMALL, files=2, spare=False)) as made:
        for _ in range(2):
            dropped(made, b"x")
        code, _, answer = made.request("POST", "/api/upload?name=b.npz", b"x")
        assert code == 400
        assert b"more than 2 files together" in answer


def test_an_upload_on_a_full_disk_is_said_and_leaves_nothing(
    fresh: Served, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = Path.open

    def full(path: Path, mode: str = "r", *rest: Any) -> Any:
        if mode != "xb":
            return plain(path, mode, *rest)
        path.touch()
        return plain(Path("/dev/full"), "wb", buffering=0)

    monkeypatch.setattr(Path, "open", full)
    code, _, answer = fresh.request("POST", "/api/upload?name=b.npz", b"x" * 5000)
    assert code == 507
    assert b"no space left on device" in answer
    assert (stored(place), fresh.store.files.total) == (0, 0)


def test_all_uploads_together_are_bounded(fresh: Served, place: Path) -> None:
    dropped(fresh, b"x" * 60_000)
    code, _, answer = fresh.request("POST", "/api/upload?name=b.npz", b"x" * 40_001)
    assert code == 400
    assert b"Delete recent documents" in answer
    assert stored(place) == 1
    dropped(fresh, b"x" * 40_000)  # what was refused takes no room
    assert fresh.store.files.total == 100_000


def test_forget_deletes_documents_and_uploads_alone(
    fresh: Served, folder: Path, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fresh.open(dropped(fresh, (folder / "plain.npz").read_bytes()))
    dropped(fresh, b"never opened")
    monkeypatch.setenv("MODALSCOPE_PAGE", str(place))
    (place / "mine.txt").write_text("not the page's")
    assert main(["app", "--forget"]) == 0
    assert "1 documents and 2 dropped files" in capsys.readouterr().out
    assert sorted(path.name for path in place.rglob("*")) == ["documents", "mine.txt", "uploads"]


def test_the_address_of_the_browser_admits_once(fresh: Served) -> None:
    from modalscope.interfaces.app import serve

    page = serve.Page(fresh.guard, None, fresh.address, fresh.store)  # type: ignore[arg-type]
    once = page.address_once()
    token = fresh.address.partition("token=")[2]
    assert token not in once
    path = once.removeprefix(fresh.base)
    entered, headers, _ = fresh.request("GET", path, Cookie="", Origin="")
    assert entered in (200, 404, 500)  # without a built front end there is no page
    assert "set-cookie" in headers
    assert fresh.request("GET", path, Cookie="", Origin="")[0] == 401
    assert fresh.request("GET", f"/?token={token}", Cookie="", Origin="")[0] != 401


def test_the_browser_is_started_with_that_address(
    folder: Path, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("uvicorn", reason="the extra `app` is not installed")
    shown: list[str] = []
    monkeypatch.setattr("modalscope.interfaces.app.serve.check_front_end", lambda: None)
    monkeypatch.setenv("MODALSCOPE_PAGE", str(place))
    monkeypatch.setattr("webbrowser.open", shown.append)
    monkeypatch.setattr("modalscope.interfaces.app.serve.serve", lambda page: page.socket.close())
    assert main(["app", "--folder", str(folder)]) == 0
    printed = capsys.readouterr().out.split("the page: ")[1].split()[0]
    assert shown[0].partition("=")[0] == printed.partition("=")[0]
    assert shown[0].partition("=")[2] != printed.partition("=")[2]


@pytest.mark.slow
def test_again_works_at_once_after_all_processes_died(folder: Path, place: Path) -> None:
    with served(folder, place, Limits(upload=SMALL, workers=2)) as server:
        key = server.open("plain.analysis.json")
        server.settled(key)
        until(lambda: server.store.pool._warm)
        for worker in (server.store.find(key)._worker, server.store.pool._warm):
            worker.process.kill()
        until(lambda: server.state(key)["failed"])
        server.act(key, "again")
        assert server.settled(key)["stage"]["stage"] == "done"


def test_a_dead_process_is_no_spare() -> None:
    async def story() -> Any:
        pool = ProcessPool(2)
        pool.warm_up()
        spare = pool._warm
        assert spare is not None
        spare.process.kill()
        spare.process.join()
        taken = pool.take(None)  # type: ignore[arg-type]
        found = isinstance(taken, WorkerProcess) and taken is not spare and taken.alive
        pool.close()
        until(lambda: spare._pipe.closed)  # by who reads it, which ends with the process
        return found

    assert asyncio.run(story())
