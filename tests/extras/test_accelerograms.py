"""Accelerograms of strong-motion archives, written here after the formats' own documents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import read, survey
from tests.support import DATA

SAMPLES = np.round(50 * np.sin(0.3 * np.arange(37)), 3)


def fixed(values: np.ndarray, width: int, form: str, a_line: int) -> str:
    cells = [f"{value:{width}{form}}" for value in values]
    return "\n".join("".join(cells[k : k + a_line]) for k in range(0, len(cells), a_line))


def csmip(number: int, direction: str, location: str, step: float = 0.02) -> str:
    """One channel of volume 2 (CSMIP, Shakal and Huang 1985)."""
    head = f"CORRECTED ACCELEROGRAM\nSTATION NO. 1336\nCHAN {number:2d}: {direction}  (STA CHN: {number:2d})     LOCATION: {location}\n"
    blocks = "".join(
        f" {SAMPLES.size} POINTS OF {name} DATA EQUALLY SPACED AT  {step:.3f} SEC.  (UNITS: {unit})\n{fixed(SAMPLES * k, 10, '.3f', 8)}\n"
        for k, (name, unit) in enumerate((("ACCEL", "CM/SEC/SEC"), ("VELOC", "CM/SEC"), ("DISPL", "CM")), 1)
    )
    return f"{head}{blocks}/&  ----------  END OF DATA FOR CHANNEL {number:2d}  ----------\n"


def cosmos(channel: int, location: str, step_ms: float, form: tuple[str, int, str, int]) -> str:
    """One channel of a COSMOS file, version 1.20, of which the step is real header 62 in ms."""
    reals = np.full(100, -999.0)
    reals[61] = step_ms
    length = round(SAMPLES.size * step_ms / 1000)
    said, width, how, a_line = form
    return (
        "Corrected acceleration    (Format v01.20 with 13 text lines)\n"
        f"Sta Chan {channel:3d}: 90 deg (Rcrdr Chan  1) Location:{location}\n"
        " 100 Integer-header values follow on  10 lines, Format= (10I8)\n"
        + fixed(np.full(100, -999.0), 8, ".0f", 10)
        + "\n 100 Real-header values follow on  17 lines, Format= (6F13.6)\n"
        + fixed(reals, 13, ".6f", 6)
        + f'\n   1 Comment line(s) follow, each starting with a "|":\n|\n{SAMPLES.size:8d} acceleration pts, approx {length} secs, '
        f"units=cm/sec2 (04),Format=({said})\n{fixed(SAMPLES, width, how, a_line)}\nEnd-of-data for Chan {channel:2d} acceleration\n"
    )


def smc(comments: int, rate: float) -> str:
    """An SMC file (USGS, NSMP)."""
    integers, reals = np.full(48, -32768.0), np.full(50, 1.7e38)
    integers[12:17] = 90, 45, -32768, comments, SAMPLES.size
    reals[1] = rate
    numbers = [f"{value:.4E}" for value in SAMPLES]
    short = [f"{text[: text.index('E') + 2]}{text[-1]}".rjust(10) for text in numbers]  # an exponent of one digit
    rows = "\n".join("".join(short[k : k + 8]) for k in range(0, len(short), 8))
    head = "\n".join(["2 CORRECTED ACCELEROGRAM", *["*"] * 10])
    return f"{head}\n{fixed(integers, 10, '.0f', 8)}\n{fixed(reals, 15, '.7E', 5)}\n" + "|\n" * comments + rows + "\n"


def test_channels_of_csmip_stand_one_below_the_other(tmp_path: Path) -> None:
    path = tmp_path / "bridge.v2"
    path.write_text(csmip(1, "UP", "FOOTING: W. EDGE") + csmip(7, "270 DEG", "DECK"))
    found = survey(path)
    assert found.thing.output_dofs == ("1 footing, w. edge up", "7 deck 270°")
    assert found.thing.sampling_rate == 50.0
    assert found.thing.quantities == ("acceleration", "acceleration")
    assert found.thing.units[0] == ("cm/s^2", "cm/s^2")
    np.testing.assert_array_equal(found.thing.outputs, np.stack([SAMPLES, SAMPLES], axis=1))
    assert any("displacement and velocity not read" in note for note in found.notes)


@pytest.mark.parametrize("form", [("8F10.5", 10, ".5f", 8), ("10F8.3", 8, ".3f", 10), ("1E15.6", 15, ".6E", 1)])
@pytest.mark.parametrize("step_ms", [5.0, 50.0])
def test_blocks_of_cosmos_have_the_columns_that_their_line_says(
    tmp_path: Path, form: tuple[str, int, str, int], step_ms: float
) -> None:
    path = tmp_path / "station.v2c"
    path.write_text(cosmos(3, "Roof", step_ms, form))
    found = read(path)
    assert found.output_dofs == ("3 roof 90°",)
    assert found.sampling_rate == pytest.approx(1000 / step_ms)
    np.testing.assert_allclose(found.outputs[:, 0], SAMPLES, atol=1e-3)


@pytest.mark.parametrize("comments", [0, 2])
def test_smc_counts_its_comments_and_samples(tmp_path: Path, comments: int) -> None:
    path = tmp_path / "one.smc"
    path.write_text(smc(comments, 200.0))
    found = read(path)
    assert found.sampling_rate == 200.0
    assert found.output_dofs == ("1 45°",)
    np.testing.assert_allclose(found.outputs[:, 0], SAMPLES, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("RESPONSE AND FOURIER AMPLITUDE SPECTRA\n1 2 3\n", "spectra, which are no record"),
        ("UNITS OF UNCOR ACCEL ARE SEC AND G/10.\n", "pairs of time and acceleration at uneven times"),
        ("nothing of the kind\n", "no line announces a block of acceleration"),
        (csmip(1, "UP", "DECK").replace("37 POINTS OF ACCEL", "99 POINTS OF ACCEL"), "columns of 10 characters"),
        (csmip(1, "UP", "DECK") + csmip(2, "UP", "DECK", step=0.01), "steps of 0.01, 0.02 s"),
    ],
)
def test_what_is_no_record_is_refused_in_words(tmp_path: Path, text: str, found: str) -> None:
    path = tmp_path / "a.v2"
    path.write_text(text)
    with pytest.raises(ms.DataError, match=found):
        read(path)


@pytest.mark.skipif(not (DATA / "meloland").is_dir(), reason="the measured set meloland is not there")
def test_the_files_of_a_measured_bridge_are_read() -> None:
    found = [read(path) for path in sorted((DATA / "meloland").glob("*.V2"))]
    assert len(found) == 26
    assert {record.sampling_rate for record in found} == {50.0, 100.0}
    assert found[0].output_dofs == ("1 footing of center column, w. edge up",)
    assert np.abs(found[0].outputs).max() == pytest.approx(171.589)  # as its header says
