"""Refinement reaches the Cramer-Rao bound, says how far off it may be, and tells what it cannot do."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import chi2

import modalscope as ms
from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.data.rebuilt import fit_of
from modalscope.numerics.functions.poles import poles_from
from tests.selection.judging.bound import bound, shape_bound
from tests.support import BEAM, FIVE, add_noise, refused

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


def noise_under_window(data: FrequencyResponse | ImpulseResponse, rng: np.random.Generator) -> np.ndarray:
    """Return noise of variance one in the mean of all real rows, as an exponential window leaves it, white without one."""
    a, shape = data.added_damping, data.values.shape
    if isinstance(data, ImpulseResponse):
        return rng.standard_normal(shape) * np.exp(-a * np.arange(len(data.values)) / data.sampling_rate)[:, None, None]
    count = 4096  # of complex noise over the length that the distance of lines tells, so that its lines are circular
    decay = np.exp(-a * (np.arange(count) + 0.5) / count / (data.frequencies[1] - data.frequencies[0]))
    white = rng.standard_normal((count, *shape[1:])) + 1j * rng.standard_normal((count, *shape[1:]))
    both = np.fft.fft(decay[:, None, None] * white, axis=0) / np.sqrt(np.sum(decay**2))
    return both[: shape[0]]


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


@pytest.mark.parametrize("kind", [kind for kind in DATA if kind != "lines of a window"])
@pytest.mark.parametrize("channels", [(4, 2), (2, 4)])
def test_the_deviations_are_the_bound_of_the_whole_problem(kind, channels):
    """All unknowns at once by differences, against two projections and a compression: the same to the error of the differences."""
    truth = model(*channels)
    data = DATA[kind](truth)
    level = 0.01 * np.outer(1 + np.arange(channels[0]), 2 - 0.2 * np.arange(channels[1]))
    # a residual of known size that no mode explains
    values = noise_under_window(data, np.random.default_rng(5)) * level
    found = ms.refine(replace(data, values=data.values + 1e-6 * values), truth, groups=None)
    fading = np.exp(-data.added_damping * np.arange(data.count) / 25.0) if kind == "late samples of a window" else 1.0
    f, zeta, covariance = bound(data, truth, 1e-6 * level * np.reshape(fading, (-1, 1, 1)))
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
    assert np.allclose(found.shapes_std, shape_bound(truth, covariance, np.array([1, 2, 3, 4])), rtol=1e-4)


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


def test_significance_is_told_once_that_of_the_values_that_are_reported() -> None:
    """The choice rests on the noise that all poles of a diagram leave, in levels to powers of two."""
    data = add_noise(lines(model(4, 2)), 40)
    modes = ms.analyze(data).modes
    for why, gain in zip(modes.reasons, modes.gain, strict=True):
        assert why["gain"] == gain
        assert why["text"].startswith(f"significance {float(f'{gain:.3g}'):.10g}; noise alone reaches")


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


def against_the_bound(name: str, kind: str, snr_db: float, seeds: range) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return errors and told deviations of f and zeta over their bounds, each (seeds, 2, n), and what went wrong.

    Starts at 20 dB may lack a mode, or hold one of noise in its place: there the list may be completed.
    """
    clean = clean_data(name, kind)
    n = len(FIVE[name]().modes())
    exact = ms.identify(clean, order=2 * n).modes
    deviation = 10 ** (-snr_db / 20) * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=0))
    least = np.array(bound(clean, exact, deviation / (1 if kind == "samples" else np.sqrt(2)))[:2])
    errors, told, wrong = [], [], []
    for seed in seeds:
        data = add_noise(clean, snr_db, seed)
        noisy = snr_db < 40
        found = ms.refine(data, start(data, 2 * n, 4 * noisy), complete=noisy)
        if len(found) != n or not found.converged:
            wrong.append(f"seed {seed}: {len(found)} modes, {[note.kind for note in found.notes]}")
            continue
        both = np.array([found.frequencies - exact.frequencies, found.damping_ratios - exact.damping_ratios])
        errors.append(both / least)
        told.append(np.array([found.frequencies_std, found.damping_ratios_std]) / least)
    return np.array(errors), np.array(told), wrong


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), CELLS)
def test_errors_are_no_larger_than_the_bound(name, kind):
    errors, told, wrong = against_the_bound(name, kind, 40, range(100, 115))
    assert not wrong
    # noise of a channel is taken for a product of its output's and its input's: where it is none, 12 % are lost (close4)
    assert np.all((told.mean(axis=0) > 0.9) & (told.mean(axis=0) < 1.15))
    # 15 seeds of n modes, f and zeta: the mean square lies below chi2's 99.99 % quantile (errors of modes are nearly independent)
    assert np.mean((errors / told) ** 2) < chi2.ppf(0.9999, errors.size) / errors.size
    assert np.mean(np.abs(errors) < 1.96 * told) > 0.88


@pytest.mark.study("refinement")
@pytest.mark.parametrize("snr_db", [40, 20])
@pytest.mark.parametrize(("name", "kind"), CELLS)
def test_refinement_reaches_the_bound_over_two_hundred_seeds(name, kind, snr_db, study):
    """200 seeds tell a ratio to 5 % (the largest of ten), and a coverage of 95 % to 1.5 %."""
    errors, told, wrong = against_the_bound(name, kind, snr_db, range(200))
    ratio, level = np.sqrt(np.mean(errors**2, axis=0)), told.mean(axis=0)
    share = 100 * np.mean(np.abs(errors) < 1.96 * told, axis=0)
    print(wrong[:3])
    table = study(f"{name}, {kind}, {snr_db} dB", "200 seeds, 0 to 199")
    table.row("error over the bound, f", ratio[0], form=".2f")
    table.row("error over the bound, zeta", ratio[1], form=".2f")
    table.row("error over the bound, all values pooled", np.sqrt(np.mean(errors**2)), form=".2f")
    table.row("standard deviation over the bound", level, most=1.15, form=".2f")
    table.row("error over standard deviation", ratio / level, most=1.2, form=".2f")
    table.row("coverage of 95 % intervals", share, least=90, form=".1f", unit=" %")
    # a failure without a note would lie far outside
    table.row("largest single error over the bound", np.abs(errors).max(), most=6, form=".1f")
    # starts at 20 dB hold a false mode in one set of twenty; the missing one is added to it: five modes, each with a note
    table.row("seeds with another number of modes, each with a note", len(wrong), most=16)
    assert all("added" in one for one in wrong)
    assert not table.missed


# ------------------------------------------------------------------------------------------------ what it cannot do


@pytest.mark.parametrize("kind", ["samples", pytest.param("lines", marks=pytest.mark.slow)])
def test_exactly_repeated_poles_are_no_failure_and_are_told(kind):
    structure = FIVE["ring5"]()
    clean = (
        structure.impulse_response(400) if kind == "samples" else structure.frequency_response(np.linspace(0.3, 8, 340))
    )
    data = add_noise(clean, 40, 1)
    found = ms.refine(data, ms.select(ms.stabilize(data)))
    assert found.converged
    assert len(found) == 5
    f = np.sort(structure.modes().frequencies)
    mean = np.array([found.frequencies[0], *(found.frequencies[k : k + 2].mean() for k in (1, 3))])
    assert np.allclose(mean, f[[0, 1, 3]], rtol=1e-4)  # a few deviations at 40 dB
    assert "only mean frequency and common subspace" in " ".join(str(n) for n in found.notes if n.kind == "repeated")


def test_a_mode_with_nothing_of_its_own_is_left_out_and_told():
    truth = model(4, 2)
    data = add_noise(lines(truth), 40)
    more = replace(
        truth,
        poles=np.append(truth.poles, poles_from(6.9, 0.01)),
        shapes=np.column_stack([truth.shapes, np.ones(4)]),
        participation=np.vstack([truth.participation, np.ones(2)]),
    )
    found = ms.refine(data, more)
    assert len(found) == len(found.unrefined) == 3
    assert found.left_out[0].frequency == pytest.approx(6.9)
    assert "6.9 Hz" in " ".join(str(n) for n in found.notes if n.kind == "nothing of its own")
    assert np.allclose(found.poles, ms.refine(data, truth).poles, rtol=1e-9)


@pytest.mark.parametrize("kind", DATA)
@pytest.mark.parametrize("missing", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_a_missing_mode_is_added_when_that_is_asked(kind, missing):
    truth = model(4, 2)
    clean = DATA[kind](truth)
    level = 0.01 * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=0) / (1 + np.iscomplexobj(clean.values)))
    data = replace(clean, values=clean.values + level * noise_under_window(clean, np.random.default_rng(0)))
    start = truth.take(np.delete(np.arange(3), missing))
    found = ms.refine(data, start, complete=True)
    assert np.allclose(found.poles, ms.refine(data, truth).poles, rtol=1e-8)
    assert len(found.unrefined) == 3
    assert len(ms.refine(data, truth, complete=True)) == 3


def test_a_mode_that_goes_to_another_ones_place_is_told():
    truth = model(3, 3)
    data = lines(truth)
    far = replace(truth.take([0, 2]), poles=poles_from([3.0, 5.15], [0.02, 0.01]))
    found = ms.refine(data, far)
    moved = [note for note in found.notes if note.kind == "moved far"]
    assert len(moved) == int(np.any(np.abs(found.poles - far.poles) > np.abs(far.poles.real)))
    assert len(moved) == 1
    assert "5.15 to 5." in str(moved[0])
    assert not [note for note in ms.refine(data, truth).notes if note.kind == "moved far"]


def test_what_is_said_of_the_values_is_said_once_when_modes_are_refined_again():
    data = ms.systems.add_noise(samples(model(3, 2)), 0.01, seed=0)
    once = ms.refine(data, model(3, 2))
    again = ms.refine(data, once)
    assert [note.kind for note in again.notes] == [note.kind for note in once.notes]
    assert len({note.kind for note in again.notes}) == len(again.notes) > 0


def test_nothing_is_added_to_a_coloured_residual():
    truth = model(4, 2)
    data = lines(truth)
    ripple = 0.02 * np.abs(data.values).max() * np.exp(2j * np.pi * data.frequencies / 0.9)[:, None, None]
    spoilt = add_noise(replace(data, values=data.values + ripple * np.ones((1, 4, 2))), 50)
    found = ms.refine(spoilt, truth, complete=True)
    assert len(found) == 3
    assert any(note.kind == "coloured residual" for note in found.notes)


def test_what_cannot_be_refined_is_refused():
    truth = model(4, 2)
    data = samples(truth)
    refused("errors of correlations are correlated", ms.refine, replace(data, kind="correlation"), truth)
    refused("4 outputs and 2 inputs, the modes others", ms.refine, data, model(3, 2))
    refused("36 unknowns", ms.refine, replace(data, values=data.values[:4]), truth)
    refused("one positive number per line", ms.refine, lines(truth), truth, weights=np.ones(7))
    assert len(ms.refine(data, truth.take([]))) == 0


# ----------------------------------------------------------------------------------------------------- repeatability


def shifting(seed: int, inputs: int = 6) -> FrequencyResponse:
    """Return responses in which every input sees poles of its own, 1e-3 of |s| around the mean."""
    rng = np.random.default_rng(seed)
    truth = model(4, inputs)
    moved = truth.poles.imag * 1e-3 * rng.standard_normal((inputs, 3))
    columns = [
        lines(replace(truth.select(inputs=[i]), poles=truth.poles + 1j * moved[i])).values for i in range(inputs)
    ]
    data = replace(lines(truth), values=np.concatenate(columns, axis=2))
    return add_noise(data, 60, seed)


def test_poles_that_shift_from_input_to_input_scatter_as_repeatability_says():
    truth = model(4, 6)
    errors, told = [], []
    for seed in range(30):
        found = ms.refine(shifting(seed), truth)
        errors.append(found.frequencies - truth.frequencies)
        told.append(found.frequencies_repeatability)
    ratio = np.sqrt(np.mean(np.square(errors), axis=0) / np.mean(np.square(told), axis=0))
    # 30 seeds tell a ratio to 13 %, and six groups tell a deviation low by a tenth or two
    assert np.all((ratio > 0.6) & (ratio < 1.6)), ratio


def test_fewer_than_four_groups_say_nothing_and_are_told():
    truth = model(4, 6)
    data = shifting(0)
    found = ms.refine(data, truth, groups=["a", "a", "b", "b", "c", "c"])
    assert found.frequencies_repeatability is None
    assert "3 groups, 4 are needed" in " ".join(str(n) for n in found.notes if n.kind == "noise and model only")
    assert ms.refine(data, truth, groups=["a", "a", "b", "b", "c", "d"]).frequencies_repeatability is not None


def test_without_groups_the_colour_of_the_residual_widens_the_deviations():
    truth = model(4, 6)
    data = shifting(1)
    known, unknown = ms.refine(data, truth), ms.refine(data, truth, groups=None)
    assert unknown.frequencies_repeatability is None
    assert np.all(unknown.frequencies_std >= 0.99 * known.frequencies_repeatability)
    assert any(note.kind == "coloured residual" for note in unknown.notes)


# ------------------------------------------------------------------------------------------------------ measured data


@pytest.fixture(scope="module")
def beam() -> tuple[FrequencyResponse, ModalModel]:
    data = ms.read(BEAM / "beam_hammer.uff").band(100, 4300)
    return data, strong(ms.analyze(data, refine=False).modes)


def strong(modes: ModalModel) -> ModalModel:
    """Return the eight strong modes of the beam: seven that were published, and its first torsion."""
    where = (177, 477.4, 933, 1376.6, 1535.4, 2287, 3162.2, 4181.4)
    return modes.take([int(np.argmin(np.abs(modes.frequencies - f))) for f in where])


@pytest.mark.slow
def test_the_measured_beam_has_one_optimum(beam):
    data, modes = beam
    first = ms.refine(data, modes)
    for seed in range(1):
        turned = 0.3 * np.exp(2j * np.pi * np.random.default_rng(seed).uniform(size=len(modes)))
        other = ms.refine(data, replace(modes, poles=modes.poles + turned * np.abs(modes.poles.real)))
        assert np.max(np.abs(other.poles / first.poles - 1)) < 1e-8


@pytest.mark.study("refinement")
def test_the_measured_beam_has_one_optimum_from_any_row(beam, study):
    data, _ = beam
    found = []
    for method, domain in (("era", "z"), ("alternate", "s"), ("lscf", "z")):
        modes = ms.select(ms.stabilize(data, method=method, domain=domain))
        found.append(ms.refine(data, strong(modes)))
    table = study(
        "measured beam, 8 modes refined from era (z), alternate (s) and lscf (z)", "1 file, examples/beam_hammer"
    )
    apart = max(np.max(np.abs(other.poles / found[0].poles - 1)) for other in found[1:])
    table.row("relative difference of poles", apart, most=1e-8, form=".0e")
    assert not table.missed


@pytest.mark.slow
def test_repeatability_of_the_measured_beam_is_how_far_its_halves_disagree(beam):
    """All ten ways of halving six hammer points; the whole scatters by half of what two halves differ by."""
    data, modes = beam
    found = ms.refine(data, modes)
    differences = []
    for half in [(0, *pair) for pair in combinations(range(1, 6), 2)]:
        both = [list(half), [i for i in range(6) if i not in half]]
        a, b = (ms.refine(data.select(inputs=part), modes.select(inputs=part)) for part in both)
        differences.append([a.frequencies - b.frequencies, a.damping_ratios - b.damping_ratios])
    halves = np.sqrt(np.mean(np.square(differences), axis=0)) / 2
    ratio = halves / np.array([found.frequencies_repeatability, found.damping_ratios_repeatability])
    print(f"\nhalves over repeatability: f {ratio[0].round(2)}, zeta {ratio[1].round(2)}")
    assert np.all((ratio > 1 / 2.5) & (ratio < 2.5))
    assert np.all((np.median(ratio, axis=1) > 1 / 1.5) & (np.median(ratio, axis=1) < 1.5))
    # noise alone would say ten times less; what sensors disagree by is counted, and is as much
    assert 0.3 < np.median(found.frequencies_repeatability / found.frequencies_std) < 3
