"""Weigh what each column of a table is: unit, name and values are independent evidence, in log likelihoods, each with its reason.

`SURE` is a unit of times or forces, `WORD` a word of the name, `HINT` what values suggest. They add: a unit goes before a name, and two
hints before none; a word for a force goes before one for a trigger. `--columns` is evidence of infinite weight. The weights are round
numbers whose order matters alone; the study "reading" scores them on files of the grammar of exports.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from modalscope.data.units import plain_unit
from modalscope.io.columns.axis import even_sampling, in_epoch, nearly_even, rises
from modalscope.io.columns.table import Column
from modalscope.io.columns.vocabulary import INPUTS, OUTPUTS, VOLTAGES, VOLTS, meanings_of, words_of
from modalscope.io.columns.words import UNITS_OF_TURNS, kind_of_unit
from modalscope.numerics.checks import Array
from modalscope.numerics.functions.poles import QUANTITIES

#: Weights of a known unit, of a word, of a hint, and of what cannot be.
SURE, WORD, HINT, NEVER = 10.0, 6.0, 3.0, -40.0
#: What words of names speak for; a word for a sensor is weaker than one for a force, one for a counter than its values.
_OF_WORDS = {
    "time": ("time", WORD), "clock": ("time", WORD), "frequency": ("frequency", WORD), "index": ("index", HINT), "force": ("in", WORD + 1),
    "drive": ("drive", 0.0),
    "trigger": ("ignore", WORD), "sensor": ("out", HINT + 1), "other": ("ignore", WORD + 2), "spectrum": ("spectrum", 2 * SURE),
    "real": ("real", WORD), "imag": ("imag", WORD), "mag": ("mag", WORD), "phase": ("phase", WORD), "coh": ("coh", WORD),
}  # fmt: skip
_VIBRATIONS = dict.fromkeys(("acceleration", "velocity", "displacement", "strain"), 8.0)
_VIBRATIONS |= {"pressure": 6.0, "angle": 6.0, "voltage": 2.0}
#: Share of the steps of times that turn back, at most: half way from a clock (none) to a vibration (every second one).
_MAX_SHARE_OF_TURNS = 0.25
#: A step (s) below which lines never lie, in Hz, and a frequency (Hz) below which no band of lines ends: the slowest towers sway in 10 s.
_MAX_TIME_STEP, _LOWEST_BAND = 0.02, 0.2
#: A hit: values above this part of the largest take this share of the rows at most, and a quarter of that of every response.
_PART_OF_PEAK, _MAX_SHARE_OF_HIT = 0.1, 0.05
#: Something slow: mean square step over variance, and mean over deviation, of a quantity that stands still beside vibrations.
_MAX_ROUGHNESS, _MIN_OFFSET = 1e-2, 10.0
#: A faulty value lies so many times as far from the middle as nearly all; and the share of rows that such are, at most.
_FAULTY, _MAX_SHARE_OF_FAULTS = 10.0, 2e-3
#: Channels and rows that are examined for a force that others follow, and the least share: 92 % of shaker records have more, and 1 % of
#: the outputs of records without a force.
_MOST_FOLLOWED, _MOST_ROWS, _MIN_SHARE_OF_FORCE = 12, 8192, 0.9
#: Correlation of levels, and ratio of their spreads, that two responses of one structure have at least.
_MIN_LIKENESS = 0.5
#: Rows from which values are asked, relative error of sums of squares, and channels of which squares are added, at most.
_MIN_ROWS, _ROUNDED, _MOST_ADDED = 16, 1e-3, 300


@dataclass(slots=True)
class Weights:
    """Evidence on one column: kind -> sum of weights, and the strongest reason for it."""

    sums: dict[str, float] = field(default_factory=dict)
    reasons: dict[str, tuple[float, str]] = field(default_factory=dict)

    def add(self, kind: str, weight: float, reason: str) -> None:
        """Add one piece of evidence."""
        self.sums[kind] = self.sums.get(kind, 0.0) + weight
        if weight > self.reasons.get(kind, (0.0, ""))[0]:
            self.reasons[kind] = (weight, reason)

    def of(self, kind: str) -> float:
        """Return the weight of a kind; nothing speaks for or against one that is not named."""
        return self.sums.get(kind, 0.0)

    def why(self, kind: str) -> str:
        """Return the strongest reason for a kind."""
        return self.reasons.get(kind, (0.0, ""))[1]

    def best(self, kinds: Sequence[str]) -> str:
        """Return the likeliest of some kinds; the first where they are alike."""
        return max(kinds, key=self.of)


def weigh(columns: Sequence[Column]) -> dict[int, Weights]:
    """Return the evidence on every column of a table."""
    weights = {column.number: _weights_of(column, of_unit, of_name, of_values) for column in columns}
    real = [c for c in columns if not c.textual and not np.iscomplexobj(c.values)]
    for column, kind, weight, reason in (*_of_counters(real), *_of_relations(real, weights)):
        weights[column.number].add(kind, weight, reason)
    for column, kind, weight, reason in _of_drives(real, weights):
        weights[column.number].add(kind, weight, reason)
    return weights


def _weights_of(column: Column, *sources: Callable[[Column], Iterator[tuple[str, float, str]]]) -> Weights:
    """Return the evidence of some sources on one column."""
    weights = Weights()
    for source in sources:
        for kind, weight, reason in source(column):
            weights.add(kind, weight, reason)
    return weights


def role_by_words(name: str, unit: str = "") -> str:
    """Return the likeliest role by name and unit alone; nothing where neither says any.

    Examples
    --------
    >>> role_by_words("Hammer"), role_by_words("Ch 3", "lbf"), role_by_words("Ch 4"), role_by_words("Zeit")
    ('in', 'in', '', 'time')
    """
    weights = _weights_of(Column(number=1, name=name, unit=unit, values=np.zeros(0)), of_unit, of_name)
    return weights.best(("", *weights.sums))


def of_unit(column: Column) -> Iterator[tuple[str, float, str]]:
    """Give what the unit of a column says."""
    if column.textual:
        yield "ignore", 10 * SURE, "it holds text"
        return
    unit = kind_of_unit(column.unit)
    if column.stamps or unit == "time":
        yield "time", SURE, "it holds dates and times" if column.stamps else "its unit is a time"
        yield "frequency", -SURE, ""
    elif unit == "frequency" and column.unit.strip() != "1/s":
        yield "frequency", SURE, f"its unit is {column.unit}"
        yield "time", -SURE, ""
    elif unit == "force":
        yield "in", SURE, f"its unit is that of a force, {column.unit}"
    elif unit == "level":
        yield "mag", HINT, "its unit is dB"
    elif unit == "no vibration" and plain_unit(column.unit) in UNITS_OF_TURNS and even_step(_finite(column)):
        yield "frequency", SURE, f"its unit is {column.unit}"
    elif unit == "no vibration":
        yield "ignore", SURE, f"{column.unit} is no vibration"
    elif unit in _VIBRATIONS:
        yield "out", _VIBRATIONS[unit], f"its unit is that of {'an' if unit[0] in 'a' else 'a'} {unit}, {column.unit}"
        if unit == "angle":
            yield "phase", HINT, f"its unit is {column.unit}"


def of_name(column: Column) -> Iterator[tuple[str, float, str]]:
    """Give what the words of a name say; of times and forces in one name the force counts."""
    found = meanings_of(column.name)
    meanings = {meaning for meaning, _ in found}
    for meaning, word in dict(found).items():
        axis = meaning in ("time", "clock", "frequency") and meanings & {"force", "sensor", "other"}
        sensor_of_other = meaning == "other" and ("sensor" in meanings or _is_bare_voltage(column.name))
        sensor_of_other |= word in VOLTAGES and bool(meanings & {"drive", "force"})  # what drives a shaker
        trigger = meaning == "trigger" and "force" in meanings
        if not (axis or sensor_of_other or trigger):
            kind, weight = _OF_WORDS[meaning]
            if kind in ("time", "frequency"):
                yield ("frequency" if kind == "time" else "time"), -WORD, ""
            why = f"{column.unit or word} is no vibration" if kind == "ignore" else f"its name says {word!r}"
            yield kind, weight, why
    words = column.name.split()
    if not meanings & {"force", "time"} and len(words) > 1 and words[0].lower() == "in":
        yield "in", WORD, "its name says 'in'"
    if column.name.startswith("|") and column.name.endswith("|"):
        yield "mag", WORD, "its name is a magnitude"


def _of_what_turns(column: Column) -> Iterator[tuple[str, float, str]]:
    """Give what it says that values rise and fall: they are no axis."""
    yield "time", NEVER, ""
    yield "frequency", NEVER, ""
    if column.name.strip() == "f":
        yield "in", WORD, "its name is 'f', and it is no frequency"


def _is_bare_voltage(name: str) -> bool:
    """Whether a name says nothing but that a channel is a voltage, as those of sensors without a sensitivity are, or its number."""
    return {word for word in words_of(name) if not word.isdecimal()} <= VOLTAGES


def of_values(column: Column) -> Iterator[tuple[str, float, str]]:
    """Give what values say about one column by itself."""
    values = _finite(column)
    if len(values) < 3:
        return
    if not goes_one_way(values) or values[0] == values[-1]:
        yield from _of_what_turns(column)
    counted = _counts(values)
    if counted:
        yield "index", WORD, "it counts rows"
        yield "in", -SURE, ""
    else:
        yield "index", NEVER, ""
    step = even_step(values)
    yield from _of_what_rises(values, step, counted)
    if len(values) >= _MIN_ROWS and np.isin(values, (0, 1)).all() and np.ptp(values) > 0:
        yield "ignore", WORD + 1, "it is 0 or 1, as a trigger"
    if not step and not counted and _stands_still(values):
        yield "ignore", WORD, "it hardly changes, and slowly"
    if not step and _is_spectrum_like(values):
        yield "level", HINT, "it is never negative, and mostly small, as spectra are"
    if len(values) >= _MIN_ROWS and not step and values.min() >= 0 and values.max() <= 1:
        yield "coh", 1.0, "it lies between 0 and 1"


def _of_what_rises(values: Array, step: float, counted: bool) -> Iterator[tuple[str, float, str]]:
    """Give what steps say: times and frequencies rise, mostly evenly."""
    if step:
        yield "out", -1.0, ""
        if step != 1.0 or not counted:
            weight = HINT * (1 + (step < _MAX_TIME_STEP) + in_epoch(values))
            yield "time", weight, f"it rises evenly by {step:.6g}"
        low = values[-1] < _LOWEST_BAND  # lines of a band in which nothing vibrates
        yield "frequency", HINT - WORD * low, f"it rises evenly by {step:.6g}"
    elif nearly_even(values):
        short = float(np.median(np.diff(values))) < _MAX_TIME_STEP
        yield "time", HINT * (1 + short), "it rises by nearly even steps"
    elif not counted and rises(values):
        yield "frequency", 1.0, "it rises"


def _finite(column: Column) -> Array:
    """Return the real numbers of a column, none of others: channels may end early."""
    if column.textual or np.iscomplexobj(column.values):
        return np.zeros(0)
    return np.asarray(column.values[np.isfinite(column.values)])


def goes_one_way(values: Array) -> bool:
    """Whether values rise, or fall, but for a few steps, as times do; a vibration rises as often as it falls.

    Examples
    --------
    >>> goes_one_way(np.array([0.0, 0.1, 0.1, 0.2])), goes_one_way(np.sin(np.arange(50.0)))
    (True, False)
    """
    if np.iscomplexobj(values):
        return False
    with np.errstate(all="ignore"):
        steps = np.diff(values.astype(float))
    ups, downs = np.count_nonzero(steps > 0), np.count_nonzero(steps < 0)
    return bool(min(ups, downs) <= _MAX_SHARE_OF_TURNS * (ups + downs))


def counts_rows(values: Array) -> bool:
    """Whether values are whole numbers that rise by the same step from row to row.

    Examples
    --------
    >>> counts_rows(np.arange(1.0, 9.0)), counts_rows(np.array([0.0, 0.0, 3.0]))
    (True, False)
    """
    if np.iscomplexobj(values) or not np.array_equal(values, np.rint(values)):
        return False
    with np.errstate(all="ignore"):
        steps = np.diff(values.astype(float))
    return bool(steps.size and steps[0] > 0 and np.all(steps == steps[0]))


def _counts(values: Array) -> bool:
    """Whether values count rows, also such that begin anew or skip, as frames do."""
    whole = np.array_equal(values, np.rint(values))
    with np.errstate(all="ignore"):
        skips = whole and len(values) >= _MIN_ROWS and np.mean(np.diff(values.astype(float)) == 1) > 0.9
    return counts_rows(values) or bool(skips)


def even_step(values: Array) -> float:
    """Return the step of values that rise evenly; 0 of others.

    Examples
    --------
    >>> even_step(np.array([0.0, 0.5, 1.0])), even_step(np.array([0.0, 1.0, 0.5]))
    (0.5, 0.0)
    """
    if np.iscomplexobj(values) or values.size < 3 or not np.isfinite(values).all():
        return 0.0
    sampling = even_sampling(values.astype(float))
    return 0.0 if sampling is None else 1 / sampling.rate


def _stands_still(values: Array) -> bool:
    """Whether values drift slowly about a value far from zero, as temperatures and batteries do; a lone faulty value does not count."""
    finite = values[np.isfinite(values)].astype(float)
    if finite.size < _MIN_ROWS:
        return False
    middle = np.median(finite)
    off = np.abs(finite - middle)
    far = off > _FAULTY * (np.quantile(off, 0.99) + np.spacing(abs(middle)))
    if far.mean() < _MAX_SHARE_OF_FAULTS and not np.any(far[1:] & far[:-1]):  # a hit lasts longer
        finite = finite[~far]
    with np.errstate(over="ignore", invalid="ignore"):
        spread = float(finite.std())
    if abs(finite.mean()) < _MIN_OFFSET * spread or not (spread or far.any()):
        return False
    return bool(np.mean(np.diff(finite) ** 2) <= _MAX_ROUGHNESS * spread**2)


def _is_spectrum_like(values: Array) -> bool:
    """Whether values are never negative and span a range as magnitudes of spectra do; vibrations take both signs, or lie about a mean."""
    most = values.max(initial=0.0)
    return bool(len(values) >= _MIN_ROWS and 0 <= values.min() < 0.1 * most and np.median(values) < 0.3 * most)


Relation = tuple[Column, str, float, str]


def _of_relations(columns: Sequence[Column], weights: dict[int, Weights]) -> Iterator[Relation]:
    """Give what columns say about each other: magnitudes of vectors, and hits that all others answer."""
    whole = np.all([np.isfinite(c.values) for c in columns], axis=0) if columns else np.zeros(0, bool)
    if 2 * whole.sum() < len(whole) or whole.sum() < _MIN_ROWS:
        return
    measured = [replace(c, values=c.values[whole]) for c in columns if not goes_one_way(c.values[whole])]
    signed = [c for c in measured if np.min(c.values) < 0]
    others = [c for c in signed if weights[c.number].of("in") <= HINT and weights[c.number].of("ignore") <= HINT]
    are_lengths = _lengths(others)
    for column in (c for c in measured if np.min(c.values) >= 0):
        part = max(weights[column.number].of(kind) for kind in ("real", "imag", "phase")) > 0
        if not part and are_lengths(column.values):
            yield column, "ignore", 2 * SURE, "it is the magnitude of the others"
        counts = np.array_equal(column.values, np.rint(column.values))  # as numbers of features or satellites do
        if counts and not kind_of_unit(column.unit) and len(signed) == len(measured) - 1 > 0:
            yield column, "ignore", WORD, "it counts: whole numbers, none below zero"
    hit = _hit(measured)
    forces = [c for c in columns if hit is not None and c.number != hit.number and _is_force(weights[c.number])]
    if hit is not None and not forces and {meaning for meaning, _ in meanings_of(hit.name)} != {"sensor"}:
        yield hit, "in", WORD, "it is a hit that the others answer"


def _of_drives(columns: Sequence[Column], weights: dict[int, Weights]) -> Iterator[Relation]:
    """Give the voltages that drive a shaker, by their words, or by values: beside a measured force they are none, else the input."""
    every = [c for c in columns if _is_force(weights[c.number])]
    called = [c for c in columns if INPUTS.intersection(words_of(c.name))]
    if len(called) == 1 and kind_of_unit(called[0].unit) in QUANTITIES and not [c for c in every if c is not called[0]]:
        yield called[0], "in", SURE, "it is a motion that is called the input"
    moving = [c for c in columns if "drive" not in weights[c.number].sums and not goes_one_way(c.values)]
    outs = [c for c in moving if weights[c.number].best(("out", "in", "index", "ignore")) == "out"]
    sensors = [c for c in outs if kind_of_unit(c.unit) != "voltage" and weights[c.number].of("out") > HINT]
    for column in columns:
        bare, forces = _is_bare_voltage(column.name), [c for c in every if c is not column]
        voltage = kind_of_unit(column.unit) == "voltage" or (bare and not column.unit and bool(column.name))
        bare = bare or {word for word in words_of(column.name) if not word.isdecimal()} <= OUTPUTS
        answered = any(kind_of_unit(c.unit) == "force" or not _says_volts(c) for c in forces)
        measured = answered and (voltage or _says_volts(column))
        drives = "drive" in weights[column.number].sums or (measured and _is_force(weights[column.number]))
        named = drives and (voltage or not kind_of_unit(column.unit))
        others = [c for c in outs if c is not column]
        if named and not forces and others and likeliest_force([column, *others]) == (column, True):
            yield column, "in", WORD + 1, "it drives the shaker, by its name"
        elif named and not forces:
            yield column, "ignore", 2 * WORD, "it is called a drive, but the others do not follow it"
        elif named:
            yield column, "ignore", 2 * WORD, "it drives the shaker, whose force is measured"
        elif voltage and bare and forces and sensors and not _answers(column, forces[0], sensors):
            yield column, "ignore", 2 * WORD, "it is a voltage that does not answer the force as the sensors do"


def _says_volts(column: Column) -> bool:
    """Whether a channel is a voltage by its unit or its name."""
    return kind_of_unit(column.unit) == "voltage" or bool(VOLTS.intersection(words_of(column.name)))


def _answers(column: Column, force: Column, sensors: Sequence[Column]) -> bool:
    """Whether a voltage is a response as those of sensors are: relative to the force it peaks where they peak, and as high."""
    channels = [column, force, *sensors]
    if len(column.values) < _MIN_ROWS or not all(np.isfinite(c.values).all() for c in channels):
        return True
    power = np.abs(np.fft.rfft(np.stack([c.values[:_MOST_ROWS] for c in channels]).astype(float), axis=1)[:, 1:]) ** 2
    bands = np.array_split(power, max(2, min(256, power.shape[1] // 4)), axis=1)
    levels = np.log(np.stack([part.mean(axis=1) for part in bands], axis=1) + np.finfo(float).tiny)
    own, *others = levels[[0, *range(2, len(channels))]] - levels[1]
    likeness = [np.corrcoef(own, other)[0, 1] for other in others]
    spreads = levels.std(axis=1)
    return max(likeness) > _MIN_LIKENESS and bool(spreads[0] > _MIN_LIKENESS * spreads[2:].min())


def _of_counters(columns: Sequence[Column]) -> Iterator[Relation]:
    """Give the columns that count rows where another rises evenly, too, which is the axis; of counters alone one from 0 or 1."""
    even = [column for column in columns if goes_one_way(_finite(column)) and even_step(_finite(column))]
    counters = [c for c in even if counts_rows(c.values) and even_step(c.values) == 1]
    counters.sort(key=lambda c: c.values[0] not in (0, 1))
    first = [c for c in counters[:1] if len(even) > 1 and c.values[0] in (0, 1)]
    for column in counters if len(even) > len(counters) else first:
        yield column, "time", -HINT, ""
        yield column, "frequency", -HINT, ""
        yield from ((other, "index", -WORD, "") for other in even if other not in counters)


def _is_force(weights: Weights) -> bool:
    """Whether a column is likelier a force than anything else in a record."""
    return weights.of("in") > HINT and weights.best(("out", "in", "index", "ignore")) == "in"


def _lengths(others: Sequence[Column]) -> Callable[[Array], bool]:
    """Return what tells whether squares of values are sums of some others': of those whose coefficients are 1 in a least squares fit."""
    known = 0 < len(others) <= min(_MOST_ADDED, len(others[0].values) if others else 0)
    table = np.stack([c.values for c in others], axis=1).astype(float) ** 2 if known else np.full((1, 1), np.inf)
    if not np.isfinite(table).all():
        return lambda values: False
    rows = slice(None, None, 1 + len(table) // _MOST_ROWS)
    inverse = np.linalg.pinv(table[rows], rcond=np.finfo(float).eps * max(table[rows].shape))

    def are_sums(values: Array) -> bool:
        square = values.astype(float) ** 2
        if not np.isfinite(square).all():
            return False
        total = table @ np.clip(np.rint(inverse @ square[rows]), 0, 1)
        return bool(np.allclose(square, total, rtol=_ROUNDED, atol=_ROUNDED * float(square.max())))

    return are_sums


def _hit(columns: Sequence[Column]) -> Column | None:
    """Return the column of a hammer: short pulses, quiet before and after, where every other rings on."""
    if len(columns) < 2:
        return None
    shares = [_share_near_peak(column.values) for column in columns]
    order = np.argsort(shares, kind="stable")
    short, next_one = shares[order[0]], shares[order[1]]
    return columns[int(order[0])] if short <= _MAX_SHARE_OF_HIT and next_one > 4 * short else None


def _share_near_peak(values: Array) -> float:
    """Return the share of values that are farther from the middle than a part of the largest."""
    size = np.abs(values - np.median(values))
    return float(np.mean(size > _PART_OF_PEAK * size.max())) if size.max() > 0 else 1.0


def is_short(values: Array) -> bool:
    """Whether values are short pulses, quiet before and after, as forces of hammers are."""
    return _share_near_peak(values) <= _MAX_SHARE_OF_HIT


def likeliest_force(columns: Sequence[Column]) -> tuple[Column, bool]:
    """Return the column that the others follow most, and whether they do.

    The impulse response from a force to each other lies at positive lags, that back does not:
    h = F^-1(S_yu / S_uu), spectra smoothed over a fortieth of the lines; the share of its energy at positive lags within an eighth of the
    record. Where none is such it is the first.
    """
    examined = [c for c in columns if not np.iscomplexobj(c.values) and np.isfinite(c.values).all()][:_MOST_FOLLOWED]
    if len(examined) < 2 or len(examined[0].values) < _MIN_ROWS:
        return columns[0], False
    values = np.stack([c.values[:_MOST_ROWS].astype(float) for c in examined], axis=1)
    # squares of damaged numbers have no place in a float
    values = np.ldexp(values, -np.frexp(np.abs(values).max(axis=0))[1])
    values = values - values.mean(axis=0)
    rows = len(values)
    spectra = np.fft.rfft(values, 2 * rows, axis=0)
    kernel = np.full(max(3, rows // 40), 1.0)
    best = (_MIN_SHARE_OF_FORCE, columns[0])
    for k, column in enumerate(examined):
        power = np.convolve(np.abs(spectra[:, k]) ** 2, kernel, "same")
        power += 0.05 * power.mean() + np.finfo(float).tiny
        shares = []
        for other in np.delete(spectra, k, axis=1).T:
            cross = np.convolve(other * spectra[:, k].conj(), kernel, "same")
            energy = np.fft.irfft(cross / power, 2 * rows) ** 2
            ahead, behind = float(energy[: rows // 8].sum()), float(energy[-(rows // 8) :].sum())
            shares.append(ahead / max(ahead + behind, 1e-300))
        best = max(best, (min(shares), column), key=lambda pair: pair[0])
    return best[1], best[0] > _MIN_SHARE_OF_FORCE
