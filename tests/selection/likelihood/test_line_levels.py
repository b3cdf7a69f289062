"""Levels of lines: even noise and errors that are a part of the response, and weak modes beside strong ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics import statistics
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood import line_levels, settling, whitening
from modalscope.selection.likelihood.line_levels import parts_of_level, rows_of_lines
from tests.selection.likelihood.weak_first import weak_first
from tests.studies import Study

COUNT = 600


def likelihood(power: RealArray, level: RealArray) -> RealArray:
    return -np.sum(np.log(level) + power / level, axis=0)


def peaks(channels: int, seed: int = 0) -> RealArray:
    """Squares of a response over five decades, (F, c)."""
    x, rng = np.linspace(0, 1, COUNT), np.random.default_rng(seed)
    size = sum(1e-5 / ((x - at) ** 2 + 1e-5) for at in (0.2, 0.5, 0.9))
    return np.asarray((size**2)[:, None] * rng.uniform(0.1, 10, channels))


@pytest.mark.parametrize(
    ("a", "b"),
    [(1.0, 0.0), (0.0, 1.0), (1.0, 1e-3), (1e-6, 1.0), (1e-2, 1e-2)],
    ids=["even", "own", "few", "little", "both"],
)
def test_the_level_is_the_likeliest(a: float, b: float) -> None:
    """As likely as the truth at least, and no change of either part makes it likelier."""
    size, rng = peaks(40), np.random.default_rng(1)
    even = np.linspace(1, 3, COUNT)
    truth = a * even[:, None] + b * size
    power = truth * rng.exponential(size=size.shape)
    noise, own = parts_of_level(power, even, size)
    found = likelihood(power, noise + own)
    assert np.all(found > likelihood(power, truth) - 0.05)
    for more in (0.9, 1.1):
        assert np.all(found > likelihood(power, more * noise + own) - 0.05)
        assert np.all(found > likelihood(power, noise + more * own) - 0.05)
    assert np.allclose(noise / even[:, None], noise[0] / even[0])
    assert np.allclose(own / size, own[0] / size[0])


def test_steps_that_are_no_scoring_lower_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    size, rng = peaks(10), np.random.default_rng(2)
    power = (1e-3 + size) * rng.exponential(size=size.shape)
    best, factors = likelihood(power, sum(parts_of_level(power, np.ones(COUNT), size))), line_levels._factors
    monkeypatch.setattr(line_levels, "_factors", lambda *given: (np.full((2, len(given[0])), 1e9), factors(*given)[1]))
    reached = []
    for steps in (1, 5, 30, 300):
        monkeypatch.setattr(line_levels, "_STEPS", steps)
        reached.append(likelihood(power, sum(parts_of_level(power, np.ones(COUNT), size))))
    assert np.all(np.diff(reached, axis=0) >= -1e-9)
    assert np.allclose(reached[-1], best, atol=0.2)


def test_channels_do_not_know_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    size, rng = peaks(7), np.random.default_rng(3)
    power = (0.1 + size) * rng.exponential(size=size.shape)
    whole = parts_of_level(power, np.ones(COUNT), size)
    monkeypatch.setattr(statistics, "_NUMBERS_AT_A_TIME", 1)
    for one, other in zip(whole, parts_of_level(power, np.ones(COUNT), size), strict=True):
        assert np.array_equal(one, other)


def test_a_channel_without_any_error_has_finite_levels() -> None:
    rng = np.random.default_rng(8)
    power, size = rng.standard_normal((60, 2)) ** 2, rng.standard_normal((60, 2)) ** 2
    power[:, 1] = size[:, 1] = 0
    for part in parts_of_level(power, np.ones(60), size):
        assert np.isfinite(part).all()


@pytest.mark.parametrize("smooth", [False, True])
def test_a_row_has_the_mean_level_of_the_channels_of_its_line(smooth: bool) -> None:
    size, rng = peaks(3), np.random.default_rng(4)
    H = np.sqrt(size) * np.exp(2j * np.pi * rng.uniform(size=size.shape))
    slope = np.linspace(1, 10, COUNT)[:, None]
    level = np.sqrt(0.01 + 0.01 * size) * slope
    e = level * (rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape)) / np.sqrt(2)
    both = [np.concatenate([each.real, each.imag])[:, :, None] for each in (e, H + e)]
    rows = rows_of_lines(*both, COUNT, smooth=smooth)
    assert np.array_equal(rows[:COUNT], rows[COUNT:])
    assert np.mean(np.log(rows)) == pytest.approx(0, abs=1e-9)
    ratio = rows[:COUNT] / np.sqrt(np.mean(level**2 / np.mean(level**2, axis=0), axis=1))
    # what neither part describes is followed where all channels together are asked
    assert (np.std(np.log(ratio)) < 0.15) == smooth


def test_some_of_many_channels_tell_the_levels_and_few_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """A level of 600 channels of even noise and a part of the response is known to 1 / sqrt(2 x 600), 3 %, by each line alone."""
    rng = np.random.default_rng(5)
    e, H = rng.standard_normal((2, 2 * COUNT, 1200, 1))
    e *= 1 + np.abs(H)
    every = rows_of_lines(e, H + e, COUNT)
    monkeypatch.setattr(statistics, "_TOLD_BY", 600)
    some = rows_of_lines(e, H + e, COUNT)
    assert np.array_equal(some, rows_of_lines(e[:, ::2], (H + e)[:, ::2], COUNT))
    assert 0 < np.max(np.abs(some / every - 1)) < 0.1


# ------------------------------------------------------------------------------------------------------------ refinement


def first_settled(monkeypatch: pytest.MonkeyPatch, **options: object) -> settling.Settled:
    found: list[settling.Settled] = []
    settle = settling.settle

    def spy(*given: object, **more: object) -> settling.Settled:
        found.append(settle(*given, **more))
        return found[-1]

    monkeypatch.setattr("modalscope.selection.judging.refine.settle", spy)
    test = weak_first(2)
    modes = ms.ModalModel(
        poles=poles_from(test.frequencies, test.damping_ratios), shapes=np.ones((1, 6)), participation=np.ones((6, 1))
    )
    ms.refine(test.response, modes, **options)
    return found[0]


@pytest.mark.slow
def test_the_first_mode_is_listed_with_an_interval_that_holds() -> None:
    """It lies 46 dB below the others, whose errors are 3 %: no other level shows it."""
    test = weak_first(2)
    modes = ms.analyze(test.response).modes
    assert len(modes) == 6
    limits = modes.interval()
    (low, high), damping = limits["frequency"][0], limits["damping_ratio"][0]
    assert low < test.frequencies[0] < high
    assert damping[0] < test.damping_ratios[0] < damping[1]
    assert np.ptp(damping) < 0.4 * test.damping_ratios[0]


def test_levels_make_a_residual_white_that_was_not(monkeypatch: pytest.MonkeyPatch) -> None:
    last = first_settled(monkeypatch)
    assert last.levelled
    assert not last.colour.coloured
    assert np.ptp(last.descent.point.problem.rows) > 0


@pytest.mark.parametrize(
    ("uneven", "levelled"), [(whitening._LEVEL_DEVIATIONS, False), (whitening._LEVEL_DEVIATIONS + 1e-9, True)]
)
def test_lines_have_levels_where_white_noise_would_not_scatter_so(
    uneven: float, levelled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    optimum = settling._optimum

    def told(*given: object) -> settling.Settled:
        found = optimum(*given)
        even = np.ptp(found.descent.point.problem.rows) == 0
        return replace(found, colour=replace(found.colour, uneven=uneven, excess=2.0 if even else 0.5))

    monkeypatch.setattr(settling, "_optimum", told)
    last = first_settled(monkeypatch)
    assert last.levelled == levelled


def test_weights_that_are_given_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    weights = 1 + np.arange(len(weak_first(2).response.frequencies)) % 2
    last = first_settled(monkeypatch, weights=weights)
    assert not last.levelled
    assert len(np.unique(last.descent.point.problem.rows)) == 2


def test_errors_that_are_correlated_besides_keep_the_values_and_count_the_gains(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    optimum = settling._optimum
    monkeypatch.setattr(
        settling,
        "_optimum",
        lambda *given: replace(found := optimum(*given), colour=replace(found.colour, uneven=9.0, excess=2.0)),
    )
    last = first_settled(monkeypatch)
    monkeypatch.setattr(settling, "_uneven", lambda *_: False)
    even = first_settled(monkeypatch)
    assert not last.levelled
    assert np.array_equal(last.descent.point.poles, even.descent.point.poles)
    # the weak mode counts for what it is beside the errors of its own lines
    assert last.gain[0] > 10 * even.gain[0]


@pytest.mark.study("selection")
def test_study_of_first_modes_below_the_errors_of_others(study: Callable[[str, str], Study]) -> None:
    """Of 95 % intervals of frequency and damping both hold in 90 %."""
    listed = told = modes = false = within = 0
    for seed in range(60000, 60060):
        test = weak_first(seed)
        found = ms.analyze(test.response).modes
        limits = found.interval()
        off = np.abs(found.frequencies[:, None] - test.frequencies)
        near = np.argmin(off, axis=0)
        hit = off[near, np.arange(6)] < np.maximum(0.5 * test.damping_ratios * test.frequencies, 0.05)
        each = zip((limits["frequency"], limits["damping_ratio"]), (test.frequencies, test.damping_ratios), strict=True)
        holds = np.all([(ends[near, 0] <= true) & (true <= ends[near, 1]) for ends, true in each], axis=0)
        listed += int(hit[0])
        told += int(hit[0] and np.isfinite(limits["damping_ratio"][near[0], 0]))
        modes += int(hit.sum())
        false += len(found) - int(hit.sum())
        within += int((hit & holds).sum())
    row = study("first modes 20 to 50 dB below others with errors of .3 to 3 %", "60 tests, seeds 60000 to 60059")
    row.row("first modes listed", listed, least=58)
    row.row("first modes with an interval", told, least=57)
    row.row("modes found", f"{modes} of 360")
    row.row("false modes", false, most=0)
    row.row("both intervals hold", within, least=306)
    assert not row.missed
