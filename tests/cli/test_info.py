"""modalscope info: what was taken, and how good it is."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.cli import files, main


def test_info_tells_what_was_taken_and_how_good_it_is(test_file, capsys):
    assert main(["info", str(test_file)]) == 0
    said = capsys.readouterr().out
    assert "frequency responses" in said
    assert "quality" in said


def test_info_on_a_file_of_geometry_tells_its_nodes(tmp_path, capsys):
    path = tmp_path / "geometry.uff"
    ms.write(path, ms.systems.chain5().geometry)
    assert main(["info", str(path)]) == 0
    assert "nodes" in capsys.readouterr().out


def _record(path, outputs, labels):
    ms.write(path, ms.Signals(outputs=outputs, sampling_rate=100.0, output_dofs=labels))
    return str(path)


def test_info_on_several_files_tells_what_they_are_together(tmp_path, capsys):
    rng = np.random.default_rng(1)
    first = _record(tmp_path / "a.npz", rng.standard_normal((3000, 2)), ("1:+Z", "2:+Z"))
    again = _record(tmp_path / "b.npz", rng.standard_normal((3000, 2)), ("1:+Z", "2:+Z"))
    moved = _record(tmp_path / "c.npz", rng.standard_normal((3000, 2)), ("1:+Z", "3:+Z"))
    assert main(["info", first, again]) == 0
    said = capsys.readouterr().out
    assert "a.npz: records: 3000 samples" in said
    assert "together: records: 2 runs of 3000 samples" in said
    assert main(["info", first, moved]) == 0
    assert "2 setups of 3000" in capsys.readouterr().out


@pytest.mark.parametrize(("least", "shown"), [(-1, 1), (1, 0)])
def test_of_large_files_progress_names_the_examination(
    least: int, shown: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "record.npz"
    np.savez(path, outputs=np.random.default_rng(0).standard_normal((200, 2)), sampling_rate=10.0)
    stages: list[str] = []

    def progress(what: str, unit: str) -> nullcontext[None]:
        stages.append(what)
        return nullcontext()

    monkeypatch.setattr(files, "progress", progress)
    monkeypatch.setattr(files, "_LARGE_FILES", path.stat().st_size + least)  # more than so many bytes
    assert main(["info", str(path)]) == 0
    assert stages == ["examining"] * shown
