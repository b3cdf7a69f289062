"""Records are judged as they are factored: every output by its noise, so that a quiet one tells as much as it knows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import modalscope as ms
from modalscope.data import Signals
from modalscope.data.record_residual import DELAY, UNMEASURED
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import as_records
from modalscope.data.response import output_scale, root_mean_squares
from modalscope.numerics.functions.poles import poles_from

RATE = 50.0
F, ZETA = np.array([2.1, 4.4, 6.8, 9.2]), np.array([0.004, 0.006, 0.01, 0.008])
#: Noise of every output beside its root mean square, and the unit each is in.
NOISE, UNIT = np.array([0.003, 1.0, 2.0, 3.0, 1.5]), np.array([1e-3, 1.0, 10.0, 1e3, 1.0])


def record(noise: np.ndarray = NOISE, unit: np.ndarray = UNIT, seed: int = 0) -> Signals:
    """One minute of four modes under one force, one of them at a twentieth; one quiet output, four that are mostly noise."""
    rng = np.random.default_rng(seed)
    shapes, u = rng.standard_normal((5, 4)), rng.standard_normal((int(60 * RATE), 1))
    shapes[:, 1] *= 0.05
    y = np.zeros((len(u), 5))
    for s, shape in zip(poles_from(F, ZETA), shapes.T, strict=True):
        z = np.exp(s / RATE)
        x = lfilter([0, (z - 1) / s], [1, -z], u[:, 0].astype(complex))
        y += ((s * x).imag / s.imag)[:, None] * shape
    y += noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return Signals(outputs=y * unit, inputs=u, sampling_rate=RATE)


@pytest.fixture(scope="module")
def diagram() -> ms.StabilizationDiagram:
    return ms.stabilize(record())


@pytest.mark.slow
def test_outputs_are_judged_by_their_noise(diagram: ms.StabilizationDiagram) -> None:
    """Of an output of root mean square r with noise n times its signal the noise is r n / sqrt(1 + n^2)."""
    rms = root_mean_squares(record_spectra(as_records(record())))
    level = output_scale(diagram.response)
    expected = rms * NOISE / np.sqrt(1 + NOISE**2)
    assert level / level[1] == pytest.approx(expected / expected[1], rel=0.25)


def test_a_mode_that_one_quiet_output_shows_is_found_beside_noisy_ones(diagram: ms.StabilizationDiagram) -> None:
    modes = ms.select(diagram)
    assert modes.frequencies == pytest.approx(F, rel=2e-3)
    assert modes.damping_ratios == pytest.approx(ZETA, rel=0.25)


@pytest.mark.slow
def test_units_change_nothing(diagram: ms.StabilizationDiagram) -> None:
    other = ms.stabilize(record(unit=np.ones(5)))
    assert other.fit_errors == pytest.approx(diagram.fit_errors, rel=1e-3)  # poles of noise are known to that
    assert ms.select(other).damping_ratios == pytest.approx(ms.select(diagram).damping_ratios, rel=1e-6)


def test_what_noisy_outputs_leave_is_no_unmeasured_force(diagram: ms.StabilizationDiagram) -> None:
    """Participation fitted to the loudest output left resonances in the quiet one: the way with instruments was taken."""
    assert diagram.settings.route == "records"
    assert not [note for note in diagram.notes if note.kind in (UNMEASURED, DELAY)]


def test_without_a_level_outputs_are_level_by_their_root_mean_squares() -> None:
    spectra = record_spectra(as_records(record()))
    assert spectra.level is None
    assert np.array_equal(output_scale(spectra), root_mean_squares(spectra))


def test_a_level_goes_with_its_outputs_and_into_files(diagram: ms.StabilizationDiagram, tmp_path: Path) -> None:
    level = diagram.response.level
    picked = diagram.response.select(outputs=diagram.response.output_dofs[1:3])
    assert np.array_equal(picked.level, level[1:3])
    ms.write(tmp_path / "diagram.npz", diagram)
    again = ms.read(tmp_path / "diagram.npz")
    assert np.array_equal(again.response.level, level)
    assert np.array_equal(ms.select(again).frequencies, ms.select(diagram).frequencies)
