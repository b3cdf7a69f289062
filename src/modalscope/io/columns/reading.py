"""Weigh readings of a table as a whole: a record over times, or responses over frequencies, and what each column is in it.

A reading's score is the sum of the log likelihoods of its columns (`weights`), of its axis, and of whether pairs of columns are responses
of a causal system: the inverse transform of H(f), f >= 0, lies at positive times (Kramers and Kronig). The best one is read. Where the
second is near, the user is asked; the options in the message are those of the two.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from modalscope.io.columns.axis import rises
from modalscope.io.columns.lines import from_decibels, phase_unit
from modalscope.io.columns.table import Column, Table, span
from modalscope.io.columns.vocabulary import meanings_of
from modalscope.io.columns.weights import HINT, NEVER, SURE, WORD, Weights, even_step, weigh
from modalscope.io.columns.words import kind_of_unit
from modalscope.numerics.checks import Array, ComplexArray, RealArray

#: What a column may be in a record, and in responses. The first is what it is when nothing speaks for any.
_IN_RECORDS = ("out", "in", "index", "ignore")
_IN_RESPONSES = ("", "real", "imag", "mag", "phase", "coh", "index", "ignore")
_BY_PLACE = "by its place: pairs are causal responses"
#: Readings this near in log likelihood are asked about: odds of 10 to 1.
NEAR = 2.3
#: Share of the energy at positive times of a causal response, from a random pair (one half) to a sure one.
_CAUSAL = 0.85
#: Columns that may be the axis, at most.
_MOST_AXES = 4
#: Pairs that are examined, and lines from which they can be.
_MOST_PAIRS, _MIN_ROWS = 6, 16


@dataclass(slots=True)
class Reading:
    """One reading of a table.

    `content`: "record" or "response". `axis`: the column of times or frequencies, None where the header says the step. `roles`,
    `reasons`: of the columns by number. `score`: log likelihood.
    """

    content: str
    axis: Column | None
    roles: dict[int, str] = field(default_factory=dict)
    reasons: dict[int, str] = field(default_factory=dict)
    score: float = 0.0

    @property
    def kind(self) -> str:
        """What the axis is of."""
        return "time" if self.content == "record" else "frequency"

    @property
    def option(self) -> str:
        """The words of `--columns` that say this reading."""
        parts = [] if self.axis is None else [f"{self.kind}={self.axis.number}"]
        order: dict[str, list[int]] = {}
        for number, role in self.roles.items():
            if role in ("in", "out", "decay"):
                order.setdefault(role, []).append(number)
            elif role in ("real", "imag", "mag", "phase", "coh"):
                parts.append(f"{role}={number}")
        return ",".join(parts + [f"{role}={span(numbers)}" for role, numbers in sorted(order.items())])


def readings(
    table: Table, columns: Sequence[Column], option_roles: Mapping[int, str], rate: float | None, content: str = ""
) -> list[Reading]:
    """Return readings of a table, the likeliest first.

    `columns`: those that may be taken. `option_roles`: what the user says. `rate`: samples per second, where a header or an option says it.
    `content`: "response" where other files of the test say that they are: columns without names are then pairs, the likeliest ones.
    """
    with np.errstate(all="ignore"):  # numbers of a file may be anything
        found = _readings(table, columns, option_roles, rate, content == "response")
    return [reading for reading in found if reading.content == content] or found


def _readings(
    table: Table, columns: Sequence[Column], option_roles: Mapping[int, str], rate: float | None, paired: bool
) -> list[Reading]:
    weights = weigh(columns)
    for number, role in table.roles.items():
        if number in weights:
            weights[number].add(role, SURE + WORD, "its array is one by its name")
    named = {"out", "decay", "real", "mag"} & set(option_roles.values())
    for column in columns:
        said = option_roles.get(column.number)
        if said is not None:
            weights[column.number].add(said, -NEVER * SURE, "said by --columns")
        elif named:
            weights[column.number].add("ignore", -NEVER * SURE, "not named in --columns")
    free = [c for c in columns if not (c.textual or _is_counter(c) or (named and c.number not in option_roles))]
    found = []
    # without a column of times or frequencies a header has to say their step
    ways = (("record", _record, rate is not None), ("response", _response, table.lines is not None))
    for content, build, stated in ways:
        kind = "time" if content == "record" else "frequency"
        axes = [column for column in free if weights[column.number].of(kind) > 0]
        axes = sorted(axes, key=lambda column: -weights[column.number].of(kind))[:_MOST_AXES]
        for axis in [*axes, None]:
            reading = Reading(content, axis)
            if axis is not None:
                reading.score += weights[axis.number].of(kind) - (HINT + 1) * (columns[0] is not axis)
                reading.reasons[axis.number] = weights[axis.number].why(kind)
                reading.roles[axis.number] = kind
                reading.score += _of_rate(axis, rate) if content == "record" else 0.0
                reading.score -= 2 * SURE * (not np.isfinite(axis.values).all())  # an axis has a value in every row
            build(reading, [c for c in columns if c is not axis], weights, stated, paired)
            if table.complex_values and content == "response":
                _pair_parts(reading)
            found.append(reading)
    return sorted(found, key=lambda reading: -reading.score)


def _is_counter(column: Column) -> bool:
    """Whether a column is a counter by its name."""
    meanings = {meaning for meaning, _ in meanings_of(column.name)}
    return "index" in meanings and not {*meanings, kind_of_unit(column.unit)} & {"time", "frequency"}


def _of_rate(axis: Column, rate: float | None) -> float:
    """Return what the rate of the header says of a column of times: whether step x rate is a power of a thousand."""
    step = even_step(axis.values)
    if rate is None or not step:
        return 0.0
    turns = step * rate * np.array([1.0, 1e-3, 1e-6, 1e-9])
    return WORD if np.any(np.abs(turns - 1) < 1e-2) and not (step == 1.0 and rate == 1000.0) else -HINT


def _take(reading: Reading, column: Column, weights: Weights, kinds: Sequence[str]) -> None:
    role = weights.best(kinds)
    reading.roles[column.number], reading.reasons[column.number] = role, weights.why(role)
    reading.score += weights.of(role)


def _record(reading: Reading, others: Sequence[Column], weights: dict[int, Weights], stated: bool, _: bool) -> None:
    """Add the columns of a record: a second column of times is ignored; parts of complex values speak against it."""
    reading.score -= WORD + 1 if reading.axis is None and not stated else 0.0
    for column in others:
        held = weights[column.number]
        parts = max(0.0, *(held.of(kind) for kind in ("real", "imag", "phase", "coh")))
        if "decay" in held.sums:
            _take(reading, column, held, ("decay",))
        elif np.iscomplexobj(column.values):
            reading.roles[column.number] = "out"
            reading.score -= SURE
        elif (reading.axis or stated) and held.of("time") > max(held.of(kind) for kind in _IN_RECORDS):
            reading.roles[column.number], reading.reasons[column.number] = "time", "a second column of times"
            reading.score += HINT
        elif held.of("spectrum") > 0:
            reading.roles[column.number] = "spectrum"
        else:
            _take(reading, column, held, _IN_RECORDS)
            unsaid = reading.roles[column.number] == "out" and held.of("out") <= 0
            reading.score -= 1.0 if unsaid and held.of("level") > 0 else 0.0
            taken = reading.roles[column.number] in ("in", "out")
            if taken and len(column.values) >= _MIN_ROWS and rises(column.values):
                reading.score -= WORD  # no vibration rises all along
            # parts of complex values are no channels, and what has a unit of frequencies counts no samples, either
            reading.score -= parts if taken else 0.0
            reading.score -= held.of("frequency") if kind_of_unit(column.unit) == "frequency" else 0.0


def _response(
    reading: Reading, others: Sequence[Column], weights: dict[int, Weights], stated: bool, paired: bool
) -> None:
    """Add the columns of responses: by name, else as pairs by their places that are causal, or `paired` for sure."""
    if reading.axis is None:
        reading.score += SURE if stated else NEVER
    for column in others:
        if np.iscomplexobj(column.values):
            reading.roles[column.number] = "complex"
            reading.score += SURE
        else:
            held = weights[column.number]
            if held.of("time") > max(HINT, *(held.of(kind) for kind in _IN_RESPONSES)):
                reading.roles[column.number], reading.reasons[column.number] = "ignore", "times beside frequencies"
                continue
            _take(reading, column, held, ("spectrum",) if held.of("spectrum") > 0 else _IN_RESPONSES)
            reading.score -= max(0.0, held.of("in"))
    held_roles = set(reading.roles.values())
    if held_roles & {"real", "imag", "complex"} and "mag" in held_roles and "phase" not in held_roles:
        for number, role in reading.roles.items():
            if role == "mag":
                reading.roles[number], reading.reasons[number] = "ignore", "a magnitude beside complex values"
    parts = {"real", "imag", "mag", "phase", "complex"}
    bare = [column for column in others if reading.roles[column.number] == ""]
    if parts & set(reading.roles.values()):
        return
    by_size = {c.number for c in others if reading.roles[c.number] == "coh" and weights[c.number].of("coh") < HINT}
    within = [column for column in others if column in bare or column.number in by_size]
    ways = [pairing_of(*layout) for layout in (*_layouts(bare), *(_layouts(within) if by_size else ()))]
    best, pairing = max(ways, key=lambda way: way[0], default=(0.0, {}))
    pairing = pairing if best > 0 or paired else {}
    reading.score += best if ways else 0.0
    magnitudes = bool(bare) and all(weights[c.number].of("level") > 0 for c in bare)
    if ways and not pairing:
        reading.score += 2 * HINT if magnitudes else -WORD
    reading.roles |= pairing
    reading.reasons |= dict.fromkeys(pairing, _BY_PLACE)


def _pair_parts(reading: Reading) -> None:
    """Take columns of which nothing is known as real and imaginary parts side by side, as a header says that values are complex."""
    parts = [number for number, role in reading.roles.items() if role in ("", "real", "imag", "mag", "phase", "coh")]
    unnamed = all(reading.reasons.get(number, "") in ("", _BY_PLACE) for number in parts)
    if parts and len(parts) % 2 == 0 and unnamed:
        reading.roles |= {number: ("real", "imag")[k % 2] for k, number in enumerate(parts)}
        reading.reasons |= dict.fromkeys(parts, "the header says that values are complex")
        reading.score += SURE


def _layouts(columns: Sequence[Column]) -> Iterator[tuple[list[Column], list[Column], list[Column]]]:
    """Give what columns may be by their places: first parts, second parts, coherences; side by side, or one kind behind the other."""
    half, third = len(columns) // 2, len(columns) // 3
    if columns:
        yield list(columns[::2]), list(columns[1::2]), []
    if half > 1 and 2 * half == len(columns):
        yield list(columns[:half]), list(columns[half:]), []
    if third and 3 * third == len(columns):
        yield list(columns[::3]), list(columns[1::3]), list(columns[2::3])
    if third > 1 and 3 * third == len(columns):
        yield list(columns[: 2 * third : 2]), list(columns[1 : 2 * third : 2]), list(columns[2 * third :])


def pairing_of(
    first: Sequence[Column], second: Sequence[Column], coherences: Sequence[Column] = ()
) -> tuple[float, dict[int, str]]:
    """Return how likely columns are pairs of parts or of magnitude and phase, and what each is then."""
    columns = [*first, *second, *coherences]
    if len(first) != len(second) or any(column.textual or len(column.values) < _MIN_ROWS for column in columns):
        return -HINT, {}
    if any(np.min(column.values) < 0 or np.max(column.values) > 1 for column in coherences):
        return -HINT, {}
    values = [(np.asarray(a.values, float), np.asarray(b.values, float)) for a, b in zip(first, second, strict=True)]
    values = values[:_MOST_PAIRS]
    if not all(np.isfinite(a).all() and np.isfinite(b).all() for a, b in values):
        return -HINT, {}
    turning = all(min(a.min(), b.min()) < 0 for a, b in values)  # two spectra of magnitudes are no parts
    ways: dict[tuple[str, str], list[ComplexArray]] = {}
    if turning:
        ways = {("real", "imag"): [a + 1j * b for a, b in values]}
    if _may_be_phases([b for _, b in values]):
        levels = any(a.min() < 0 for a, _ in values)
        sizes = [from_decibels(a) if levels else a for a, _ in values]
        degrees = any(phase_unit("", b) == "deg" for _, b in values)
        turns = [np.deg2rad(b) if degrees else b for _, b in values]
        ways["mag", "phase"] = [
            np.asarray(size * np.exp(1j * turn), complex) for size, turn in zip(sizes, turns, strict=True)
        ]
    if not ways:
        return -HINT, {}
    shares = {way: np.array([causal_share(values) for values in responses]) for way, responses in ways.items()}
    way = max(shares, key=lambda key: float(np.mean(shares[key])))
    names = {a.number: way[0] for a in first} | {b.number: way[1] for b in second}
    return _log_causal(shares[way]), names | {c.number: "coh" for c in coherences}


def _may_be_phases(phases: Sequence[Array]) -> bool:
    """Whether values lie within a turn in degrees or radians, and each goes through most of a half of it, one beyond what is no angle."""
    ends = np.array([(values.min(), values.max()) for values in phases])
    reach = np.abs(ends).max(axis=1)
    for half in (np.pi, 180.0):
        beyond = np.any((ends[:, 0] < 0) | (ends[:, 1] > 1.2 * half))
        if beyond and np.all((0.6 * half < reach) & (reach <= 2 * half + 0.01)):
            return True
    return False


def _log_causal(shares: RealArray) -> float:
    """Return the log likelihood ratio of responses against pairs of records, by the shares of their energy at positive times."""
    # two records give a share of one half, 1 % of such pairs .73 and more; of 400 simulated responses the least gave .97
    sure = np.clip((np.mean(shares) - 0.5) / (_CAUSAL - 0.5), 0, 1)
    return float(sure**2 * (WORD + HINT) - 1.0)


def causal_share(values: ComplexArray) -> float:
    """Return the share of the energy of a response at positive times, or at negative ones where that is larger (other sign of j).

    A window of Hann keeps the ends of the band from leaking to both sides.

    Examples
    --------
    >>> f = np.arange(200.0)
    >>> round(causal_share(1 / (1 - (f / 60) ** 2 + 0.04j * f / 60)), 2)
    1.0
    """
    window = np.hanning(len(values))
    times = np.abs(np.fft.ifft((values - np.mean(values)) * window, 4 * len(values))) ** 2
    half = len(times) // 2
    skipped = 6  # the main lobe of the window at time zero belongs to both sides
    early, late = float(times[skipped:half].sum()), float(times[half:-skipped].sum())
    return max(early, late) / max(early + late, 1e-300)
