"""Errors name the arguments of Python to who calls Python, and the options of the terminal to who types them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.numerics.errors import DataError, in_python


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
        ("start `modalscope app --folder` there", "start `modalscope app --folder` there"),
        ("give one, or one each; a -- b, x--y, 1e-3", "give one, or one each; a -- b, x--y, 1e-3"),
    ],
)
def test_options_of_the_terminal_are_arguments_of_python(terminal: str, python: str) -> None:
    assert in_python(terminal) == python
    error = DataError("a file was asked", "it is damaged", terminal)
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
