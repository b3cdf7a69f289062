"""Refinement reaches the Cramer-Rao bound, says how far off it may be, and tells what it cannot do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import modalscope as ms
from modalscope.modal.rebuilt import fit_of
from modalscope.model import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.model.poles import poles_from
from tests.identification.bound import bound, shape_bound
from tests.support import FIVE, add_noise

F, ZETA = np.array([3.0, 5.0, 5.3]), np.array([0.02, 0.03, 0.01])
RNG = np.random.default_rng(1)


def model(outputs: int, inputs: int, **more: object) -> ModalModel:
    rng = np.random.default_rng(7)

    def visible(*shape: int) -> np.ndarray:
        return rng.uniform(0.5, 2, shape) * np.exp(2j * np.pi * rng.uniform(size=shape))

    return ModalModel(
        poles=poles_from(F, ZETA),
        shapes=visible(outputs, 3),
        participation=visible(3, inputs),
        quantity="displacement",
        **more,
    )  # type: ignore[arg-type]


def lines(modes: ModalModel, added: float = 0.0) -> FrequencyResponse:
    grid = np.linspace(1, 8, 150)
    clean = replace(modes, poles=modes.poles - added).frequency_response(grid)
    return replace(clean, added_damping=added, quantity="displacement")


def samples(modes: ModalModel, added: float = 0.0, first: int = 0) -> ImpulseResponse:
    clean = replace(modes, poles=modes.poles - added).impulse_response(200, 25.0, first_sample=first)
    return replace(clean, added_damping=added)


DATA = {
    "lines": lambda modes: lines(modes),
    "lines of a window": lambda modes: lines(modes, 0.3),
    "samples": lambda modes: samples(modes),
    "late samples of a window": lambda modes: samples(modes, 0.3, 3),
}


def astray(modes: ModalModel, by: float = 0.05) -> ModalModel:
    """Return modes with poles off by part of their decay rate."""
    turned = np.exp(2j * np.pi * np.random.default_rng(3).uniform(size=len(modes)))
    return replace(modes, poles=modes.poles + by * np.abs(modes.poles.real) * turned)


# ------------------------------------------------------------------------------------------------------- without noise


@pytest.mark.parametrize("kind", DATA)
@pytest.mark.parametrize("channels", [(4, 2), (2, 4), (5, 1), (1, 5), (1, 1)])
def test_without_noise_it_goes_back_to_the_truth(kind, channels):
    truth = model(*channels)
    data = DATA[kind](truth)
    found = ms.refine(data, astray(truth))
    assert found.converged
    # the misfit is held to 1e-14 of the data, and poles 3 decay rates apart are seen at about 1e-3 of that
    assert np.max(np.abs(found.poles / truth.poles - 1)) < 1e-10
    assert fit_of(found, data) < 1e-11
    assert np.allclose(found.unrefined.poles, astray(truth).poles)


@pytest.mark.parametrize("kind", DATA)
@pytest.mark.parametrize("channels", [(4, 2), (2, 4)])
def test_the_deviations_are_the_bound_of_the_whole_problem(kind, channels):
    """All unknowns at once by differences, against two projections and a compression: the same to the error of the differences."""
    truth = model(*channels)
    data = DATA[kind](truth)
    level = 0.01 * np.outer(1 + np.arange(channels[0]), 2 - 0.2 * np.arange(channels[1]))
    rows = len(data.basis(truth.poles).data)
    # a residual of known size that no mode explains, of alternating sign so that it looks white to the fit
    noise = np.random.default_rng(5).standard_normal((rows, *channels)) * level
    values = noise[: data.count] + 1j * noise[data.count :] if rows > data.count else noise
    found = ms.refine(replace(data, values=data.values + 1e-6 * values), truth, groups=None)
    f, zeta, covariance = bound(data, truth, 1e-6 * level)
    # the noise is estimated from some 1600 to 2400 values: 2 % is a standard deviation of the level of one channel in part
    assert np.allclose(found.frequencies_std, f, rtol=0.1)
    assert np.allclose(found.damping_ratios_std, zeta, rtol=0.1)
    assert np.allclose(found.shapes_std, shape_bound(truth, covariance), rtol=0.15)


def test_with_the_variance_given_the_deviations_are_the_bound_itself():
    truth = model(4, 2)
    data = lines(truth)
    deviation = 1e-3 * np.outer([1, 2, 3, 4], [1, 0.5])
    known = replace(data, variance=np.broadcast_to(2 * deviation**2, data.values.shape))
    found = ms.refine(known, truth, groups=None)
    f, zeta, covariance = bound(data, truth, deviation)
    assert np.allclose(found.frequencies_std, f, rtol=1e-5)
    assert np.allclose(found.damping_ratios_std, zeta, rtol=1e-5)
    assert np.allclose(found.shapes_std, shape_bound(truth, covariance), rtol=1e-4)


def test_outputs_and_inputs_may_change_places():
    """Whichever side has fewer channels is eliminated, the optimum and its deviations are the same."""
    truth = model(4, 2)
    data = add_noise(lines(truth), 40)
    turned = FrequencyResponse(
        values=data.values.transpose(0, 2, 1), frequencies=data.frequencies, quantity="displacement", groups=None
    )
    other = ModalModel(poles=truth.poles, shapes=truth.participation.T, participation=truth.shapes.T)
    here, there = ms.refine(data, truth), ms.refine(turned, other)
    assert np.allclose(here.poles, there.poles, rtol=1e-9)
    for name in ("frequencies_std", "damping_ratios_std", "gain"):
        assert np.allclose(getattr(here, name), getattr(there, name), rtol=1e-6), name
    assert np.allclose(here.residues.transpose(0, 2, 1), there.residues, rtol=1e-6)


# -------------------------------------------------------------------------------------------------------- with noise


def start(data: FrequencyResponse | ImpulseResponse, states: int, spare: int = 0) -> ModalModel:
    """Return the poles of alternate that reach furthest in the data, as many as there are modes."""
    found = ms.identify(data, method="alternate", order=states + spare).modes
    found = found.take(np.array([kind == "mode" for kind in found.kinds]))
    size = np.linalg.norm(found.shapes, axis=0) * np.linalg.norm(found.participation, axis=1)
    strength = size * data.basis(found.poles).reach
    return found.take(np.sort(np.argsort(-strength)[: states // 2]))


#: The structures of the bound, and the data they are seen in.
CELLS = [(name, kind) for name in ("chain5", "close4", "heavy4") for kind in ("samples", "lines")]


def clean_data(name: str, kind: str) -> FrequencyResponse | ImpulseResponse:
    structure = FIVE[name]()
    return (
        structure.impulse_response(400) if kind == "samples" else structure.frequency_response(np.linspace(0.3, 8, 340))
    )


def errors_over_bound(name: str, kind: str, snr_db: float, seeds: range) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return errors of refined f and zeta over their bounds (seeds, 2, n), which lie in the 95 % interval, and what went wrong."""
    clean = clean_data(name, kind)
    n = len(FIVE[name]().modes())
    exact = ms.identify(clean, order=2 * n).modes
    deviation = 10 ** (-snr_db / 20) * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=0))
    f, zeta, _ = bound(clean, exact, deviation / (1 if kind == "samples" else np.sqrt(2)))
    errors, covered, told = [], [], []
    for seed in seeds:
        data = add_noise(clean, snr_db, seed)
        found = ms.refine(data, start(data, 2 * n, 0 if snr_db >= 40 else 4))
        if len(found) < n or not found.converged:
            told.append(f"seed {seed}: {[str(note) for note in found.notes]}")
            continue
        both = np.array([found.frequencies - exact.frequencies, found.damping_ratios - exact.damping_ratios])
        own = np.array([found.frequencies_std, found.damping_ratios_std])
        errors.append(both / np.array([f, zeta]))
        covered.append(np.abs(both) <= 1.96 * own)
    return np.array(errors), np.array(covered), told


@pytest.mark.parametrize(("name", "kind"), CELLS)
def test_errors_are_no_larger_than_the_bound(name, kind):
    errors, covered, told = errors_over_bound(name, kind, 40, range(100, 115))
    assert not told
    # 15 seeds of n modes, f and zeta: the mean square lies below chi2's 99.99 % quantile (errors of modes are nearly independent)
    assert np.mean(errors**2) < chi2.ppf(0.9999, errors.size) / errors.size
    assert np.mean(covered) > 0.88


@pytest.mark.study
@pytest.mark.parametrize("snr_db", [40, 20])
@pytest.mark.parametrize(("name", "kind"), CELLS)
def test_refinement_reaches_the_bound_over_two_hundred_seeds(name, kind, snr_db):
    """The table of docs/refinement.md."""
    errors, covered, told = errors_over_bound(name, kind, snr_db, range(200))
    ratio, share = np.sqrt(np.mean(errors**2, axis=0)), 100 * np.mean(covered, axis=0)
    print(
        f"\n{name} {kind} {snr_db} dB: RMSE/CRB f {ratio[0].min():.2f}-{ratio[0].max():.2f}, zeta {ratio[1].min():.2f}-"
        f"{ratio[1].max():.2f}, coverage f {share[0].min():.0f}-{share[0].max():.0f}, zeta {share[1].min():.0f}-"
        f"{share[1].max():.0f} %, largest {np.abs(errors).max():.1f}, told {len(told)} {told[:3]}"
    )
    heavy = name == "heavy4" and kind == "samples" and snr_db == 20
    assert np.max(ratio) < (1.35 if heavy else 1.18)  # 200 seeds: 5 % sampling error, the largest of ten
    assert np.min(share) >= 89  # 95 % of 200: a standard deviation of 1.5 %
    assert np.abs(errors).max() < 6  # a failure that nobody told would lie far outside
