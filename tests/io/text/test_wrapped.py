"""One channel whose samples run on over the lines, by what its head says or by what its columns are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms

_RNG = np.random.default_rng(1)
WHOLE = np.rint(1e4 * _RNG.standard_normal(3001))
SMOOTH = np.round(10 * np.cumsum(_RNG.standard_normal(4000)), 3)

KNET = (
    "Origin Time       2020/01/01 03:12:00\nStation Code      ABC001\nSampling Freq(Hz) 100Hz\nDuration Time(s)  30\n"
    "Dir.              E-W\nScale Factor      2000(gal)/8388608\nMax. Acc. (gal)   95.4\nMemo.\n"
)
GSE = "WID2 2009/05/18 06:47:20.255 RTBE      EHZ INT       3001  100.000000   9.49e-02   1.000 M24  -1.0 -0.0\nDAT2\n"


def _wrapped(values: np.ndarray, width: int, form: str = "{:10.0f}") -> str:
    return "".join("".join(map(form.format, values[k : k + width])) + "\n" for k in range(0, values.size, width))


@pytest.mark.parametrize(
    ("text", "values", "rate"),
    [
        (KNET + _wrapped(WHOLE, 8), WHOLE * 2000 / 8388608 / 100, 100.0),
        (
            "TIMESERIES XX_T__BHZ_R, 3001 samples, 40 sps, 2008-01-15T00:00:00, SLIST, INTEGER, Counts\n"
            + _wrapped(WHOLE, 6),
            WHOLE,
            40.0,
        ),
        (GSE + _wrapped(WHOLE, 7) + "CHK2 1234567\n", WHOLE, 100.0),
        (
            "Station 5\nNumber of points: 4000\nSampling interval (s): 0.005\n" + _wrapped(SMOOTH, 6, "{:12.3f}"),
            SMOOTH,
            200.0,
        ),
        (
            "Station 5\nSampling rate: 200 Hz\n" + _wrapped(SMOOTH, 5, "{:12.3f}"),
            SMOOTH,
            200.0,
        ),  # no count, the last line full
    ],
)
def test_a_channel_that_runs_on_is_one(text: str, values: np.ndarray, rate: float, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(text)
    record = ms.read(tmp_path / "a.txt")
    scale = 0.01 if record.units[0][0] == "gal" else 1.0
    assert (record.outputs.shape, record.sampling_rate) == ((values.size, 1), rate)
    np.testing.assert_allclose(scale * record.outputs[:, 0], values, rtol=1e-12)


@pytest.mark.parametrize("spreads", [(1, 3, 2, 5), (1, 1, 1, 1)])
def test_rows_of_four_channels_stay_rows(spreads: tuple[int, ...], tmp_path: Path) -> None:
    table = _RNG.standard_normal((500, 4)) * spreads
    (tmp_path / "a.txt").write_text("Site 5\nSampling rate: 200 Hz\n" + _wrapped(table.ravel(), 4, "{:12.5f}"))
    np.testing.assert_allclose(ms.read(tmp_path / "a.txt").outputs, table, atol=1e-5)


@pytest.mark.parametrize("width", [2, 4])
def test_a_cut_last_row_under_names_makes_no_channel(width: int, tmp_path: Path) -> None:
    rows = _wrapped(_RNG.standard_normal((300, width)).ravel(), width, "{:12.5f}").rstrip("\n")[:-14]
    head = "Sampling rate: 200 Hz\n" + " ".join(f"A{k}" for k in range(width))
    (tmp_path / "a.txt").write_text(f"{head}\n{rows}\n")
    assert ms.read(tmp_path / "a.txt").outputs.shape == (299, width)


def test_rows_that_are_half_the_count_below_a_head_that_stands_again_are_rows(tmp_path: Path) -> None:
    head, table = "Number of values: 300\nSampling rate: 200 Hz\nA B\n", _RNG.standard_normal((300, 2))
    rows = _wrapped(table.ravel(), 2, "{:12.5f}").splitlines(keepends=True)
    (tmp_path / "a.txt").write_text(head + "".join(rows[:150]) + head + "".join(rows[150:]))
    np.testing.assert_allclose(ms.read(tmp_path / "a.txt").outputs, table, atol=1e-5)
