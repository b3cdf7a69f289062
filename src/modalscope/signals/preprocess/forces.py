"""Analyse several simultaneous forces by averaged spectral matrices S_uu, S_yu, S_yy: correlation, principal forces, partial coherence."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.data.records import Signals
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, RealArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread
from modalscope.signals.preprocess.excitation import driven_records
from modalscope.signals.preprocess.plans import plan_runs
from modalscope.signals.preprocess.spectra import CrossSpectra, cross_spectra, silent_lines


class PrincipalForces(NamedTuple):
    """Independent forces on every line.

    Attributes
    ----------
    frequencies : array, (F,)
        Hz.
    powers : array, (F, m)
        Eigenvalues of S_uu, decreasing: power spectral densities of uncorrelated forces.
    vectors : array of complex, (F, m, m)
        Their eigenvectors, in columns.
    """

    frequencies: RealArray
    powers: RealArray
    vectors: ComplexArray


@named()
@one_thread
def force_correlation(signals: Signals, *, segment: int | None = None) -> tuple[RealArray, RealArray]:
    """Return lines (F,) in Hz and |S_ij|^2 / (S_ii S_jj) of all pairs of forces (F, m, m): 1 for two proportional forces.

    Responses to coherent forces cannot be separated: the variance of those to single forces grows by 1 / (1 - coherence).

    Parameters
    ----------
    signals : Signals
        With inputs.
    segment : int, optional
        Samples of a segment; an eighth of a run by default.

    Raises
    ------
    DataError
        A record without inputs, or fewer than two segments.
    """
    spectra = _spectra(signals, segment)
    power = np.einsum("fii->fi", spectra.inputs).real
    return spectra.frequencies, np.asarray(np.abs(spectra.inputs) ** 2 / (power[:, :, None] * power[:, None, :]))


@named()
@one_thread
def principal_forces(signals: Signals, *, segment: int | None = None) -> PrincipalForces:
    """Compute the eigenvalues of S_uu on every line: where the last is far below the first there are fewer forces than inputs.

    Parameters
    ----------
    signals : Signals
        With inputs, in one unit.
    segment : int, optional
        As in `force_correlation`.

    Raises
    ------
    DataError
        As there.
    """
    spectra = _spectra(signals, segment)
    powers, vectors = np.linalg.eigh(spectra.inputs)
    return PrincipalForces(spectra.frequencies, np.clip(powers[:, ::-1], 0, None), vectors[:, :, ::-1])


@named()
@one_thread
def partial_coherence(signals: Signals, *, segment: int | None = None) -> tuple[RealArray, RealArray]:
    """Return lines (F,) in Hz and the coherence of every output and force given all other forces, (F, l, m).

    With S conditioned on the other forces o, S_ab.o = S_ab - S_ao S_oo^-1 S_ob, it is |S_yu.o|^2 / (S_yy.o S_uu.o): the ordinary
    coherence for one force, and near 0 where an output follows from a force through the others only.

    Parameters
    ----------
    signals : Signals
        With inputs.
    segment : int, optional
        As in `force_correlation`.

    Raises
    ------
    DataError
        As there.

    References
    ----------
    Bendat and Piersol, "Random Data", chapter 7.
    """
    spectra = _spectra(signals, segment)
    F, l, m = spectra.cross.shape
    coherence = np.zeros((F, l, m))
    for j in range(m):
        o = [i for i in range(m) if i != j]
        S_oo, S_yo = spectra.inputs[:, o][:, :, o], spectra.cross[:, :, o]
        weights = np.linalg.solve(S_oo, spectra.inputs[:, o, j, None])
        S_uu = spectra.inputs[:, j, j] - (spectra.inputs[:, None, j, o] @ weights)[:, 0, 0]
        cross = spectra.cross[:, :, j] - (S_yo @ weights)[:, :, 0]
        explained = np.einsum("fli,fil->fl", S_yo, np.linalg.solve(S_oo, S_yo.conj().transpose(0, 2, 1))).real
        size = (spectra.output_powers - explained) * S_uu.real[:, None]
        coherence[:, :, j] = np.divide(np.abs(cross) ** 2, size, out=np.zeros((F, l)), where=size > 0)
    return spectra.frequencies, np.clip(coherence, 0, 1)


def _spectra(signals: Signals, segment: int | None) -> CrossSpectra:
    check_kind("signals", signals, Signals)
    driven_records(signals, "spectra of forces")
    plan = plan_runs(signals, "random", segment, None, None)
    spectra = cross_spectra(plan.outputs, plan.inputs, plan.sampling_rate, plan.segments)
    if spectra.averages <= (m := len(signals.input_dofs)):
        have = f"there are {spectra.averages} segments, no more than forces"
        raise DataError(f"spectra of {m} forces were asked", have, "Give shorter segments, or measure longer.")
    return spectra.at_lines(~silent_lines(spectra))
