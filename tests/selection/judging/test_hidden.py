"""Modes that hide behind stronger ones, in and just outside the band, are listed where noise is white."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.refining import refined_where_it_helps
from modalscope.identification.orders import last_poles
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.select import selected
from modalscope.selection.likelihood.reference_model import floor_of
from tests.selection.judging.coloured import white_errors

#: A mode 2.8 lines below the band, as strong as any in it, whose other modes are up to 300 times weaker.
LINES = np.arange(5, 400, 0.5)
FREQUENCIES, DAMPING = np.array([3.6, 12.4, 31.4, 48.8, 92.5, 105.1]), np.array([0.01, 0.05, 0.1, 0.04, 0.02, 0.02])
SIZES = np.array([1.0, 0.03, 0.3, 1.0, 0.03, 0.003])


def hidden(seed: int) -> ms.FrequencyResponse:
    """Return responses of two outputs to two inputs, 80 dB above white noise."""
    rng, s = np.random.default_rng(seed), poles_from(FREQUENCIES, DAMPING)
    residues = rng.standard_normal((6, 2, 1)) * rng.standard_normal((6, 1, 2)) * SIZES[:, None, None]
    x = 2j * np.pi * LINES[:, None, None]
    values = sum(
        r / (x - p) + r.conj() / (x - p.conj()) for r, p in zip(residues / (2j * s.imag)[:, None, None], s, strict=True)
    )
    return ms.FrequencyResponse(values=values + white_errors(rng, values, 1e-4), frequencies=LINES)


@pytest.mark.parametrize(
    ("seed", "orders"),
    [(4, range(12, 41, 4)), *(pytest.param(seed, None, marks=pytest.mark.slow) for seed in (3, 5, 6))],
)
def test_modes_behind_stronger_ones_and_beside_one_outside_the_band_are_listed(seed: int, orders: range | None) -> None:
    found = ms.select(ms.stabilize(hidden(seed), orders=orders)).frequencies
    inside = FREQUENCIES[1:]
    assert len(found) == len(inside)
    assert np.all(np.abs(found - inside) < 0.1 * DAMPING[1:] * inside)


def test_the_likelihood_keeps_modes_beside_a_pole_outside_the_band_that_the_diagram_knows() -> None:
    """Without it the data at the edge belong to no pole, and most modes leave for the optimum of others."""
    data = hidden(84001)
    diagram = ms.stabilize(data)
    assert np.abs(np.abs(last_poles(diagram)) / (2 * np.pi) - FREQUENCIES[0]).min() < 1e-3
    assert diagram.frequencies.min() > LINES[0]
    found = refined_where_it_helps(diagram, selected(diagram))
    assert not [note for note in found.notes if note.kind == "not refined"]
    deviations = (found.frequencies - FREQUENCIES[1:]) / np.asarray(found.frequencies_std)
    assert np.abs(deviations).max() < 3
    without = diagram.changed(outside=diagram.outside[:0], order_of_outside=diagram.order_of_outside[:0])
    assert [note for note in refined_where_it_helps(without, selected(without)).notes if note.kind == "not refined"]


def test_the_noise_of_quiet_lines_is_that_of_all_where_a_tenth_of_them_is_loud() -> None:
    """Complex noise of variance two; the median of the squares of nine tenths lies at 5/9 of them: sigma 1.08 times too large."""
    left: RealArray = np.random.default_rng(0).standard_normal((2, len(LINES), 2, 2))
    left[:, ::10] *= 100
    floor = replace(
        floor_of(hidden(0), np.zeros(0, complex)), left=left.reshape(-1, 2, 2), kept=np.ones(2 * len(LINES))
    )
    quiet = floor.quiet(len(LINES))
    assert np.ptp(quiet.rows) == 0
    sizes = quiet.levels.channels * np.sqrt(quiet.variance)
    np.testing.assert_allclose(sizes, np.sqrt(np.log(9 / 4) / np.log(2)), rtol=0.06)
