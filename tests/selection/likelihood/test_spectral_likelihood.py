"""Whittle's likelihood of ambient lines: its functions by their sums, its score by differences, its information by Au's law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.towers import tower
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.ambient import (
    Driven,
    Transformed,
    begun,
    cells_of,
    deviations,
    equations,
    loss,
    moved,
    scored,
    spectrum,
    unknowns,
)
from modalscope.selection.likelihood.refine_setups import refine_setups
from tests.selection.likelihood.interval_cases import ambient

BUILT = tower(1, setups=4, minutes=20)
POLES = BUILT.modes.poles
BAND = (0.27, 5.0)
ORDERS = range(24, 57, 8)


@pytest.fixture(scope="module")
def unrefined() -> ms.ModalModel:
    return ms.analyze(BUILT.setups[0], orders=ORDERS, refine=False).modes


def test_the_functions_are_the_half_spectra_of_decays_seen_through_a_triangle() -> None:
    cells = cells_of(Transformed.of(BUILT.setups[0]), POLES, BAND)
    short = replace(cells, samples=400)
    poles = poles_from([0.5, 2.0], [0.4, 0.1])
    k = np.arange(400)
    mu = np.exp(poles / cells.rate)
    z = np.exp(2j * np.pi * cells.frequencies / cells.rate)
    summed = np.einsum("kn,kc->cn", mu ** k[:, None] * (1 - k / 400)[:, None], z ** -k[:, None]) - 0.5
    assert np.abs(mu**400).max() < 1e-12
    assert short.functions(poles) == pytest.approx(summed, rel=1e-9)
    step = 1e-6
    slopes = (short.functions(poles + step) - short.functions(poles - step)) / (2 * step)
    assert short.slopes(poles) == pytest.approx(slopes, rel=1e-5)


@pytest.mark.parametrize("samples", [200, 201, 333, 1000])
def test_cells_far_from_poles_end_with_the_lines_that_there_are(samples: int) -> None:
    record = ms.Signals(outputs=np.random.default_rng(samples).standard_normal((samples, 2)), sampling_rate=10.0)
    cells = cells_of(Transformed.of(record), poles_from([0.5], [0.001]), (0.2, 4.9))
    assert cells.frequencies[-1] < 5
    assert cells.counts.sum() < samples / 2
    assert cells.counts[-1] > 2


def test_the_score_is_the_slope_of_the_likelihood_by_every_unknown() -> None:
    cells = cells_of(Transformed.of(BUILT.setups[1]), POLES, BAND)
    own = begun(cells, POLES)
    own = Driven(own.shapes * (1 + 0.002j), own.drives * (1 + 0.001j), 3 * own.background)
    built = equations(cells, POLES, own)
    poles = 2 * len(POLES)
    assert len(built.score) == unknowns(len(POLES), 4)
    S = spectrum(cells, POLES, own)
    assert np.linalg.eigvalsh(S).min() > 0
    # the misfit counts what the unknowns take up
    left = np.linalg.solve(S, cells.values - S)
    squares = float(np.einsum("c,cab,cba->", cells.counts, left, left).real)
    assert built.misfit == pytest.approx(squares / (len(S) * S.shape[1] ** 2 - len(built.score)), rel=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(6):
        way = rng.standard_normal(len(built.score)) * np.sqrt(1 / np.diag(built.information)) * 1e-3

        def at(part: float, way: np.ndarray = way) -> float:
            step = part * way
            there = POLES + step[:poles:2] + 1j * step[1:poles:2]
            return loss(cells, there, moved(own, step[poles:]))

        assert (at(-1) - at(1)) / 2 == pytest.approx(built.score @ way, rel=2e-3, abs=1e-4)


def test_of_one_mode_in_one_channel_the_information_is_that_of_au() -> None:
    # zeta / (2 pi f T) of f, 1 / (2 pi zeta f T) of zeta: Au, Mechanical Systems and Signal Processing 48, 2014, over all lines
    rng = np.random.default_rng(3)
    f, zeta, rate, seconds = 1.0, 0.01, 10.0, 4000.0
    model = ms.StateSpace(
        A=np.array([[0, 1], [-((2 * np.pi * f) ** 2), -4 * np.pi * f * zeta]]),
        B=np.array([[0.0], [1.0]]),
        C=np.array([[0.0, 1.0]]),
    ).to_discrete(1 / rate, "held")
    y = np.asarray(model.simulate(rng.standard_normal((int(seconds * rate), 1))))
    record = ms.Signals(outputs=y + 1e-4 * y.std() * rng.standard_normal(y.shape), sampling_rate=rate)
    start = poles_from([f * 1.001], [zeta * 1.2])
    cells = cells_of(Transformed.of(record), start, (0.3, 2.5))
    found = scored([cells], start)
    assert found.converged
    assert found.misfit == pytest.approx(1, abs=0.6)  # of some forty cells
    spread = np.sqrt(np.diag(np.linalg.pinv(found.informations.sum(axis=0), hermitian=True))) / (2 * np.pi)
    # lines left out one at a time know it to 2 / sqrt(degrees of freedom) and less
    by_lines, degrees = deviations(found)
    assert np.all(degrees > 5)
    assert by_lines[0] == pytest.approx(spread[1], rel=0.5)
    # phases of shapes and drives are free here, which costs f some per cent
    assert spread[1] / f == pytest.approx(np.sqrt(zeta / (2 * np.pi * f * seconds)), rel=0.3)
    assert spread[0] / (f * zeta) == pytest.approx(np.sqrt(1 / (2 * np.pi * zeta * f * seconds)), rel=0.3)
    assert abs(found.poles[0] - poles_from([f], [zeta])[0]) / (2 * np.pi) < 4 * spread.max()


@pytest.mark.slow
def test_setups_are_refined_together_and_one_by_one() -> None:
    setups = ms.merge(BUILT.setups)
    start = replace(BUILT.modes, poles=poles_from(BUILT.modes.frequencies * 1.002, BUILT.modes.damping_ratios * 1.15))
    both = [refine_setups(setups, start, apart=apart) for apart in (False, True)]
    for found in both:
        assert found.converged
        assert found.frequencies_std is not None
        assert found.damping_ratios_std is not None
        away = (found.frequencies - BUILT.modes.frequencies) / found.frequencies_std
        assert np.sqrt(np.mean(away**2)) < 1.8  # eleven values: chance alone does not give 1.8 once in a thousand
        assert found.frequencies_repeatability is not None
        assert found.unrefined is not None
    assert np.abs(both[0].frequencies - both[1].frequencies).max() < 3 * float(np.max(both[0].frequencies_std))


def test_what_is_out_of_reach_is_kept_and_said() -> None:
    setups = ms.merge(BUILT.setups[:2])
    start = BUILT.modes.select(outputs=list(setups.output_dofs)).take([0, 1, 2])
    moved_away = replace(start, poles=poles_from([0.33, 0.9, 1.6], [0.004, 0.002, 0.002]))
    kept = refine_setups(setups, moved_away)
    assert [note.kind for note in kept.notes] == ["not refined"]
    assert np.array_equal(kept.poles, moved_away.poles)
    assert refine_setups(setups, start.take([])) is not None
    flat = [replace(part, outputs=np.asarray(part.outputs) * np.array([1, 1, 1, 0.0])) for part in BUILT.setups[:2]]
    assert (
        refine_setups(ms.merge(flat), start).notes[-1].kind == "deviations"
    )  # a dead channel tells nothing, the others do


@pytest.mark.slow
def test_a_machine_among_the_modes_is_no_part_of_them() -> None:
    t = np.arange(BUILT.setups[0].samples) / BUILT.setups[0].sampling_rate
    hum = np.sin(2 * np.pi * 1.5 * t)[:, None]
    beside = [
        replace(part, outputs=np.asarray(part.outputs) + 0.5 * np.std(part.outputs, axis=0) * hum)
        for part in BUILT.setups[:2]
    ]
    found = refine_setups(ms.merge(beside), BUILT.modes.select(outputs=list(ms.merge(beside).output_dofs)))
    # places by themselves leave it out or widen what they state
    assert found.frequencies_std is not None
    assert found.damping_ratios_std is not None
    away = (found.frequencies - BUILT.modes.frequencies) / found.frequencies_std
    turned = (found.damping_ratios - BUILT.modes.damping_ratios) / found.damping_ratios_std
    assert np.abs([away, turned]).max() < 3.5  # of 22 values


def test_lines_tell_the_score_and_the_information_and_gusts_widen_by_their_pieces() -> None:
    record, poles = ambient(801)
    f, half = np.abs(poles) / (2 * np.pi), -poles.real / (2 * np.pi)
    band = (float(np.min(f - 10 * half)), float(min(np.max(f + 10 * half), 9.8)))
    found = scored([cells_of(Transformed.of(record), poles, band)], poles)
    (told,) = found.told
    # shapes and drives share a factor, which a ridge of 1e-9 determines
    assert np.einsum("c,cab->ab", told.counts, told.cells) == pytest.approx(
        found.informations[0], rel=2e-3, abs=2e-3 * np.abs(told.cells).max()
    )
    # the model is right: the scores of lines, and of pieces, scatter as the information says
    ratio = np.trace(np.linalg.solve(found.informations[0], told.lines)) / len(told.lines)
    assert ratio == pytest.approx(1, abs=0.5)
    gusts = scored([cells_of(Transformed.of(ambient(801, gusts=1.0)[0]), poles, band)], poles)
    plain = np.sqrt([np.diag(np.linalg.pinv(each.informations[0], hermitian=True))[1::2] for each in (found, gusts)])
    wide = [deviations(each)[0][0] for each in (found, gusts)]
    assert np.mean(wide[1] / plain[1]) > 1.3 * np.mean(wide[0] / plain[0])


def test_cells_that_are_left_out_take_their_lines_with_them() -> None:
    cells = cells_of(Transformed.of(BUILT.setups[0]), POLES, BAND)
    lost = np.arange(cells.counts.size) % 3 == 0
    kept = cells.without(lost)
    for (lines, cell), (old, before) in zip(kept.views, cells.views, strict=True):
        assert np.array_equal(lines, old[~lost[before]])
        assert np.array_equal(np.flatnonzero(~lost)[cell], before[~lost[before]])
    assert np.bincount(kept.views[0][1]) == pytest.approx(kept.counts)


def test_combinations_of_outputs_tell_what_all_outputs_tell_of_the_poles() -> None:
    part = BUILT.setups[0]
    shapes = BUILT.modes.shapes[[BUILT.modes.output_dofs.index(dof) for dof in part.output_dofs]][:, :2]
    band = (0.27, 0.5)
    few, all_outputs = (
        scored([cells_of(Transformed.of(part), POLES[:2], band, own)], POLES[:2]) for own in (shapes, None)
    )
    assert cells_of(Transformed.of(part), POLES[:2], band, shapes).values.shape[1] == 2
    spread = np.sqrt(np.diag(np.linalg.pinv(all_outputs.informations[0], hermitian=True)))
    away = few.poles - all_outputs.poles
    assert np.abs(away.real) == pytest.approx(0, abs=float(spread[::2].max()))
    assert np.abs(away.imag) == pytest.approx(0, abs=float(spread[1::2].max()))
    gains = np.array([1, 1e3, 1e-3, 1])
    scaled = replace(part, outputs=np.asarray(part.outputs) * gains)
    again = scored([cells_of(Transformed.of(scaled), POLES[:2], band, shapes * gains[:, None])], POLES[:2])
    assert again.poles == pytest.approx(few.poles, rel=1e-9)


def test_analyze_refines_a_record_as_refine_does_and_keeps_what_is_better_known(unrefined: ms.ModalModel) -> None:
    record, plain = BUILT.setups[0], unrefined
    both = ms.analyze(record, orders=ORDERS).modes
    assert both.poles == pytest.approx(ms.refine(record, plain).poles, rel=1e-5)  # a straight line less
    assert plain.unrefined is None
    assert both.unrefined is not None
    assert np.array_equal(both.unrefined.poles, plain.poles)
    moved_there = both.poles != plain.poles
    assert moved_there.any()
    widths = [np.prod([np.diff(ends)[:, 0] for ends in modes.interval().values()], axis=0) for modes in (plain, both)]
    assert np.all((widths[1] < widths[0])[moved_there & np.isfinite(widths[0])])
    assert np.array_equal(widths[1][~moved_there], widths[0][~moved_there])


def test_more_than_the_modes_on_the_lines_leaves_values_that_are_known(
    unrefined: ms.ModalModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = ms.Setups(parts=BUILT.setups[:1])
    start = unrefined.take([0, 1])  # one place
    assert np.isfinite(start.interval()["frequency"]).any()
    module = "modalscope.selection.likelihood.refine_setups"
    misfit = refine_setups(record, start).notes[-1].numbers["misfit"]
    for most, stays in ((0.99 * misfit, True), (1.01 * misfit, False)):
        monkeypatch.setattr(f"{module}._MAX_QUIET_MISFIT", most)
        found = refine_setups(record, start)
        assert np.array_equal(found.poles, start.poles) == stays
        assert any("its expected variance" in note.text for note in found.notes if note.kind == "not refined") == stays
    nothing = replace(start, frequencies_std=None, damping_ratios_std=None, degrees=None)
    monkeypatch.setattr(f"{module}._MAX_QUIET_MISFIT", 0.99 * misfit)
    found = refine_setups(record, nothing)
    assert not np.array_equal(found.poles, start.poles)  # the only values with an interval
    assert "more than modes" in [note.kind for note in found.notes]


def test_a_list_that_is_out_of_reach_together_is_parted_at_its_widest_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    setups = ms.Setups(parts=BUILT.setups[:1])
    whole = refine_setups(setups, BUILT.modes)
    module = "modalscope.selection.likelihood.refine_setups"
    monkeypatch.setattr(f"{module}._MAX_PRODUCTS", 3e7)
    parted = refine_setups(setups, BUILT.modes)
    away = np.abs(parted.frequencies - whole.frequencies) / np.asarray(parted.frequencies_std)
    assert np.nanmax(away) < 2
    assert np.any(away > 0)
    monkeypatch.setattr(f"{module}._MAX_PRODUCTS", 1.0)
    (note,) = [note for note in refine_setups(setups, BUILT.modes).notes if note.kind == "not refined"]
    assert note.numbers["modes"] == len(BUILT.modes)
    assert "computing time" in note.text
