"""Tables below each other: channels of one test under heads of their own, or tests of which one is chosen and none is glued to another."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.io.contents import SeveralTests

_RNG = np.random.default_rng(0)
F = 0.5 * np.arange(1, 201)
T = np.arange(300) / 100
X = {name: _RNG.standard_normal((300, 2)) for name in ("tower", "bridge")}


def _response(k: int) -> np.ndarray:
    return np.asarray(1 / (1 - (F / 12) ** 2 + 0.04j * F / 12) + k / (1 - (F / 31) ** 2 + 0.03j * F / 31))


def _rows(*columns: np.ndarray, sep: str = "\t") -> str:
    return "".join(sep.join(f"{value:.6g}" for value in row) + "\n" for row in zip(*columns, strict=True))


def _responses(head: str, axis: bool) -> str:
    return "".join(
        head.format(k=k) + _rows(*([F] if axis else []), _response(k).real, _response(k).imag) for k in (2, 3, 4)
    )


@pytest.mark.parametrize(
    ("head", "axis", "outputs", "into"),
    [
        (
            "Measurement {k}\nFunction: FRF\nPoint: {k}Z / 1Z\nFirst: 0.5\nDelta: 0.5\nUnit: (m/s2)/N\n",
            False,
            ("2:+Z", "3:+Z", "4:+Z"),
            "1:+Z",
        ),
        (
            "Function 1\nType: FRF\nResponse DOF = {k}Z\nReference DOF = 1Z\nFrequency [Hz]\tReal\tImag\n",
            True,
            ("2:+Z", "3:+Z", "4:+Z"),
            "1:+Z",
        ),
        ("Point {k}\nf (Hz)\tRe\tIm\n", True, ("2", "3", "4"), "u1"),
    ],
)
def test_responses_below_each_other_are_one_test(
    head: str, axis: bool, outputs: tuple[str, ...], into: str, tmp_path: Path
) -> None:
    (tmp_path / "a.txt").write_text(_responses(head, axis))
    found = ms.read(tmp_path / "a.txt")
    assert (found.output_dofs, found.input_dofs) == (outputs, (into,))
    np.testing.assert_allclose(found.frequencies, F)
    np.testing.assert_allclose(found.values[:, :, 0], np.stack([_response(k) for k in (2, 3, 4)], 1), rtol=1e-4)


def test_channels_below_each_other_are_one_record(tmp_path: Path) -> None:
    text = "".join(f"Channel: A{k}\nSampling rate: 100 Hz\nUnit: g\n" + _rows(X["tower"][:, k]) for k in (0, 1))
    (tmp_path / "a.csv").write_text(text)
    found = ms.read(tmp_path / "a.csv")
    assert (found.output_dofs, found.sampling_rate) == (("A0", "A1"), 100.0)
    np.testing.assert_allclose(found.outputs, X["tower"], atol=1e-5)


def _two_structures(path: Path, columns: int = 2) -> Path:
    head = (
        "Structure: {}\nDate: today\nTime (s)"
        + ",ab"[: columns + 1].replace("a", "a (g)").replace("b", ",b (g)")
        + "\n"
    )
    path.write_text("".join(head.format(name) + _rows(T, *x.T[:columns], sep=",") for name, x in X.items()))
    return path


@pytest.mark.parametrize("columns", [1, 2])
def test_two_structures_are_never_glued(columns: int, tmp_path: Path) -> None:
    path = _two_structures(tmp_path / "a.csv", columns)
    with pytest.raises(SeveralTests, match="Structure: tower, Structure: bridge") as error:
        ms.read(path)
    for name in error.value.names:  # what the message names is read
        np.testing.assert_allclose(ms.read(path, sheet=name).outputs, X[name.split()[-1]][:, :columns], atol=1e-5)
    with pytest.raises(ms.DataError, match="Name one of them"):
        ms.read(path, sheet="roof")


def test_info_lists_the_tests_of_a_file_and_takes_one_or_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(_two_structures(tmp_path / "a.csv"))
    assert main(["info", path]) == 0
    assert "a.csv: 2 tests\n  Structure: tower\n  Structure: bridge" in capsys.readouterr().out
    assert main(["info", path, "--test", "Structure: bridge"]) == 0
    assert "read gives records: 300 samples" in capsys.readouterr().out
    assert main(["info", path, "--each"]) == 0
    out = capsys.readouterr().out
    assert out.count("read gives records: 300 samples") == out.count("== a.csv, Structure: ") == 2


@pytest.mark.parametrize("head", ["time (s),a,b\n", "Logger 7\nSampling rate: 100 Hz\ntime (s),a,b\n"])
def test_a_head_that_a_logger_writes_again_begins_no_test(head: str, tmp_path: Path) -> None:
    half = len(T) // 2
    rows = _rows(T, *X["tower"].T, sep=",").splitlines(keepends=True)
    (tmp_path / "a.csv").write_text(head + "".join(rows[:half]) + head + "".join(rows[half:]))
    assert ms.read(tmp_path / "a.csv").samples == len(T)
