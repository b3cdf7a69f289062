"""Fits of channels with their own weights, against plain weighted least squares of each."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.numerics.checks import RealArray
from modalscope.selection.judging import recount as channel_fits
from modalscope.selection.judging.recount import ChannelFits, ColouredErrors

LINES, SHAPE = 60, (3, 2)
rng = np.random.default_rng(3)
TERMS, FUNCTIONS, MORE = (rng.standard_normal((2 * LINES, k)) for k in (2, 6, 2))
DATA = rng.standard_normal((2 * LINES, *SHAPE))
ERRORS = ColouredErrors(
    rng.uniform(0.5, 3, (LINES, *SHAPE)),
    rng.uniform(0, 1, (LINES, *SHAPE)),
    0.5 ** np.arange(1, 9),
    0.8 ** np.arange(1, 30),
)


def by_hand(
    columns: RealArray, own: list[int], channel: tuple[int, int], counted: RealArray
) -> tuple[RealArray, RealArray]:
    """Return residues and their covariance with all matrices written out."""
    D = np.sqrt(ERRORS.variance[:, *channel])
    X = (columns[:LINES] + 1j * columns[LINES:]) / D[:, None] * counted[:, None]
    y = (DATA[:LINES, *channel] + 1j * DATA[LINES:, *channel]) / D * counted
    s = np.sqrt(ERRORS.share[:, *channel])
    lag = np.abs(np.subtract.outer(np.arange(LINES), np.arange(LINES)))
    A, K = (np.concatenate([[1.0], each, np.zeros(LINES)])[lag] for each in (ERRORS.even, ERRORS.own))
    T = np.sqrt(np.outer(1 - s**2, 1 - s**2)) * A + np.outer(s, s) * K
    back = np.linalg.inv((X.conj().T @ X).real)
    B = back @ (X.conj().T @ T @ X).real @ back / 2
    return (back @ (X.conj().T @ y).real)[own], B[np.ix_(own, own)]


@pytest.mark.parametrize("held", [1 << 23, 0])
def test_residues_of_all_channels_are_those_of_weighted_least_squares(
    held: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(channel_fits, "_MAX_STORED_NUMBERS", held)
    monkeypatch.setattr(channel_fits, "_BLOCK_NUMBERS", 1 << 10)
    fits = ChannelFits(TERMS, FUNCTIONS, DATA, ERRORS)
    all_lines, lobe = np.ones(LINES), np.array([20, 21, 22])
    fewer = all_lines.copy()
    fewer[lobe] = 0
    for which, how, more, counted in (
        ([0, 2], {}, MORE[:, :0], all_lines),
        ([1], {"without": lobe}, MORE[:, :0], fewer),
        ([0, 3], {"beside": MORE}, MORE, all_lines),
        ([0, 3], {"beside": MORE, "told": 1}, MORE, all_lines),
    ):
        a, B = fits.residues(np.array(which), **how)
        columns = np.hstack([TERMS, FUNCTIONS, more])
        assert B.shape[1] == how.get("told", len(which))
        for c, channel in enumerate(np.ndindex(*SHAPE)):
            for k, mode in enumerate(which):
                residue, covariance = by_hand(columns, [2 + 2 * mode, 3 + 2 * mode], channel, counted)
                assert a[c, k] == pytest.approx(residue, rel=1e-9)
                if k < B.shape[1]:
                    assert B[c, k] == pytest.approx(covariance, rel=1e-9)


@pytest.mark.parametrize("length", [0.0, 1e-150, 1e-40])
def test_a_column_of_nothing_but_rounding_leaves_the_residues_of_the_others_as_they_are(length: float) -> None:
    # what the second function of a pole becomes on its way to the real axis
    short = FUNCTIONS * np.append(np.ones(5), length)
    fits = ChannelFits(TERMS, short, DATA, ERRORS)
    without = ChannelFits(np.hstack([TERMS, FUNCTIONS[:, [4]]]), FUNCTIONS[:, :4], DATA, ERRORS)
    for beside in (None, MORE, np.hstack([MORE, length * MORE])):
        a, B = fits.residues(np.array([0, 1]), beside=beside)
        alone, known = without.residues(np.array([0, 1]), beside=None if beside is None else MORE)
        assert np.allclose(a, alone)
        assert np.allclose(B, known)
