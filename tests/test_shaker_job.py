"""Raw records of a shaker test to the right modes with nothing set, and what shows that something was not measured."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.shaker import Shaker, forces_of, shaker
from modalscope.data.record_residual import UNMEASURED, excess
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records, as_records
from modalscope.identification.routes import usual_route
from modalscope.numerics.functions.poles import poles_from
from tests.studies import Study


def errors(test: Shaker, modes: ms.ModalModel) -> tuple[np.ndarray, np.ndarray]:
    """Return relative errors of frequency and damping of every true mode by its nearest; infinite when it is farther than its bandwidth."""
    found = np.full((2, test.frequencies.size), np.inf)
    for j, (f, zeta) in enumerate(zip(test.frequencies, test.damping_ratios, strict=True)):
        k = int(np.argmin(np.abs(modes.frequencies - f)))
        if abs(modes.frequencies[k] - f) < 2 * f * zeta:
            found[:, j] = abs(modes.frequencies[k] / f - 1), abs(modes.damping_ratios[k] / zeta - 1)
    return found[0], found[1]


@pytest.mark.slow
def test_a_shaker_test_gives_its_modes_with_nothing_set() -> None:
    """Twelve modes of .1 to .7 %, twenty outputs, two correlated forces, 40 dB: none lost, none false, damping within 2 %."""
    test = shaker(0)
    result = ms.analyze(test.signals)
    assert result.settings[0]["route"] == "records"
    f, zeta = errors(test, result.modes)
    assert len(result.modes) == 12
    assert f.max() < 1e-4
    assert zeta.max() < 0.02
    assert not [note for note in result.notes if note.kind in (UNMEASURED, "delay")]
    diagram = result.diagram
    for true, half in zip(test.frequencies, test.frequencies * test.damping_ratios, strict=True):
        able = [n for n in diagram.orders if n >= 24]
        near = diagram.stable & (np.abs(diagram.frequencies - true) < half)
        assert sum(bool(np.any(near & (diagram.order_of_pole == n))) for n in able) >= 0.6 * len(able)


@pytest.mark.slow
def test_close_modes_that_two_shakers_drive_alike_are_two() -> None:
    """Half a half bandwidth apart under the same participation: only the shapes, and what is known of the poles, tell them."""
    rng = np.random.default_rng(0)
    s = poles_from(np.array([0.2, 0.2008, 0.31]), np.array([0.004, 0.004, 0.006]))
    A = np.zeros((6, 6))
    for i, z in enumerate(np.exp(s)):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[z.real, z.imag], [-z.imag, z.real]]
    B, C = np.kron([[1.0, 0.5], [1.0, 0.5], [-0.5, 1.0]], [[1.0], [0.0]]), rng.standard_normal((4, 6))
    u = rng.standard_normal((4000, 2))
    y = ms.StateSpace(A=A, B=B, C=C, dt=1.0).simulate(u)
    y = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    modes = ms.select(ms.stabilize(ms.Signals(outputs=y, inputs=u, sampling_rate=1.0), orders=range(2, 31, 2)))
    assert np.allclose(modes.frequencies, [0.2, 0.2008, 0.31], rtol=1e-4)
    assert np.allclose(modes.damping_ratios, [0.004, 0.004, 0.006], rtol=0.02)


@pytest.mark.slow
def test_outputs_that_come_late_give_their_modes_and_a_delay_that_is_named() -> None:
    """Three samples: the poles that stand for them are no modes, and refinement needs none of them."""
    test = shaker(0, modes=4, outputs=4, seconds=6.0)
    late = ms.Signals(outputs=test.signals.outputs[:-3], inputs=test.signals.inputs[3:], sampling_rate=1024.0)
    result = ms.analyze(late)
    f, zeta = errors(test, result.modes)
    assert len(result.modes) == 4
    assert f.max() < 1e-5
    assert zeta.max() < 0.002
    assert [note.kind for note in result.notes if note.kind in ("delay", "not refined")] == ["delay"]


@pytest.mark.study("inputs")
def test_every_band_from_gap_to_gap_gives_its_modes(study: Callable[[str, str], Study]) -> None:
    table = study("shaker test, bands of three modes from gap to gap", "1 record, seed 1")
    test = shaker(1)
    middle = (test.frequencies[1:] + test.frequencies[:-1]) / 2
    for low, high in zip(middle[:-2:3], middle[2::3], strict=True):
        inside = (test.frequencies > low) & (test.frequencies < high)
        modes = ms.analyze(test.signals, band=(low, high)).modes
        part = Shaker(test.frequencies[inside], test.damping_ratios[inside], test.shapes[:, inside], test.signals)
        f, zeta = errors(part, modes)
        band = f"{low:.0f} to {high:.0f} Hz"
        table.row(f"modes found less those of the band, {band}", len(modes) - inside.sum(), least=0, most=0)
        table.row(f"largest relative error, f, {band}", f.max(), most=1e-4, form=".1e")
        table.row(f"largest relative error, zeta, {band}", 100 * zeta.max(), most=5, form=".1f", unit=" %")
    assert not table.missed


@pytest.mark.study("inputs")
@pytest.mark.parametrize("kind", ["burst", "sweep", "earthquake", "stepped", "release"])
def test_any_force_will_do(kind: str, study: Callable[[str, str], Study]) -> None:
    """Settled, decayed or in the middle of it, all lines or few: what is eliminated does not ask."""
    test = shaker(2, forces=forces_of(kind))
    modes = ms.analyze(test.signals).modes
    f, zeta = errors(test, modes)
    assert modes.unrefined is not None
    table = study(f"shaker test, 12 modes, force: {kind}", "1 record, seed 2")
    table.row("modes", len(modes), least=12, most=12)
    table.row("largest relative error, f", f.max(), most=1e-4, form=".1e")
    table.row("largest relative error, zeta", 100 * zeta.max(), most=2, form=".2f", unit=" %")
    assert not table.missed
    table.row(
        "largest error of damping in standard deviations",
        np.max(zeta * test.damping_ratios / modes.damping_ratios_std),
        most=4,
        form=".1f",
    )
    assert not table.missed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "named"), [({}, False), ({"unmeasured": 0.3}, True), ({"input_noise": 0.1}, True), ({"noise": 0.1}, False)]
)
def test_what_is_left_at_the_modes_tells_what_was_not_measured(what: dict[str, float], named: bool) -> None:
    for seed in range(2):
        test = shaker(seed, modes=6, outputs=6, seconds=6.0, **what)
        diagram = ms.stabilize(test.signals, orders=range(2, 41, 2), route="records")
        assert any(note.kind == UNMEASURED for note in diagram.notes) is named


def left_at_the_modes(test: Shaker) -> tuple[float, bool]:
    """Decibels of what the best model up to order 40 leaves at the modes over what it leaves beside them, and whether that is named."""
    diagram = ms.stabilize(test.signals, orders=range(2, 41, 2), route="records")
    best = diagram.orders[int(np.argmin(diagram.fit_errors))]
    modes = ms.identify(test.signals, route="records", order=best).modes
    spectra = record_spectra(as_records(test.signals))
    left = spectra.values - spectra.of_modes(modes)
    poles = poles_from(test.frequencies, test.damping_ratios)
    level = excess(
        spectra.frequencies, np.abs(left[:, :, 0]) ** 2, spectra.values[:, :, 0], poles, 1 / spectra.durations[0], 1.0
    )
    return level.decibels, any(note.kind == UNMEASURED for note in diagram.notes)


@pytest.mark.study("inputs")
@pytest.mark.parametrize(("what", "named"), [({}, False), ({"unmeasured": 0.3}, True), ({"input_noise": 0.1}, True)])
def test_twelve_seeds_of_each_kind_are_told_apart_without_a_miss(
    what: dict[str, float], named: bool, study: Callable[[str, str], Study]
) -> None:
    tests = (shaker(100 + seed, modes=6, outputs=6, seconds=6.0, **what) for seed in range(12))
    found = np.array([left_at_the_modes(test) for test in tests])
    level = found[:, 0]
    cause = {"unmeasured": "forces not measured, 0.3", "input_noise": "noise of the inputs, 0.1"}
    name = next((cause[key] for key in what), "every force measured")
    table = study(f"what was not measured: {name}", "12 records, seeds 100 to 111")
    table.row("residual at the modes over that between them", level, form=".1f", unit=" dB")
    table.row("records with the right note or without any", np.sum(found[:, 1] == named), least=12)
    assert not table.missed


@pytest.mark.slow
def test_with_unmeasured_forces_the_way_with_instruments_is_taken_where_nothing_was_asked() -> None:
    test = shaker(0, modes=4, outputs=4, seconds=6.0, unmeasured=0.3)
    diagram = ms.stabilize(test.signals, orders=range(2, 31, 2))
    assert diagram.settings["route"] == "subspace"
    assert [note.kind for note in diagram.notes].count(UNMEASURED) == 1
    asked = ms.stabilize(test.signals, orders=range(2, 31, 2), route="records")
    assert asked.settings["route"] == "records"


def white(rng: np.random.Generator, samples: int, force: np.ndarray) -> ms.Signals:
    ss = ms.systems.chain5().state_space(dt=0.05)
    u = np.zeros((samples, ss.B.shape[1]))
    u[:, 0] = force
    return ms.Signals(
        outputs=ss.simulate(u), inputs=u[:, :1] + 0 * rng.standard_normal((samples, 1)), sampling_rate=20.0
    )


def test_the_rule_takes_responses_of_impacts_and_of_settled_periods_and_records_else() -> None:
    rng = np.random.default_rng(0)
    period = rng.standard_normal(2000)
    hits = np.zeros(8000)
    hits[[10, 4000]] = 1, 2
    assert usual_route(as_records(white(rng, 8000, rng.standard_normal(8000)))) == "records"
    assert usual_route(as_records(white(rng, 8000, np.tile(period, 4)))) == "frf"
    assert usual_route(as_records(white(rng, 4000, np.tile(period, 2)))) == "records"  # one to settle, two to average
    assert usual_route(as_records(white(rng, 8000, hits))) == "decays"  # the slowest mode goes on for longer than 4000
    died = np.zeros(40_000)
    died[[10, 20_000]] = 1, 2
    assert usual_route(as_records(white(rng, 40_000, died))) == "frf"
    for longer, route in ((25_000, "frf"), (45_000, "records")):  # cut to the shortest, but not to less than half
        two = [white(rng, n, np.r_[1.0, np.zeros(n - 1)]) for n in (20_000, longer)]
        assert usual_route(Records(runs=tuple(two))) == route


@pytest.mark.slow
def test_a_comparison_counts_votes_by_way_and_names_the_leakage() -> None:
    test = shaker(0, modes=3, outputs=4, seconds=6.0)
    found = ms.compare(test.signals, ["alternate"], orders=range(2, 25, 2), workers=1)
    assert {r.route for r in found.results} == {"records", "frf", "markov"}
    assert "leakage" in found.causes
    assert not any(r.exact for r in found.results if r.route == "frf")
    assert all(g.voters == 2 for g in found.groups)
    f, zeta = errors(test, found.modes)
    assert f.max() < 1e-4
    assert zeta.max() < 0.02
    only = ms.compare(test.signals, ["alternate"], orders=range(2, 25, 2), workers=1, route="records")
    assert {r.route for r in only.results} == {"records"}
