"""A measurement is never overwritten, and the command line replaces what modalscope wrote, and nothing else unasked."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.interfaces.reporting import report
from modalscope.io.atomic import is_ours
from tests.support import refused

RESULT = ms.analyze(ms.systems.chain5().impulse_response(200, noise=0.01, seed=0), orders=range(2, 15, 2))
#: What an output is replaced by is no matter of how many orders were tried.
QUICK = ["--orders", "6:14:2", "--no-refine"]

FORMATS = [".uff", ".unv", ".csv", ".npz", ".mat", ".h5", ".json", ".html"]


def written(folder: Path, suffix: str) -> Path:
    """Return a file that modalscope wrote: the modes of a chain, or a report on them."""
    path = folder / f"ours{suffix}"
    if suffix == ".html":
        return report(RESULT, path)
    ms.write(path, RESULT)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_carries_its_mark_and_a_file_of_others_does_not(tmp_path, suffix, test_file):
    assert is_ours(written(tmp_path, suffix))
    assert not is_ours(shutil.copy(test_file, tmp_path / "other.png"))
    foreign = tmp_path / f"foreign{suffix}"
    foreign.write_text("# notes on modalscope 0.1.0: bought a sensor\n")
    assert not is_ours(foreign)
    ours = tmp_path / f"again{suffix}"
    shutil.copy(written(tmp_path, suffix), ours)
    if suffix != ".html":
        assert main(["convert", str(test_file), str(ours)]) == (2 if suffix == ".json" else 0)  # JSON holds modes alone


@pytest.mark.parametrize("make", [lambda a, b: shutil.copy(a, b), os.link, os.symlink])
@pytest.mark.parametrize("command", ["identify", "compare", "convert"])
def test_an_output_that_is_the_input_by_whatever_name_is_an_error(tmp_path, test_file, command, make, capsys):
    before, other = test_file.read_bytes(), tmp_path / "other.uff"
    make(test_file, other)
    names = [test_file] if make not in (os.link, os.symlink) else [other]
    for name in names:
        words = [str(test_file), str(name)] if command == "convert" else [str(test_file), "-o", str(name)]
        assert main([command, *words, "--force"]) == 2
        assert "never overwritten" in capsys.readouterr().err
    assert test_file.read_bytes() == before


@pytest.mark.slow
def test_a_foreign_file_is_replaced_only_when_that_is_said(tmp_path, test_file, capsys):
    target = tmp_path / "modes.csv"
    target.write_text("my,own,notes\n")
    words = ["identify", str(test_file), *QUICK, "-o", str(target)]
    assert main(words) == 2
    assert "modalscope did not write it" in capsys.readouterr().err
    assert target.read_text() == "my,own,notes\n"
    assert main([*words, "--force"]) == 0
    assert is_ours(target)
    assert main(words) == 0
    target.write_bytes(b"")  # there is nothing in it to lose
    assert main(words) == 0


def test_data_are_not_written_over_the_file_that_they_came_from(tmp_path, test_file, monkeypatch):
    """Whatever was done with them in between, and wherever the program stands by now."""
    monkeypatch.chdir(tmp_path)
    data = ms.read(test_file.name)
    result = ms.analyze(test_file.name, orders=[10], refine=False)
    (tmp_path / "deeper").mkdir()
    monkeypatch.chdir(tmp_path / "deeper")
    page = tmp_path / "page.html"
    os.link(test_file, page)
    for thing in (data, data.select(outputs=[0, 1]), result.modes, result):
        refused("never overwritten", ms.write, test_file, thing)
    refused("never overwritten", report, result, page)
    refused("never overwritten", report, result.diagram, page)
    diagram = tmp_path / "diagram.npz"
    ms.write(diagram, result.diagram)
    refused("never overwritten", ms.write, diagram, ms.read(diagram))
    ms.write(test_file, replace(data, source_path=None))  # said on purpose


def test_a_pipe_or_a_device_is_no_output(tmp_path, test_file, capsys):
    pipe, device = tmp_path / "pipe.csv", tmp_path / "device.csv"
    os.mkfifo(pipe)
    device.symlink_to(os.devnull)
    for target in (pipe, device):
        assert main(["identify", str(test_file), "-o", str(target)]) == 2
        assert "a pipe or a device" in capsys.readouterr().err


@pytest.mark.slow
def test_what_of_a_file_was_left_is_said_by_every_command(tmp_path, capsys):
    """One damaged digit: a direction that was 1:+X is 7:+X, and the 4 x 2 matrix lacks a pair."""
    good, bad = tmp_path / "good.uff", tmp_path / "bad.uff"
    data = ms.systems.chain5().frequency_response([0.5 + 0.01 * k for k in range(500)], noise=0.01, seed=0)
    ms.write(good, data, text=True)
    lines = good.read_text().splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if line.startswith("    4"))
    dof = lines[first]
    lines[first] = dof[:50] + "7" + dof[51:] if dof[50] != "7" else dof[:50] + "8" + dof[51:]
    bad.write_text("".join(lines))
    said = "largest complete block"
    commands = {
        "identify": ["identify", str(bad), *QUICK, "-o", str(tmp_path / "m.json")],
        "identify to a page": ["identify", str(bad), *QUICK, "-o", str(tmp_path / "m.html")],
        "compare": ["compare", str(bad), "--methods", "era/z", "--orders", "6:14:2", "-o", str(tmp_path / "c.html")],
        "convert": ["convert", str(bad), str(tmp_path / "c.npz")],
        "info": ["info", str(bad)],
    }
    for name, words in commands.items():
        assert main(words) == 0
        assert said in capsys.readouterr().out, name
    assert main(["identify", str(good), *QUICK, "-o", str(tmp_path / "g.json")]) == 0
    assert said not in capsys.readouterr().out
    assert any(note.kind == "file" for note in ms.analyze(bad, orders=[8, 10], refine=False).notes)
    assert all(said in (tmp_path / name).read_text() for name in ("m.json", "m.html", "c.html"))
