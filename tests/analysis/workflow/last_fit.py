"""Fresh records with measured forces and parts of bands, and whether shapes hold what is said of them while little is left unexplained."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.signal import resample

import modalscope as ms
from modalscope.data.indicators import mac
from modalscope.data.rebuilt import fit_of
from modalscope.data.response import Response
from modalscope.numerics.checks import ComplexArray, RealArray
from tests.selection.judging.hard import QUANTITIES, lines_of, random_structure
from tests.selection.judging.sub_bands import sub_band
from tests.selection.likelihood.interval_cases import BESIDE, FASTER, HIGHEST, RATE, _steady


class Case(NamedTuple):
    """Data, options of their analysis, poles (n,) in rad/s, shapes (l, n), and the noise as a part of the data."""

    data: ms.Signals | ms.FrequencyResponse
    options: dict[str, Any]
    poles: ComplexArray
    shapes: ComplexArray
    noise: float


def record(seed: int) -> Case:
    """Return a record of 15 s to 5 min at 100 Hz: displacements, velocities or accelerations, either plane, noise of 20 to 60 dB.

    Forces go on before and after, and are not held between samples.
    """
    rng = np.random.default_rng([seed, 900])
    structure, p = random_structure([seed, 901]), seed % 3
    seconds, decibel = np.exp(rng.uniform(np.log(15), np.log(300))), rng.uniform(20, 60)
    s = structure.poles * (HIGHEST / structure.top)
    R = structure.residues / (structure.poles ** QUANTITIES.index(structure.quantity))[:, None, None]
    samples, beside = round(seconds * RATE), round(BESIDE * RATE)
    u = rng.standard_normal((samples + 2 * beside, R.shape[2]))
    y = _steady(resample(u, len(u) * FASTER, axis=0), s, R, p)[::FASTER][beside : beside + samples]
    y = y + y.std(axis=0) * 10 ** (-decibel / 20) * rng.standard_normal(y.shape)
    signals = ms.Signals(outputs=y, inputs=u[beside : beside + samples], sampling_rate=RATE)
    return Case(signals, {"domain": "zs"[seed // 3 % 2]}, s, shapes_of(R), 10 ** (-decibel / 20))


def part_of_a_band(seed: int) -> Case:
    """Return responses of many modes over a wide band, of which a part is asked, noise of 40 dB of the whole."""
    case = sub_band(seed, 40)
    clean = lines_of(case.structure, case.response.band(*case.band).frequencies)
    noise = np.linalg.norm(case.response.band(*case.band).values - clean) / np.linalg.norm(clean)
    return Case(
        case.response, {"band": case.band}, case.structure.poles, shapes_of(case.structure.residues), float(noise)
    )


def shapes_of(residues: ComplexArray) -> ComplexArray:
    """Return shapes (l, n) of residues (n, l, m)."""
    return np.array([np.linalg.svd(r)[0][:, 0] for r in residues]).T


class Scored(NamedTuple):
    """(1 - MAC) of the modes found over the variance that is stated for it (k,), what is left, what free residues leave, and the noise."""

    ratios: RealArray
    left: float
    free: float
    noise: float


def scored(case: Case) -> Scored:
    """Return how the list of the whole program does."""
    result = ms.analyze(case.data, **case.options)
    modes = result.modes
    assert modes.shapes_std is not None
    stated = np.sum(modes.shapes_std**2, axis=0)  # of shapes of length one
    apart = np.abs(modes.poles[:, None] - case.poles)
    near = np.argmin(apart, axis=1)
    right = apart.min(axis=1) < np.maximum(-case.poles.real, 0.003 * np.abs(case.poles))[near]
    unlike = 1 - np.diag(mac(modes.shapes, case.shapes[:, near]))
    response = result.diagram.response
    return Scored((unlike / stated)[right], fit_of(modes, response), left_by_free_residues(response, modes), case.noise)


def left_by_free_residues(response: Response, modes: ms.ModalModel) -> float:
    """Return what least squares leave in every channel for itself, with the residual terms that are reported, as `fit_of` does."""
    (terms,) = modes.residual_terms
    own = np.concatenate([modes.poles, terms.poles]) - response.added_damping
    basis = response.whole_basis(own, terms.powers or response.outside_powers)
    columns = basis.columns / np.maximum(np.linalg.norm(basis.columns, axis=0), 1e-300)
    flat = basis.data.reshape(len(columns), -1)
    left = flat - columns @ np.linalg.lstsq(columns, flat, rcond=None)[0]
    return float(np.linalg.norm(left) / np.linalg.norm(flat))
