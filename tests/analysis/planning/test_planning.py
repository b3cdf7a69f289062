"""Places before a test, and what to measure next: foretold deviations against the likelihood and against tests that are then made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.planning.foretold import deviations_foretold, information, slopes_left
from modalscope.analysis.planning.next_measurement import _Test, not_told_apart, scatter_of_noise
from modalscope.analysis.planning.placement import _Places
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from tests.analysis.planning.planned import MODES, PLACES, Structure, labels, structure
from tests.studies import Study

analysed = partial(ms.analyze, orders=range(10, 31, 4))

# ------------------------------------------------------------------------------------------------------------ theory


def test_the_information_of_a_channel_is_that_of_numerical_slopes() -> None:
    """Second route: slopes of H by log w and log zeta as differences, residues projected out by hand, no formula of poles shared."""
    made = structure(1)
    s, p, residue = 2j * np.pi * made.frequencies, made.poles, made.shapes[4] * made.shapes[7] / (2j * made.poles.imag)

    def response(w: RealArray, zeta: RealArray) -> RealArray:
        q = w * (-zeta + 1j * np.sqrt(1 - zeta**2))
        H = (residue / (s[:, None] - q) + residue.conj() / (s[:, None] - q.conj())).sum(axis=1)
        return np.concatenate([H.real, H.imag])

    w, zeta, step = np.abs(p), -p.real / np.abs(p), 1e-6
    slopes = [
        (response(w + sign * step * e * w, zeta) - response(w - step * e * w, zeta)) / (2 * step)
        for sign in (1,)
        for e in np.eye(MODES)
    ] + [
        (response(w, zeta + step * e * zeta) - response(w, zeta - step * e * zeta)) / (2 * step) for e in np.eye(MODES)
    ]
    g, conjugate = 1 / (s[:, None] - p), 1 / (s[:, None] - p.conj())
    terms = np.stack([s**-2, np.ones(len(s))], axis=1)
    columns = np.hstack([g + conjugate, 1j * (g - conjugate), terms])
    Q = np.linalg.qr(np.concatenate([columns.real, columns.imag]))[0]
    J = np.array(slopes).T
    J = J - Q @ (Q.T @ J)
    by_hand = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    told = information(slopes_left(made.response([4], [7], 1.0, 0), p), residue)
    found = deviations_foretold(told, p)
    assert found[0] / (w / (2 * np.pi)) == pytest.approx(by_hand[:MODES], rel=1e-4)
    assert found[1] / zeta == pytest.approx(by_hand[MODES:], rel=1e-4)


def test_what_nothing_tells_has_no_deviation() -> None:
    made = structure(2)
    residues = np.where(np.arange(MODES) == 2, 0, 1.0 + 1j)
    f, zeta = deviations_foretold(
        information(slopes_left(made.response([0], [0], 1.0, 0), made.poles), residues), made.poles
    )
    assert np.isinf(f[2])
    assert np.isinf(zeta[2])
    assert np.isfinite(np.delete(f, 2)).all()


# ------------------------------------------------------------------------------------------------------------ places


@pytest.mark.parametrize("seed", [0, 39, 50])  # of the last two the first pass ends at 1.05 and 1.42 of the best
def test_places_are_as_good_as_the_best_of_all_subsets(seed: int) -> None:
    made = structure(7000 + seed)
    modes = made.modes([int(np.random.default_rng(seed).integers(PLACES))])
    found, places = ms.place(modes, sensors=3, noise=made.noise), _Places(modes, made.noise)
    best = min(places.cost([0], rows, "worst") for rows in combinations(range(PLACES), 3))
    assert found.worst <= 1.001 * best
    assert found.worst == pytest.approx(np.max(found.damping_ratios_std / modes.damping_ratios))
    assert "Sensors: " in str(found)


def test_a_model_is_driven_where_it_may_be_and_kept_places_stay() -> None:
    modes = structure(3).modes()
    found = ms.place(
        modes, sensors=4, forces=2, keep=["3:+Z"], exclude=["1:+Z", "2:+Z"], force_places=["5:+Z", "6:+Z", "7:+Z"]
    )
    assert found.sensors[0] == "3:+Z"
    assert not {"1:+Z", "2:+Z"} & set(found.sensors)
    assert set(found.forces) <= {"5:+Z", "6:+Z", "7:+Z"}
    undamped = replace(modes, poles=np.asarray(1j * modes.poles.imag, complex))
    assert np.isfinite(ms.place(undamped, sensors=2).worst)


def test_a_triaxial_sensor_is_one_place() -> None:
    modes = replace(structure(4).modes(), output_dofs=tuple(f"{k // 3}:+{'XYZ'[k % 3]}" for k in range(PLACES)))
    found = ms.place(modes, sensors=2, triaxial=True)
    assert len(found.sensors) == 6
    assert len({label.split(":")[0] for label in found.sensors}) == 2
    kept = ms.place(modes, sensors=2, triaxial=True, keep=["1:+X", "1:+Y"], exclude=["1:+Y"])
    assert kept.sensors[:3] == ("1:+X", "1:+Y", "1:+Z")
    assert len(kept.sensors) == 6


@pytest.mark.parametrize("criterion", ["A", "D", "E"])
def test_other_criteria_choose_by_the_covariance(criterion: str) -> None:
    made = structure(5)
    modes = made.modes([0])
    places, found = _Places(modes, made.noise), ms.place(modes, sensors=2, noise=made.noise, criterion=criterion)
    rows = [modes.output_dofs.index(label) for label in found.sensors]
    best = min(places.cost([0], each, criterion) for each in combinations(range(PLACES), 2))
    assert places.cost([0], rows, criterion) == pytest.approx(best)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sensors": 20}, "there are 12 places"),
        ({"sensors": 1, "keep": ["1:+Z", "2:+Z"]}, "2 kept"),
        ({"sensors": 2, "noise": [1.0, 2.0]}, "2 numbers from 1 for 12 places"),
        ({"sensors": 2, "noise": 0.0}, "numbers from 0"),
        ({"sensors": 2, "exclude": ["99:+Z"]}, "99"),
        ({"sensors": 2, "criterion": "best"}, "worst"),
    ],
)
def test_what_cannot_be_placed_is_said(options: dict[str, object], words: str) -> None:
    with pytest.raises(DataError, match=words):
        ms.place(structure(6).modes(), **options)  # type: ignore[arg-type]


# -------------------------------------------------------------------------------------------------------------- next


@pytest.fixture(scope="module")
def made() -> Structure:
    return structure(8001)


@pytest.fixture(scope="module")
def result(made: Structure) -> ms.Result:
    """Return a result of six sensors and two forces; the first sensor is where the first force is."""
    return analysed(made.response([0, 2, 4, 6, 8, 10], [0, 3], 1.0, 8001))


def test_what_is_reached_now_is_what_the_table_says(result: ms.Result) -> None:
    said = ms.next_measurement(result, ask="damping 90 %, f 50 %, shapes .5")
    low, high = result.modes.interval()["damping_ratio"].T
    assert said.now["damping"] == pytest.approx((high - low) / 2 / result.modes.damping_ratios)
    assert said.reached
    assert "All of it is reached: stop here." in str(said)
    assert not said.steps


def test_a_measurement_made_four_times_halves_the_deviation(result: ms.Result) -> None:
    test = _Test(result)
    every = {("repeat", label): 3 for label in result.modes.input_dofs}
    assert test.reached("damping", every) == pytest.approx(test.reached("damping", {}) / 2)
    assert 1 - test.reached("shape", every) == pytest.approx((1 - test.reached("shape", {})) / 4)


def test_a_force_at_a_sensor_is_foretold_by_reciprocity(made: Structure, result: ms.Result) -> None:
    """Nothing was driven at place 5; what a force there gives is known up to the noise of the shapes."""
    test, label = _Test(result), "5:+Z"
    assert ("force", label) in test.candidates()
    foretold = test.reached("damping", {("force", label): 1})
    then = _Test(analysed(made.response([0, 2, 4, 6, 8, 10], [0, 3, 4], 1.0, 8002)))
    assert then.reached("damping", {}) == pytest.approx(foretold, rel=0.15)
    assert ("sensor", "4:+Z") in test.candidates()


def test_a_roving_hammer_is_told_where_to_hit(made: Structure, result: ms.Result) -> None:
    """The same test turned round: sensors at two places, blows at six; what was a sensor is a force, and the numbers are the same."""
    data = made.response([0, 2, 4, 6, 8, 10], [0, 3], 1.0, 8001)
    turned = _Test(analysed(replace(data.transposed(), processing=())))
    test, hit = _Test(result), ("repeat", "7:+Z")
    assert turned._response.exchanged
    assert hit in turned.candidates()
    assert {place for kind, place in turned.candidates() if kind == "sensor"} == set(labels([2, 4, 6, 8, 10]))
    more = np.zeros_like(test._noise)
    more[3, :2] = 1
    twice = deviations_foretold(np.einsum("oi,oiab->ab", test._weights({}) + more, test._told), test.modes.poles)[1]
    ratio = turned.reached("damping", {hit: 1}) / turned.reached("damping", {})
    assert ratio == pytest.approx(twice / test._before["damping"], rel=0.02)
    assert turned._minutes({("sensor", "3:+Z"): 1}) == pytest.approx(6 * turned._minutes({hit: 1}) + 1)


def test_what_is_planned_reaches_what_was_asked(made: Structure, result: ms.Result) -> None:
    ask = float(np.max(_Test(result).reached("damping", {}))) / 2
    said = ms.next_measurement(result, ask=f"damping {100 * ask:.6g} %")
    assert said.plan
    assert np.max(_Test(result).reached("damping", said.plan)) <= ask * 1.00001
    assert said.steps[0].minutes > 0
    assert "1. " in str(said)
    assert str(round(100 * ask, 1)) in str(said) or f"{100 * ask:.2g}" in str(said)
    fewer = ms.next_measurement(result, ask=f"damping {100 * ask:.6g} %", candidates=["1:+Z"])
    assert {step.place for step in fewer.steps} <= {"1:+Z"}


def test_noise_of_places_scatters_as_it_was_made() -> None:
    """The deviation of 300 places is known to 4 %; of one place its channels tell it, and of three channels nobody can."""
    levels = 0.7 * np.random.default_rng(1).standard_normal((300, 2)) + [5.0, -5.0]
    assert scatter_of_noise(levels) == pytest.approx(0.7, rel=0.12)
    assert scatter_of_noise(levels[:, :1].T) == scatter_of_noise(levels[:, :1])
    assert scatter_of_noise(np.array([[0.0], [1.0], [3.0]])) == np.inf


def test_places_are_apart_by_the_deviation_of_their_difference() -> None:
    """At 80 % a normal number is .8416 deviations from its mean; a known place is apart from a known one however near it is."""
    deviations = np.array([1.0, 1.0, 1.0, 0.0])
    limit = 0.8416 * np.sqrt(2)
    assert not_told_apart(np.array([0.0, 0.01 - limit, -0.01 - limit, -0.85]), deviations) == [0, 1]
    assert not_told_apart(np.array([-0.84, -2.0, -3.0, 0.0]), deviations) == [3, 0]
    assert not_told_apart(np.array([0.0, -1e-9]), np.zeros(2)) == [0]


def test_a_place_is_as_uncertain_as_its_noise(made: Structure, result: ms.Result) -> None:
    """A new force whose channels are louder by the scatter of those measured reaches what the uncertainty says."""
    test = _Test(result)
    asked, may = {"damping": 1e-6}, np.ones(MODES, bool)
    step = test.step(("force", "5:+Z"), asked, may)
    test._noise[:, test.inputs.index("5:+Z")] *= np.exp(test.scatter["force"])
    test._told = test._told.copy()
    test._told[:, test.inputs.index("5:+Z")] /= np.exp(2 * test.scatter["force"])
    assert test.step(("force", "5:+Z"), asked, may).lacking == pytest.approx(step.lacking * np.exp(step.uncertainty))
    assert test.step(("repeat", "1:+Z"), asked, may).uncertainty == 0


def test_a_first_choice_names_all_that_noise_does_not_tell_apart(made: Structure) -> None:
    times = np.exp(np.random.default_rng(2).standard_normal((6, 2)))
    result = analysed(made.response([0, 2, 4, 6, 8, 10], [0, 3], times, 8001))
    ask = f"damping {25 * float(np.max(_Test(result).reached('damping', {}))):.6g} %"
    said = ms.next_measurement(result, ask=ask, candidates=["3:+Z", "5:+Z", "7:+Z", "9:+Z", "11:+Z"])
    assert len(said.first) > 1
    assert said.first[0] == 1
    assert f"{said.first[-1]}, whichever is easiest to reach: they cannot be told apart (80 %)" in str(said)
    assert "from place to place it differs by a factor of 1." in said.notes[-1]
    known = ms.next_measurement(result, ask=ask, candidates=["1:+Z", "4:+Z"])
    assert "First choice" not in str(known)
    single = analysed(made.response([0, 2, 4], [0], 1.0, 8001))
    few = ms.next_measurement(single, ask=ask, candidates=["3:+Z", "5:+Z"])
    assert "too few channels tell how it differs" in few.notes[-1]


def test_noise_of_other_units_says_nothing_of_a_new_place(made: Structure) -> None:
    """A strain gauge whose numbers are a million times smaller changes nothing; with two alike channels the scatter is not known."""
    data = made.response([0, 2, 4, 6, 8], [0, 3], 1.0, 8001)
    scale = np.array([1, 1, 1, 1, 1e-6])[:, None]
    units = (("m",) * 4 + ("strain",), ("N", "N"))
    result = analysed(replace(data, values=data.values * scale, units=units, quantity="displacement"))
    test, alike = _Test(result), np.log(_Test(result)._noise[:4, :2])
    new = test.outputs.index("4:+Z")
    assert test._noise[new, :2] == pytest.approx(np.exp(alike.mean(axis=0)))
    assert test.scatter["sensor"] == pytest.approx(scatter_of_noise(alike))


def test_runs_that_disagree_are_said_and_no_place_is_named(result: ms.Result) -> None:
    stated = result.modes.damping_ratios_std
    assert stated is not None
    modes = replace(
        result.modes, damping_ratios_repeatability=5 * stated, degrees=np.full((len(result.modes), 2), 5.0)
    )  # of six outputs
    said = ms.next_measurement(replace(result, modes=modes), ask="damping .1 %")
    assert "disagreement, not noise, rules: more places of the same kind will not help" in said.out_of_reach[0]
    assert not said.steps
    assert not said.reached


@pytest.mark.parametrize(("times", "disagrees"), [(1.86, False), (1.88, True)])
def test_disagreement_is_what_eight_groups_do_not_reach_by_chance(
    result: ms.Result, times: float, disagrees: bool
) -> None:
    """1.15 times the square root of a chi-square number of 7 degrees of freedom over 7, at 99 %: 1.868."""
    noise, several = _Test(result)._before["damping"], np.full((len(result.modes), 2), 7.0)
    last = np.where(np.arange(len(result.modes)) == len(result.modes) - 1, times, 1.0)
    modes = replace(result.modes, damping_ratios_std=last * noise, degrees=several)
    test = _Test(replace(result, modes=modes))
    assert test.disagree["damping"].tolist() == [*[False] * (len(modes) - 1), disagrees]
    often = {("repeat", label): 3 for label in result.modes.input_dofs}
    ratio = test.reached("damping", often) / test.reached("damping", {})
    assert ratio == pytest.approx([*[0.5] * (len(modes) - 1), 1.0 if disagrees else 0.5])
    lines = replace(
        modes, degrees=np.full((len(modes), 2), 7.5)
    )  # no count of groups: noise of lines itself is that wide
    assert not _Test(replace(result, modes=lines)).disagree["damping"].any()


def test_coarse_lines_are_made_finer(made: Structure, result: ms.Result) -> None:
    """Lines that tell each mode need no longer record; with every tenth line left the narrowest mode asks for one."""
    assert not _Test(result).longer() or made.frequencies[1] * 2 > (made.poles.real / -2 / np.pi).min()
    data = made.response([0, 2, 4, 6, 8, 10], [0, 3], 1.0, 8001)
    kept = {"values": data.values[::5], "frequencies": data.frequencies[::5]}
    few = _Test(analysed(replace(data, **kept, coherence=np.full(kept["values"].shape, 0.999))))
    half, step = few.modes.damping_ratios * few.modes.frequencies, 5 * (made.frequencies[1] - made.frequencies[0])
    (longer,) = few.longer()
    times = int(np.ceil(2 * step / half.min()))
    assert longer == ("longer", f"{step / times:.3g} Hz")
    assert few._minutes({longer: 1}) == pytest.approx(2 * times / step / 60)
    # lines without gaps between them sum to the integral: beyond a factor of two they tell no more of one blow
    (wide,) = np.flatnonzero(half == half.max())
    known = few.reached("damping", {("repeat", label): 1 for label in few.modes.input_dofs})
    assert few.reached("damping", {longer: 1})[wide] == pytest.approx(known[wide], rel=0.1)
    assert np.all(few.reached("damping", {longer: 4}) < few.reached("damping", {longer: 1}))
    assert np.all(few.reached("damping", {longer: 1}) < few.reached("damping", {}))


def test_modes_without_an_interval_are_not_planned_for(result: ms.Result) -> None:
    degrees = np.full((len(result.modes), 2), 50.0)
    degrees[1] = 0
    said = ms.next_measurement(replace(result, modes=replace(result.modes, degrees=degrees)), ask="damping 1 %")
    assert np.isnan(said.now["damping"][1])
    assert f"{result.modes.frequencies[1]:.5g} Hz" in str(said.notes)


@pytest.mark.parametrize("ask", ["dmping 5 %", "damping", "damping 0 %", "damping 120 %", "damping 5 %,", "shapes 2"])
def test_a_wish_that_cannot_be_read_is_said(result: ms.Result, ask: str) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        ms.next_measurement(result, ask=ask)


def test_other_data_are_answered(result: ms.Result) -> None:
    with pytest.raises(DataError, match=r"the modes have 1:\+Z"):
        ms.next_measurement(result, candidates=["99:+Z"])
    with pytest.raises(DataError, match=r"candidates=\[\]"):
        ms.next_measurement(result, candidates=[])
    with pytest.raises(DataError, match="shapes without deviations"):
        ms.next_measurement(replace(result, modes=replace(result.modes, shapes_std=None)), ask="shapes .9")
    with pytest.raises(DataError, match=r"diagrams of (no band|0 bands)"):
        ms.next_measurement(replace(result, diagrams=()))
    with pytest.raises(DataError, match="has an interval"):
        ms.next_measurement(replace(result, modes=replace(result.modes, frequencies_std=None)))
    ambient = ms.Signals(outputs=np.random.default_rng(0).standard_normal((3000, 2)), sampling_rate=10.0)
    with pytest.raises(DataError, match="no responses to forces"):
        ms.next_measurement(ms.analyze(ambient))


# ------------------------------------------------------------------------------------------------------------- study


@pytest.mark.study("planning")
def test_a_hundred_structures(study: Callable[[str, str], Study]) -> None:
    told = study("structures of 5 modes at 12 places, noise by place 1 : 10", "100 seeds, 8000 to 8099")
    over, rules, foretold, asked, spent = (list[float]() for _ in range(5))
    for seed in range(8000, 8100):
        made, rng = structure(seed), np.random.default_rng(seed)
        modes = made.modes([int(rng.integers(PLACES))])
        costs, found = _Places(modes, made.noise), ms.place(modes, sensors=4, noise=made.noise)
        best = min(costs.cost([0], rows, "worst") for rows in combinations(range(PLACES), 4))
        over.append(found.worst / best)
        rules.append(found.compared["effective independence"] / best)
        sensors = rng.choice(PLACES, 6, replace=False).tolist()
        forces = sensors[:2]
        first = ms.analyze(made.response(sensors, forces, 1.0, seed))
        if len(first.modes) < MODES:
            continue
        test = _Test(first)
        ask = float(np.max(test.reached("damping", {}))) / 2.5
        places = dict.fromkeys(label for _, label in test.candidates())  # no longer records
        plan = ms.next_measurement(first, ask=f"damping {100 * ask:.6g} %", candidates=places).plan
        uniform = next(n for n in range(1, 65) if np.max(_repeated(test, labels(forces), n)) <= ask)
        spent.append(sum(plan.values()) / (2 * uniform))
        driven = [*forces, *(k for k in sensors if ("force", labels([k])[0]) in plan)]
        times = [(k in forces) + sum(n for (_, label), n in plan.items() if label == labels([k])[0]) for k in driven]
        then = ms.analyze(made.response(sensors, driven, np.array(times, float), seed + 1))
        if len(then.modes) == MODES:
            reached = _Test(then).reached("damping", {})
            foretold.extend(reached / test.reached("damping", plan))
            asked.append(float(np.max(reached)) / ask)
    within = float(np.mean(np.abs(np.array(foretold) - 1) < 0.15))
    told.row("worst damping over the best of all subsets", np.max(over), most=1.1)
    told.row("that of effective independence, median", float(np.median(rules)), least=1.0)
    told.row("deviations within 15 % of what was foretold", within, least=0.9)
    told.row("tests that reach what was asked, to a tenth", float(np.mean(np.array(asked) <= 1.1)), least=0.9)
    told.row("plans with no more measurements than an even one", float(np.mean(np.array(spent) <= 1)), least=0.95)
    told.row("measurements over those of an even plan, median", float(np.median(spent)), most=1.0)


def _repeated(test: _Test, forces: tuple[str, ...], times: int) -> RealArray:
    return test.reached("damping", {("repeat", label): times for label in forces})
