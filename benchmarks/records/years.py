"""Simulated years of modes, drawn as features: temperature with a knee, close pairs that cross, spoilt records, new sensors, damage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.analysis.monitoring import History, Tracks
from modalscope.numerics.checks import Array, IntArray, RealArray

#: Hz at 0 degrees: modes 1 and 2, and 5 and 6, cross as the temperature changes.
FREQUENCIES = np.array([1.20, 1.205, 2.1, 3.0, 4.00, 4.012, 5.3, 6.4])

#: Relative change of frequency per degree, above 0 degrees; below it is `KNEE` times as much.
SLOPES = -1e-4 * np.array([1.0, 5.0, 2.0, 3.0, 1.0, 4.0, 2.0, 3.0])
KNEE = 3.0

#: Relative deviation of a frequency: that of a record of ten minutes at 1 % of damping, sqrt(zeta / (8 pi f T)).
NOISE = np.sqrt(0.01 / (8 * np.pi * FREQUENCIES * 600))

#: Part of a loss of stiffness that each mode feels.
SHARE = np.array([1.0, 0.3, 0.6, 0.2, 0.8, 0.5, 0.1, 0.7])

WAYS = ("clock", "storm", "missing", "spurious", "dead", "swapped", "sign", "twice")


@dataclass
class Year:
    """A history, the true mode of each of its modes (-1 for none), the temperature, and how each record is spoilt."""

    history: History
    truth: IntArray
    temperature: RealArray
    spoilt: Array


def temperatures(hours: RealArray, draw: np.random.Generator) -> RealArray:
    """Return seasons, days and weather that wanders over three days, degrees, as a structure of 3 hours feels them."""
    air = 8 - 11 * np.cos(2 * np.pi * hours / 8766) - 4 * np.cos(2 * np.pi * (hours - 3) / 24)
    kick, weather = 3 * np.sqrt(1 - np.exp(-2 / 72)) * draw.standard_normal(hours.size), 0.0
    felt = np.full(hours.size, air[0])
    for k in range(1, hours.size):
        weather = weather * np.exp(-1 / 72) + kick[k]
        felt[k] = felt[k - 1] + (1 - np.exp(-1 / 3)) * (air[k] + weather - felt[k - 1])
    return felt


def levels(temperature: RealArray) -> RealArray:
    """Return true frequencies, (R, 8)."""
    felt = np.where(temperature > 0, temperature, KNEE * temperature)
    return FREQUENCIES * (1 + SLOPES * felt[:, None])


def year(
    records: int = 8760,
    seed: int = 0,
    *,
    spoilt: float = 0.05,
    damage: float = 0.01,
    at: float = 0.7,
    channels: int = 12,
) -> Year:
    """Draw a year, or a part of it, hour by hour; `damage`: loss of stiffness from a part of the time on."""
    draw = np.random.default_rng(seed)
    hours = np.arange(records, dtype=float)
    temperature = temperatures(hours, draw)
    true = levels(temperature) * np.where(hours[:, None] > at * records, np.sqrt(1 - damage * SHARE), 1)
    shapes = np.linalg.qr(draw.standard_normal((channels, 8)))[0].T
    gain = np.where(hours[:, None] > 0.4 * records, 1.0, np.where(np.arange(channels) < 2, 0.8, 1.0))  # two new sensors
    ways = np.where(draw.random(records) < spoilt, draw.integers(len(WAYS), size=records), -1)
    rows: list[tuple[int, int, float, float, Array]] = []
    for k in range(records):
        rows += [(k, *row) for row in _record(true[k], shapes * gain[k], WAYS[ways[k]] if ways[k] >= 0 else "", draw)]
    record, truth, f, z, u = (np.array(x) for x in zip(*rows, strict=True))
    history = History(
        times=3600 * hours,
        record=record,
        frequencies=f,
        damping_ratios=z,
        frequencies_std=f * np.where(truth >= 0, NOISE[truth], 1e-3),
        shapes=u,
        covariates={"temperature": temperature + 0.3 * draw.standard_normal(records)},
    )
    return Year(history, truth, temperature, ways)


def _record(
    true: RealArray, shapes: Array, way: str, draw: np.random.Generator
) -> list[tuple[int, float, float, Array]]:
    f = true * (1 + NOISE * draw.standard_normal(8) * (10 if way == "storm" else 1))
    z = 0.01 * np.exp(0.25 * draw.standard_normal(8)) * (2 if way == "storm" else 1)
    u = shapes + 0.05 * draw.standard_normal(shapes.shape) / np.sqrt(shapes.shape[1] / 4)
    for a, b in ((0, 1), (4, 5)):  # shapes of a pair mix as far as its frequencies cannot be told apart
        near = np.exp(-(((true[a] - true[b]) / (3 * NOISE[a] * true[a])) ** 2))
        turn = 0.3 * near * draw.standard_normal()
        u[[a, b]] = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ u[[a, b]]
    truth, u = np.arange(8), u.astype(complex) * np.exp(2j * np.pi * draw.random((8, 1)))
    if way == "clock":
        f = f * 1.01
    elif way == "dead":
        u[:, 5] = np.nan
    elif way == "swapped":
        u[:, [2, 7]] = u[:, [7, 2]]
    elif way == "sign":
        u[:, 3] *= -1
    seen = draw.random(8) < (0.5 if way == "missing" else 0.97)
    if way == "twice":
        seen = np.repeat(seen, 2)
        truth, f, z, u = (
            np.repeat(truth, 2),
            np.repeat(f, 2) * (1 + 3e-4 * draw.standard_normal(16)),
            np.repeat(z, 2),
            np.repeat(u, 2, 0),
        )
    rows = [(int(truth[k]), float(f[k]), float(z[k]), u[k]) for k in np.flatnonzero(seen)]
    for _ in range(draw.poisson(4 if way == "spurious" else 0.2)):
        other = draw.standard_normal(u.shape[1]) + 1j * draw.standard_normal(u.shape[1])
        rows.append((-1, float(np.exp(draw.uniform(0, 2))), float(0.001 * np.exp(draw.uniform(0, 4))), other))
    return [rows[k] for k in draw.permutation(len(rows))]


def judged(year: Year, track: IntArray) -> tuple[float, float, int, int]:
    """Return the parts of records and of modes whose tracks are right, the swaps, and the number of tracks beside those of the modes.

    The track of a mode is the one that has most of it. A swap: a mode of one in the track of another.
    """
    truth, record = year.truth, year.history.record
    own = [int(np.bincount(track[(truth == m) & (track >= 0)]).argmax()) for m in range(8)]
    mode_of = np.full(max(int(track.max()), *own) + 2, -1)
    mode_of[own] = np.arange(8)
    given = mode_of[track]
    real = truth >= 0
    wrong = real & (given != truth)
    swaps = int(np.count_nonzero(real & (given >= 0) & (given != truth)))
    bad = np.unique(record[wrong]).size / len(year.history)
    return 1 - bad, 1 - float(wrong[real].mean()), swaps, int(np.unique(track[track >= 0]).size) - len(set(own))


def tracked(records: int, seed: int, *, spoilt: float = 0.05, shift: float = 0.0, at: int = 0) -> Tracks:
    """Return the tracks of a time without what tracking does: true modes, a slow disturbance that nobody measures, spoilt records.

    `shift`: relative change of the frequencies of the first and the third mode from record `at` on.
    """
    draw = np.random.default_rng(seed)
    hours = np.arange(records, dtype=float)
    temperature = temperatures(hours, draw)
    slow = np.zeros((records, 8))
    kick = 0.3 * np.sqrt(1 - np.exp(-2 / 72)) * draw.standard_normal((records, 8))
    for k in range(1, records):
        slow[k] = slow[k - 1] * np.exp(-1 / 72) + kick[k]
    bad = draw.random((records, 1)) < spoilt
    f = levels(temperature) * (1 + NOISE * (slow + draw.standard_normal((records, 8)) * np.where(bad, 10, 1)))
    f[at:, [0, 2]] *= 1 + shift
    seen = draw.random((records, 8)) < 0.97
    record, mode = np.nonzero(seen)
    history = History(
        times=3600 * hours,
        record=record,
        frequencies=f[record, mode],
        shapes=np.eye(8)[mode] + 0.03 * draw.standard_normal((mode.size, 8)),
        covariates={"temperature": temperature + 0.3 * draw.standard_normal(records)},
    )
    return known(history, mode, NOISE * FREQUENCIES)


def known(history: History, mode: IntArray, scatter: RealArray) -> Tracks:
    """Return tracks as the true modes make them; -1 for modes of none. `scatter`: Hz."""
    return Tracks(
        history=history,
        track=mode,
        mode_probability=np.ones(mode.size),
        double=np.zeros(mode.size, bool),
        levels=np.ones((len(history), scatter.size)),
        scatter=scatter,
        believed=np.zeros(scatter.size, bool),
    )


#: Hz of a structure that is damaged, the relative deviation of a frequency, and the amplitude of a daily swing.
SOUND, SCATTER, SWING = np.array([1.2, 2.1, 3.0, 4.0, 5.3]), 1e-3, 5e-3

WEATHER = ("steady", "measured", "not measured")


def damaged(
    records: int,
    seed: int,
    *,
    at: int = 0,
    size: float = 0.0,
    modes: int = 5,
    weather: str = "steady",
    hours: float = 1.0,
    shapes: bool = True,
) -> tuple[History, IntArray]:
    """Draw modes, and the true one of each: the lowest lose a part `size` of their frequencies from record `at` on.

    Each is found in 97 % of the records, and one in five has a mode that is none. `weather`: a daily swing.
    """
    draw, when = np.random.default_rng(seed), hours * np.arange(records)
    swing = SWING * np.sin(2 * np.pi * when / 24) * (weather != "steady")
    part = np.where(np.arange(5) < modes, size, 0) * (np.arange(records)[:, None] >= at)
    f = SOUND * (1 + swing[:, None]) * (1 - part) * (1 + SCATTER * draw.standard_normal((records, 5)))
    own = np.linalg.qr(draw.standard_normal((8, 8)))[0][:5]
    record, truth = np.nonzero(draw.random((records, 5)) < 0.97)
    other = np.flatnonzero(draw.random(records) < 0.2)
    record, truth = np.concatenate([record, other]), np.concatenate([truth, np.full(other.size, -1)])
    order = np.argsort(record, kind="stable")
    record, truth = record[order], truth[order]
    none = truth < 0
    found = np.where(none, np.exp(draw.uniform(0, 2, truth.size)), f[record, truth])
    u = np.where(none[:, None], draw.standard_normal((truth.size, 8)), own[truth])
    air = {"temperature": 2000 * swing + 0.3 * draw.standard_normal(records)}
    history = History(
        times=3600 * when,
        record=record,
        frequencies=found,
        damping_ratios=0.01 * np.exp(0.25 * draw.standard_normal(truth.size)),
        frequencies_std=SCATTER * found,
        shapes=u + 0.05 * draw.standard_normal(u.shape) if shapes else None,
        covariates={} if weather == "not measured" else {"none": np.zeros(records)} if weather == "steady" else air,
    )
    return history, truth
