"""Whatever is wrong with the input or the options: one line on stderr, exit status 2, and no file left behind."""

from __future__ import annotations

import pickle
import struct
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main

RNG = np.random.default_rng(0)
LINES = np.linspace(1.0, 20.0, 60)


def response() -> np.ndarray:
    return ms.systems.chain5().frequency_response(LINES, quantity="acceleration").values


def npz(**arrays: object):
    def write(folder: Path) -> Path:
        path = folder / "data.npz"
        np.savez(path, **{"frequencies": LINES, "values": response(), "quantity": "acceleration", **arrays})
        return path

    return write


def only(**arrays: object):
    def write(folder: Path) -> Path:
        path = folder / "data.npz"
        np.savez(path, **arrays)
        return path

    return write


def spoilt(index: tuple[int, ...], value: complex) -> np.ndarray:
    values = response()
    values = np.array(values)
    values[index] = value
    return values


def pickled(folder: Path) -> Path:
    path = folder / "data.npz"
    np.savez(path, frequencies=LINES, values=np.array([{"a": 1}, None], dtype=object), allow_pickle=True)
    return path


def raw_pickle(folder: Path) -> Path:
    path = folder / "data.npz"
    path.write_bytes(pickle.dumps({"frequencies": [1, 2]}))
    return path


def text_as_uff(folder: Path) -> Path:
    path = folder / "notes.uff"
    path.write_text("Shopping list:\nmilk\n")
    return path


def empty_uff(folder: Path) -> Path:
    path = folder / "empty.uff"
    path.write_bytes(b"")
    return path


def good_uff(folder: Path) -> Path:
    path = folder / "good.uff"
    ms.write(path, ms.FrequencyResponse(values=response(), frequencies=LINES, quantity="acceleration"))
    return path


def wrong_endian(folder: Path) -> Path:
    path = good_uff(folder)
    raw = path.read_bytes()
    at = raw.index(b"58b     1")
    path.write_bytes(raw[:at] + b"58b     2" + raw[at + 9 :])
    return path


def nan_in_uff(folder: Path) -> Path:
    path = good_uff(folder)
    raw = bytearray(path.read_bytes())
    at = raw.index(b"58b")
    for _ in range(12):  # the line of the dataset's number and eleven lines of header
        at = raw.index(b"\n", at) + 1
    raw[at : at + 8] = struct.pack("<d", float("nan"))
    path.write_bytes(bytes(raw))
    return path


def cut_uff(folder: Path) -> Path:
    path = good_uff(folder)
    path.write_bytes(path.read_bytes()[:-200])
    return path


def folder_itself(folder: Path) -> Path:
    return folder


def missing(folder: Path) -> Path:
    return folder / "missing.uff"


def unknown_suffix(folder: Path) -> Path:
    path = folder / "data.xyz"
    path.write_text("1 2 3")
    return path


CASES = {
    "NaN": (npz(values=spoilt((3, 0, 0), np.nan)), [], "NaN or infinite"),
    "infinite": (npz(values=spoilt((3, 0, 0), np.inf)), [], "NaN or infinite"),
    "transposed axes": (npz(values=response().transpose(1, 2, 0)), [], "Lines come first"),
    "two axes": (npz(values=response()[:, :, 0]), [], "axes"),
    "empty": (npz(values=np.zeros((0, 4, 2), complex), frequencies=np.zeros(0)), [], "at least one line"),
    "one sample": (only(sampling_rate=10.0, values=np.ones((1, 2, 1))), [], "two samples"),
    "order too large": (
        only(sampling_rate=10.0, values=RNG.standard_normal((12, 2, 1))),
        ["--orders", "50:60:2"],
        "50",
    ),
    "all-zero channel": (npz(values=response() * np.array([1, 0, 1, 1])[:, None]), [], "--exclude y2"),
    "labels twice": (npz(output_dofs=np.array(["1:+Z", "1:+Z", "2:+Z", "3:+Z"])), [], "are repeated"),
    "descending lines": (npz(frequencies=LINES[::-1], values=response()[::-1]), [], "increas"),
    "repeated line": (npz(frequencies=np.r_[LINES[:-1], LINES[-2]]), [], "increas"),
    "uneven lines to samples": (npz(frequencies=LINES**1.1), ["--domain", "time"], "equally spaced"),
    "magnitudes": (npz(values=np.abs(response())), [], "magnitudes"),
    "missing file": (missing, [], "no such file"),
    "folder": (folder_itself, [], "folder"),
    "text named .uff": (text_as_uff, [], "notes.uff"),
    "empty .uff": (empty_uff, [], "empty.uff"),
    "wrong-endian flag": (wrong_endian, [], "good.uff"),
    "NaN in a file": (nan_in_uff, [], "NaN"),
    "file cut short": (cut_uff, [], "good.uff"),
    "pickle in .npz": (pickled, [], "data.npz"),
    "pickle named .npz": (raw_pickle, [], "data.npz"),
    "unknown array": (npz(secret=np.ones(3)), [], "secret"),
    "unknown suffix": (unknown_suffix, [], ".xyz"),
    "unknown method": (npz(), ["--method", "eraa"], "Did you mean 'era'"),
    "unknown domain": (npz(), ["--domain", "frequency"], "time, z, s"),
    "band without lines": (npz(), ["--band", "40", "50"], "none of them inside"),
    "band upside down": (npz(), ["--band", "9", "2"], "lower end first"),
    "unknown channel": (npz(), ["--exclude", "nobody"], "nobody"),
    "no channel left": (npz(), ["--exclude", "y1", "y2", "y3", "y4"], "at least one output"),
    "orders upside down": (npz(), ["--orders", "20:2"], "FIRST:LAST:STEP"),
    "orders in words": (npz(), ["--orders", "many"], "FIRST:LAST:STEP"),
    "delays in words": (npz(), ["--delays", "y1=soon"], "DOF=SAMPLES"),
    "delays of no record with inputs": (npz(), ["--delays", "y1=3"], "delays={'y1': 3}"),
    "unknown quantity": (npz(), ["--quantity", "speed"], "displacement, velocity, acceleration"),
    "no mode there": (npz(), ["--frequencies", "15.5"], "a mode at 15.5 Hz"),
    "s-domain of a sampled system": (npz(sampling_rate=50.0), ["--domain", "s"], "sampled at 50 Hz"),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("output", ["modes.json", "report.html"])
def test_bad_input_is_answered_in_one_line_with_status_2_and_no_file(case, output, tmp_path, capsys):
    make, options, words = CASES[case]
    source = make(tmp_path)
    (tmp_path / "out").mkdir()
    status = main(["identify", str(source), *options, "-o", str(tmp_path / "out" / output)])
    said = capsys.readouterr().err
    assert status == 2
    assert said.count("\n") == 1
    assert said.startswith("modalscope: ")
    # the fault, what there is, what to change
    assert ": " in said.removeprefix("modalscope: ") or ", but " in said
    assert words in said
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("output", ["modes.xyz", "no/such/folder/modes.json", "."])
def test_an_output_that_cannot_be_written_is_refused_before_the_work(output, tmp_path, capsys):
    source = npz()(tmp_path)
    assert main(["identify", str(source), "-o", str(tmp_path / output)]) == 2
    assert "modalscope: writing " in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["identify"], ["identify", "a", "--band", "1"], ["nonsense"], ["identify", "a", "--wrong"]]
)
def test_wrong_use_ends_with_status_2_and_one_line(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_report_cut_short_does_not_replace_an_earlier_one(tmp_path, monkeypatch, capsys):
    source, target = npz()(tmp_path), tmp_path / "report.html"
    target.write_text("the good one")

    def fails(*_: object, **__: object) -> str:
        raise ms.DataError("a page:", "it fails", "Nothing.")

    monkeypatch.setattr("modalscope.interfaces.reporting.document.page", fails)
    assert main(["identify", str(source), "-o", str(target)]) == 2
    assert target.read_text() == "the good one"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["data.npz", "report.html"]
