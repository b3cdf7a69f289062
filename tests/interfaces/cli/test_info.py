"""modalscope info: what was taken, and how good it is."""

from __future__ import annotations

import numpy as np

import modalscope as ms
from modalscope.interfaces.cli import main


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
