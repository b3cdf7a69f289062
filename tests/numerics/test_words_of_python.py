"""Errors name the arguments of Python to who calls Python, and the options of the terminal to who types them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
import modalscope.io as mio
from modalscope.interfaces.cli import main
from modalscope.numerics.errors import DataError, in_python
from modalscope.systems import chain5


@pytest.mark.parametrize(
    ("terminal", "python"),
    [
        ("leave it out: --ignore 4 'b c'", "leave it out: ignore=[4, 'b c']"),
        ("--ignore 'x' --ignore 'y', or --rows 1-40.", "ignore=['x', 'y'], or rows='1-40'."),
        ('say so: --columns "time=1,out=2-3" --sampling-rate HZ', "say so: columns='time=1,out=2-3', sampling_rate=HZ"),
        ('--units "Acc=100 mV/g,F=lbf"', "units={'Acc': '100 mV/g', 'F': 'lbf'}"),
        ("--rename y=outputs --rename u=inputs", "rename={'y': 'outputs', 'u': 'inputs'}"),
        ("--axes inputs=samples,runs --transpose", "axes={'inputs': 'samples runs'}, transpose=True"),
        ("--band 2 12.5, or --band LOW HIGH", "band=(2, 12.5), or band=(LOW, HIGH)"),
        ("--delays y3=12; --no-reciprocal", "delays={'y3': 12}; reciprocal=False"),
        ("--exclude 3 4", "exclude=['3', '4']"),
        ('--test "run 1" of a.mat', "sheet='run 1' of a.mat"),
        ("raise it: --max-memory, or modalscope.io.set_max_memory.", "raise it: modalscope.io.set_max_memory."),
        ("raise it: --max-memory 17GB", "raise it: modalscope.io.set_max_memory(17 * 10**9)"),
        ("start `modalscope app --folder` there", "start `modalscope app --folder` there"),
        ("give one, or one each; a -- b, x--y, 1e-3", "give one, or one each; a -- b, x--y, 1e-3"),
    ],
)
def test_options_of_the_terminal_are_arguments_of_python(terminal: str, python: str) -> None:
    assert in_python(terminal) == python
    error = DataError("a file:", "it is damaged", terminal)
    assert str(error) == f"a file: it is damaged.\n{python}"
    assert (error.args[0], error.change) == (f"a file: it is damaged.\n{terminal}", terminal)


def test_an_error_of_reading_is_obeyed_in_python_and_on_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join(f"{k % 7},{k % 5 - 2}" for k in range(300)))
    with pytest.raises(ms.DataError, match="sampling_rate=HZ") as error:
        ms.read(path)
    assert not re.search(r"--[a-z]", str(error.value))
    assert ms.read(path, sampling_rate=10.0).samples == 300
    assert main(["info", str(path)]) == 2
    assert "--sampling-rate HZ" in capsys.readouterr().err


def test_what_a_file_and_its_data_say_has_the_words_of_who_reads_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,a,b,c\n" + "\n".join(f"{0.1 * k:.1f},{k % 7},{k % 5 - 2},1" for k in range(300)))
    survey = mio.survey(path)
    (note,), findings = survey.told, ms.preprocess.examine(survey.thing)
    said = [*map(str, (survey, note, *findings)), repr(note)]
    assert "columns='in=" in said[0]
    assert "columns='in=" in said[1]
    assert any("exclude=['c']" in text for text in said)
    assert not any(re.search(r"--[a-z]", text) for text in said)
    assert '--columns "in=' in note.text
    assert main(["info", str(path)]) == 0
    told = capsys.readouterr().out
    assert '--columns "in=' in told
    assert "--exclude 'c'" in told
    assert "exclude=" not in told
    assert [*map(str, (survey, note, *findings)), repr(note)] == said


def test_a_report_has_the_words_of_who_writes_it(tmp_path: Path) -> None:
    path, page = tmp_path / "a.npz", tmp_path / "a.html"
    lines = chain5().frequency_response(np.linspace(0.05, 4.0, 200), noise=0.01, seed=1)
    ms.write(path, lines.select(outputs=lines.output_dofs[:1]))
    ms.report(ms.analyze(path, orders=[6, 8]), page)
    assert "(else: reciprocal=False)" in page.read_text()
    assert main(["identify", str(path), "--orders", "6:8:2", "-q", "-o", str(page)]) == 0
    assert "(else: --no-reciprocal)" in page.read_text()
