"""Free decays are told from vibration under forces by what few exponentials explain of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from modalscope.data.kind_of_test import kind_of_test
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.damped_tones import (
    blow_out_of_silence,
    decay_of,
    decays_of,
    held_until,
    release_of,
    slower,
    unexplained_by_decay,
    without_offset,
)

F, ZETA = np.array([1.7, 4.1, 6.6]), np.array([0.006, 0.01, 0.004])
SHAPES = np.array([[1.0, 0.8, -0.5], [0.6, -1.0, 0.9]])


def exponents() -> RealArray:
    w = 2 * np.pi * F
    return np.asarray(-ZETA * w + 1j * w * np.sqrt(1 - ZETA**2))


def decay(samples: int, rate: float, before: int = 0, noise: float = 0.0) -> RealArray:
    """Return a decay of three modes at two points, with silence before the release."""
    t = np.arange(samples - before) / rate
    y = np.vstack([np.zeros((before, 2)), np.exp(np.outer(t, exponents())).real @ SHAPES.T])
    return np.asarray(y + noise * np.abs(y).max() * np.random.default_rng(0).standard_normal(y.shape))


def ambient(samples: int, rate: float, level: RealArray | None = None) -> RealArray:
    """Return the vibration of the same modes under white forces of a level."""
    rng = np.random.default_rng(1)
    y = np.zeros((samples, 2))
    for pole, shape in zip(np.exp(exponents() / rate), SHAPES.T, strict=True):
        force = rng.standard_normal(samples) * (1.0 if level is None else level)
        y += signal.lfilter([1.0], [1, -2 * pole.real, abs(pole) ** 2], force)[:, None] * shape
    return y


def test_as_many_exponentials_as_there_are_explain_all_and_fewer_do_not() -> None:
    y = decay(800, 20.0)
    assert unexplained_by_decay(y, 6) < 1e-12
    assert unexplained_by_decay(y, 4) > 1e-3


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_no_unit_of_a_channel_decides_where_a_decay_begins_and_what_it_leaves(unit: float) -> None:
    y = decay(2000, 20.0, before=400, noise=0.01)
    one, other = release_of(y), release_of(y * [1.0, unit])
    assert one is not None
    assert other == pytest.approx(one, rel=1e-9)


def test_a_decay_begins_at_its_release() -> None:
    release = release_of(decay(2000, 20.0, before=400, noise=0.01))
    assert release is not None
    assert 400 <= release[0] <= 410
    assert release[1] < 0.02
    first = release_of(decay(2000, 20.0))
    assert first is not None
    assert first[0] <= 10


def test_a_blow_out_of_silence_is_a_decay_of_many_modes_at_once_and_vibration_before_it_is_none() -> None:
    rng = np.random.default_rng(4)
    f, zeta = rng.uniform(5, 400, 25), rng.uniform(0.01, 0.03, 25)
    s = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
    t = np.arange(4000) / 1000.0
    struck = np.exp(np.outer(t, s)).real @ rng.standard_normal((25, 3))
    quiet = np.vstack([np.zeros((500, 3)), struck]) + 1e-3 * rng.standard_normal((4500, 3))
    found = decay_of(quiet)
    assert found is not None
    assert found.first == 500
    moving = quiet + 0.05 * np.abs(struck).max() * rng.standard_normal((4500, 3))
    assert blow_out_of_silence(moving) == 0


@pytest.mark.parametrize("rate", [20.0, 200.0])
def test_a_structure_that_is_held_aside_and_let_go_decays_from_its_release_on(rate: float) -> None:
    samples, before = int(100 * rate), int(15 * rate)
    free = decay(samples, rate, before)
    held = free + np.where(np.arange(samples) < before, 1.0, 0.0)[:, None] * free[before] + [5.0, -2.0]
    held += 0.01 * np.random.default_rng(5).standard_normal(held.shape)
    assert release_of(without_offset(held)) is None  # what is held is as large as what moves
    found = decay_of(held)
    assert found is not None
    assert before <= found.first <= before + 2 * rate / F[0]
    assert found.unexplained < 0.02
    assert np.all(np.abs(found.samples.mean(axis=0)) < 0.02)  # about where it comes to rest
    assert kind_of_test(held[None], None) == "free decay"


def test_runs_of_one_structure_are_decays_together_where_noise_hides_it_in_one() -> None:
    rng = np.random.default_rng(3)
    runs = np.stack([decay(1200, 20.0)] * 3)
    runs += 0.02 * np.abs(runs).max() * rng.standard_normal(runs.shape)
    runs[1] *= 0.4
    runs[1] += 0.02 * np.abs(runs[0]).max() * rng.standard_normal(runs[1].shape)
    assert [decay_of(run) is not None for run in runs] == [True, False, True]
    found = decays_of(runs)
    assert found is not None
    assert [each.samples.shape for each in found] == [found[0].samples.shape] * 3
    assert np.corrcoef(found[0].samples[:, 0], found[2].samples[:, 0])[0, 1] > 0.9
    vibration = np.stack([decay(1200, 20.0), ambient(1200, 20.0), ambient(1200, 20.0)])
    assert decays_of(vibration) is None
    assert decays_of(np.stack([ambient(1200, 20.0)] * 2)) is None


def test_what_moves_from_its_beginning_on_is_not_held() -> None:
    assert held_until(decay(2000, 20.0, noise=0.01)) == 0
    assert held_until(decay(2000, 20.0, before=400, noise=0.01)) == 0
    assert held_until(ambient(3000, 20.0)) == 0


@pytest.mark.parametrize("samples", [3000, 20000])
def test_vibration_under_forces_is_no_decay(samples: int) -> None:
    assert release_of(ambient(samples, 20.0)) is None
    passing = np.exp(-(((np.arange(samples) / samples - 0.4) / 0.1) ** 2))
    assert release_of(ambient(samples, 20.0, passing)) is None


def test_noise_a_lasting_tone_a_dead_channel_and_a_short_record_are_none() -> None:
    rng = np.random.default_rng(2)
    tone = np.sin(0.3 * np.arange(3000))[:, None]
    assert release_of(rng.standard_normal((3000, 2))) is None
    assert release_of(tone + 0.01 * rng.standard_normal((3000, 1))) is None
    assert release_of(np.zeros((3000, 2))) is None
    assert release_of(decay(90, 20.0)) is None


def test_a_record_far_beyond_its_modes_is_slowed_and_its_exponents_stand() -> None:
    y, step = slower(decay(60_000, 2000.0, noise=1e-4))
    assert step > 50
    assert unexplained_by_decay(y[:800], 6) < 1e-4
    same, one = slower(decay(800, 20.0))
    assert one == 1
    assert np.array_equal(same, decay(800, 20.0))


def test_the_kind_of_a_test() -> None:
    rng = np.random.default_rng(3)
    hit = np.zeros((1, 400, 1))
    hit[:, 20:23] = 1.0
    y = rng.standard_normal((1, 400, 2))
    assert kind_of_test(y, hit) == "hammer"
    assert kind_of_test(y, rng.standard_normal((1, 400, 1))) == "shaker"
    assert kind_of_test(y, None) == "ambient"
    assert kind_of_test(np.stack([decay(800, 20.0)] * 2), None) == "free decay"
    assert kind_of_test(np.stack([decay(800, 20.0), ambient(800, 20.0)]), None) == "ambient"


def random_record(kind: str, rng: np.random.Generator) -> RealArray:
    """Return a record of a random structure: 1 to 12 modes over a decade and a third, .1 to 3 %, 1 to 6 points, some decay times long."""
    n, points = int(rng.integers(1, 13)), int(rng.integers(1, 7))
    f, zeta, shapes = 10 ** rng.uniform(0, 1.3, n), 10 ** rng.uniform(-3, -1.5, n), rng.standard_normal((points, n))
    rate, tau = f.max() * rng.uniform(2.6, 8), 1 / (2 * np.pi * np.median(zeta * f))
    s = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
    if kind.startswith("decay"):
        samples = min(int(rng.uniform(1, 10) * tau * rate), 30_000)
        phases = np.exp(2j * np.pi * rng.random(n)) * rng.standard_normal(n)
        y = (np.exp(np.outer(np.arange(samples) / rate, s)) * phases).real @ shapes.T
        if kind == "decay before":
            y = np.vstack([np.zeros((int(rng.uniform(0.05, 1) * samples), points)), y])
        noise = {"decay": 3e-4, "decay before": 7e-4, "decay noisy": 0.017}[kind] * np.abs(y).max()
        return np.asarray(y + noise * rng.standard_normal(y.shape))
    times = {"ambient": (20, 200), "ambient short": (3, 20), "event": (20, 200), "coda": (5, 60)}[kind]
    samples = min(int(rng.uniform(*times) * tau * rate), 30_000)
    x = np.linspace(0, 1, samples)
    level = {"event": np.exp(-(((x - 0.4) / 0.05) ** 2)) + 0.02, "coda": np.exp(-8 * x) * np.minimum(x / 0.03, 1)}
    before = 0 if kind in level else min(int(8 * tau * rate), 30_000)
    forces = (
        rng.standard_normal((before + samples, 4)) * np.r_[np.ones(before), level.get(kind, np.ones(samples))][:, None]
    )
    y = np.zeros((samples, points))
    for pole, shape, part, at in zip(np.exp(s / rate), shapes.T, rng.standard_normal((n, 4)), f, strict=True):
        q = signal.lfilter([pole.imag], [1, -2 * pole.real, abs(pole) ** 2], forces @ part)
        y += q[before:, None] * shape / at
    return y + 0.02 * y.std() * rng.standard_normal(y.shape)


@pytest.mark.study("checks")
def test_decays_are_told_from_ambient_vibration_and_events() -> None:
    rng = np.random.default_rng(20)
    bounds = {"decay": 0.95, "decay before": 0.93, "decay noisy": 0.85}
    bounds |= {"ambient": -0.0, "ambient short": -0.12, "event": -0.05, "coda": -0.15}
    for kind, bound in bounds.items():
        share = np.mean([kind_of_test(random_record(kind, rng)[None], None) == "free decay" for _ in range(100)])
        print(f"{kind}: {100 * share:.0f} of 100 taken as free decays")
        assert share >= bound if kind.startswith("decay") else share <= -bound


def test_an_offset_is_told_from_a_tone_that_has_not_died_away() -> None:
    """The plain mean of 28 periods that fade by a third holds 4e-3 of the tone; a Hann mean leaves a cube of that."""
    t = np.arange(2000) / 100
    y = np.exp(-0.02 * t) * np.cos(9 * t)
    assert np.abs(without_offset(y + 5) - y).max() < 1e-4
    assert np.abs(np.mean(y)) > 1e-3
