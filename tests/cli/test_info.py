"""modalscope info: what was taken, and how good it is."""

from __future__ import annotations

import modalscope as ms
from modalscope.cli import main


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
