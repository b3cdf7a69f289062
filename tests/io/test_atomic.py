"""A write that fails or is stopped leaves what was there before, and nothing else."""

import stat

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.io import atomic
from tests.io import samples
from tests.support import refused


def test_a_failed_write_keeps_the_earlier_file(tmp_path, monkeypatch):
    target = tmp_path / "a.npz"
    mio.write(target, samples.records())
    before = target.read_bytes()

    def broken(file, **arrays):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", broken)
    refused("no space left", mio.write, target, samples.records())
    assert target.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_an_interrupted_write_leaves_nothing(tmp_path):
    def interrupted():
        with atomic.replacing(tmp_path / "a.csv") as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_places_that_cannot_be_written(tmp_path):
    refused("no such file or directory", mio.write, tmp_path / "none" / "a.npz", samples.records())
    (tmp_path / "a.npz").mkdir()
    refused("that is a folder", mio.write, tmp_path / "a.npz", samples.records())
    (tmp_path / "file").touch()
    refused("the system refuses", mio.write, tmp_path / "file" / "a.npz", samples.records())


def test_new_files_have_ordinary_rights(tmp_path):
    (tmp_path / "plain").touch()
    mio.write(tmp_path / "a.npz", samples.records())
    assert (tmp_path / "a.npz").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_replaced_file_keeps_its_rights_and_a_link_stays_a_link(tmp_path):
    real, link = tmp_path / "real.npz", tmp_path / "link.npz"
    real.touch(mode=0o640)
    real.chmod(0o640)
    link.symlink_to(real.name)
    mio.write(link, samples.records())
    assert link.is_symlink()
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert mio.read(real).samples == samples.records().samples


def test_the_longest_name_that_a_system_holds_is_written_and_a_longer_one_refused(tmp_path):
    longest = tmp_path / ("é" * 125 + ".npz")
    mio.write(longest, samples.records())
    assert longest.exists()
    refused("name too long", mio.write, tmp_path / ("a" * 300 + ".npz"), samples.records())
    refused("a NUL", mio.write, f"{tmp_path}/a\0.npz", samples.records())


def test_the_name_of_a_temporary_file_is_known_while_there_is_one(tmp_path):
    with atomic.replacing(tmp_path / "a.csv") as temporary:
        assert temporary in atomic.PENDING
    assert not atomic.PENDING
