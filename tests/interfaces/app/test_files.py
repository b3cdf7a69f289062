"""Only the folder that was given is seen, and uploads leave nothing where they fail."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from modalscope.data import DataError
from modalscope.interfaces.app.files import FileStore
from modalscope.io.formats import FORMATS
from modalscope.io.options import MESHES
from tests.support import refused


@pytest.fixture
def shelf(tmp_path: Path) -> FileStore:
    inside = tmp_path / "inside"
    (inside / "deeper").mkdir(parents=True)
    (inside / "a.uff").write_text("x")
    (inside / "deeper" / "b.csv").write_text("x")
    (inside / ".hidden.csv").write_text("x")
    (inside / "notes.docx").write_text("x")
    (tmp_path / "secret.csv").write_text("x")
    (inside / "link.csv").symlink_to(tmp_path / "secret.csv")
    return FileStore(inside, tmp_path / "place")


def test_data_of_the_folder_are_listed(shelf: FileStore) -> None:
    assert {entry["name"] for entry in shelf.listing()} == {"a.uff", "deeper/b.csv", "link.csv"}
    assert shelf.resolve("deeper/b.csv").name == "b.csv"


@pytest.mark.parametrize(
    "name",
    [
        "../secret.csv",
        "/etc/passwd",
        "link.csv",
        "deeper/../../secret.csv",
        "a\0b",
        "upload:../x",
        "upload:/etc/passwd",
    ],
)
def test_what_leads_outside_is_refused(shelf: FileStore, name: str) -> None:
    refused("outside", shelf.resolve, name)


@pytest.mark.parametrize("name", ["none.uff", "deeper", "upload:none/x"])
def test_what_is_not_there_is_said(shelf: FileStore, name: str) -> None:
    refused("no such file", shelf.resolve, name)


async def pieces(*parts: bytes, broken: bool = False) -> AsyncIterator[bytes]:
    for part in parts:
        yield part
    if broken:
        raise ConnectionError


def test_an_upload_is_a_file_by_its_own_name(shelf: FileStore) -> None:
    name = asyncio.run(shelf.store_upload("../../x.csv", pieces(b"1", b"2"), 10))
    assert shelf.resolve(name).read_bytes() == b"12"
    assert shelf.resolve(name).name == "x.csv"


def test_one_too_large_or_broken_off_leaves_nothing(shelf: FileStore) -> None:
    with pytest.raises(DataError, match="more than"):
        asyncio.run(shelf.store_upload("x.csv", pieces(b"123", b"456"), 5))
    with pytest.raises(ConnectionError):
        asyncio.run(shelf.store_upload("x.csv", pieces(b"123", broken=True), 5))
    assert not list((shelf.place / "uploads").iterdir())


def test_every_format_of_measurements_is_listed(tmp_path: Path) -> None:
    suffixes = {suffix for suffix, row in FORMATS.items() if not row.folder} - set(MESHES) - {".json"}
    for suffix in suffixes:
        (tmp_path / f"a{suffix}").write_bytes(b"")
    listed = FileStore(tmp_path, tmp_path / ".place").listing()
    assert {Path(str(entry["name"])).suffix for entry in listed} == suffixes


def test_names_of_uploads_fit_the_file_system_in_any_script(shelf: FileStore) -> None:
    async def once() -> AsyncIterator[bytes]:
        yield b"x"

    for letter in ("a", "é", "测"):
        name = asyncio.run(shelf.store_upload(200 * letter + ".uff", once(), 10))
        assert name.endswith(f"{letter}.uff")
        assert shelf.resolve(name).read_bytes() == b"x"
