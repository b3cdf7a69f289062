"""What to measure next, so that modes are as sure as they are asked to be (`next_measurement`)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from modalscope.analysis.planning.foretold import deviations_foretold, information, slopes_left
from modalscope.data.modes import ModalModel
from modalscope.data.rebuilt import rebuilt
from modalscope.data.response import line_step
from modalscope.data.results import Result
from modalscope.data.shown import counted
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, BoolArray, RealArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.selection.judging.bare_peaks import BARE
from modalscope.selection.likelihood.joint_fit import for_judging
from modalscope.signals.doctor.polarity import driving_points

#: How often a place is measured more, at most: an eighth of the deviation.
_MOST = 64

#: Part of the strength of the others, in the median, by which all places are near a node of a mode.
_NODE = 0.02

#: Stated deviations over those of white noise beyond which other errors are added: the scatter of eight groups reaches it once in 100.
_BEYOND_NOISE = 1.6

#: What may be asked, with the words for it.
_WORDS = {
    **dict.fromkeys(("damping", "zeta"), "damping"),
    **dict.fromkeys(("f", "frequency", "frequencies"), "frequency"),
    **dict.fromkeys(("shape", "shapes", "mac"), "shape"),
}

#: The fields of modes that hold a quantity.
_FIELDS = {"damping": "damping_ratios", "frequency": "frequencies"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """Measurements at one place, and what they reach by themselves.

    Parameters
    ----------
    kind : {"repeat", "force", "sensor"}
        A place of force as before, a new place of force, a new place of a sensor.
    place : str
        Its label.
    times : int
        How often, each as long as what was measured at one place.
    minutes : float
        How long that takes, with a minute for a new place; NaN where the length of a measurement is not known.
    reached : mapping of str to array (n,)
        Foretold half widths of 95 % intervals, relative ("damping", "frequency"), and the expected MAC ("shape").
    lacking : float
        The worst of them over what was asked, of the modes that can have it: 1 or less is enough.
    """

    kind: str
    place: str
    times: int
    minutes: float
    reached: dict[str, RealArray]
    lacking: float


@dataclass(frozen=True, eq=False, kw_only=True)
class NextMeasurement:
    """What to measure next.

    Parameters
    ----------
    asked : mapping of str to float
        Half widths of 95 % intervals, relative ("damping", "frequency"), or a MAC ("shape").
    frequencies : array, (n,)
        Hz.
    now : mapping of str to array (n,)
        What is reached already; NaN for modes without an interval, which are not planned for.
    served : mapping of str to array of bool (n,)
        The modes that lack something which measurements can give: steps and plan are for these.
    steps : tuple of Step
        Each place by itself, what lowers the worst most per minute first.
    plan : mapping of (kind, place) to int
        Places that together reach what was asked in little time, and how often each is measured; none where that is not possible.
    out_of_reach : tuple of str
        What no measurement from the places that are known reaches, and why.
    notes : tuple of str
        What this rests on.
    """

    asked: dict[str, float]
    frequencies: RealArray
    now: dict[str, RealArray]
    served: dict[str, BoolArray]
    steps: tuple[Step, ...]
    plan: dict[tuple[str, str], int]
    out_of_reach: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def reached(self) -> bool:
        """Whether everything that was asked is reached already."""
        return not any(lack.size and np.nanmax(lack, initial=0) > 1 for lack in _lacking(self.now, self.asked))

    def __str__(self) -> str:
        lines = [f"Asked: {', '.join(_said(what, limit) for what, limit in self.asked.items())} (95 %)."]
        if self.reached:
            lines.append("All of it is reached: stop here.")
        for (what, values), lack in zip(self.now.items(), _lacking(self.now, self.asked), strict=True):
            short = [
                f"mode {k + 1} ({self.frequencies[k]:.5g} Hz) {_said(what, values[k])}"
                for k in np.flatnonzero(lack > 1)
            ]
            lines += [f"Now: {', '.join(short)}."] if short else []
        for number, step in enumerate(self.steps, 1):
            lines.append(f"{number}. {_order(step.kind, step.place, step.times)}{_time(step)}: {self._worst(step)}.")
        if len(self.plan) > 1:
            lines.append(f"Together: {'; '.join(_order(*one, times) for one, times in self.plan.items())}.")
        return "\n".join([*lines, *self.out_of_reach, *self.notes])

    def _worst(self, step: Step) -> str:
        """Return what a step gives the modes that lack most after it."""
        lacking = zip(self.asked, _lacking(step.reached, self.asked), strict=True)
        each = [(lack[k], what, k) for what, lack in lacking for k in np.flatnonzero(self.served[what])]
        told = sorted(each, key=lambda one: -one[0])[:_TOLD]
        return ", ".join(f"mode {k + 1} {_said(what, step.reached[what][k])}" for _, what, k in told)


@named()
def next_measurement(
    result: Result, *, ask: str = "damping 5 %", candidates: Iterable[str] | None = None
) -> NextMeasurement:
    """Say what to measure next, so that the modes of a result are as sure as asked.

    Deviations are foretold from the modes and the noise at hand (see `place`), each multiplied by what the data stated of it over what
    was foretold of the measurement at hand. Where that is above 1.6, or inputs, outputs or runs are known to disagree, what noise does
    not explain stays, however often a measurement is repeated. What a force does where a sensor was follows by reciprocity, and the other
    way round.

    Parameters
    ----------
    result : Result
        Of `analyze`, on responses to forces, in one band.
    ask : str
        Such as "damping 5 %", "f 0.1 %", "shapes 0.98", or several with commas: half widths of 95 % intervals, and the MAC that is expected
        with the true shape.
    candidates : iterable of str, optional
        Places of force or sensors that may be taken; by default all that the modes know.

    Returns
    -------
    NextMeasurement

    Raises
    ------
    DataError
        Data without forces or noise, no mode with an interval, a wish that cannot be read, places that the modes do not know.

    Examples
    --------
    >>> import modalscope as ms
    >>> from modalscope.systems import chain5
    >>> result = ms.analyze(chain5().impulse_response(300, noise=0.01, seed=0))
    >>> ms.next_measurement(result, ask="damping 90 %").reached
    True
    """
    check_kind("result", result, Result)
    asked, test = _asked(ask), _Test(result)
    every = test.candidates()
    if candidates is not None:
        wanted, known = list(candidates), dict.fromkeys(label for _, label in every)
        if unknown := [label for label in wanted if label not in known]:
            change = "Give these, or measure at the others once."
            raise DataError(f"candidates={unknown}", f"the modes know {', '.join(known) or 'no place'}", change)
        every = [each for each in every if each[1] in wanted]
    now = {what: test.reached(what, {}) for what in asked}
    best = {what: test.reached(what, dict.fromkeys(every, _MOST)) for what in asked}
    lack, left = (np.concatenate(_lacking(values, asked)) for values in (now, best))
    open_, never = lack > 1, left > 1
    may = open_ & ~never
    steps = [test.step(each, asked, may) for each in every] if may.any() else []
    worth = np.log(np.max(lack[may], initial=1.0))
    found = [s for s in steps if np.log(max(s.lacking, 1.0)) < 0.95 * worth]
    found.sort(key=lambda s: -(worth - np.log(max(s.lacking, 1.0))) / (s.minutes if s.minutes > 0 else s.times))
    return NextMeasurement(
        asked=asked,
        frequencies=test.modes.frequencies,
        now=now,
        served=dict(zip(asked, may.reshape(len(asked), -1), strict=True)),
        steps=tuple(found),
        plan=test.plan(every, asked, may) if may.any() else {},
        out_of_reach=test.why(asked, open_ & never, best),
        notes=test.notes,
    )


def _asked(ask: str) -> dict[str, float]:
    """Return what was asked, by its word."""
    found = {}
    for part in re.split(r"[,;]", ask):
        parts = re.fullmatch(r"\s*([a-z]+)\s+(\d*\.?\d+)\s*(%?)\s*", part)
        word = None if parts is None else _WORDS.get(parts[1])
        limit = 0.0 if parts is None else float(parts[2]) / (100 if parts[3] else 1)
        if word is None or not 0 < limit < 1:
            raise DataError(
                "ask", f"{part.strip()!r} cannot be read", 'Write such as "damping 5 %", "f 0.1 %" or "shapes 0.98".'
            )
        found[word] = limit
    return found


def _lacking(values: dict[str, RealArray], asked: dict[str, float]) -> list[RealArray]:
    """Return the values over what was asked, (n,) each: above one is more than that; NaN for what has no value."""
    return [
        (1 - values[what]) / (1 - limit) if what == "shape" else values[what] / limit for what, limit in asked.items()
    ]


def _said(what: str, value: float) -> str:
    return f"MAC {value:.3g}" if what == "shape" else f"{what} ±{100 * value:.2g} %"


def _order(kind: str, place: str, times: int) -> str:
    often = "once" if times == 1 else f"{times} times"
    where = f"{'sensor' if kind == 'sensor' else 'force'} at {place}"
    return f"{where}, {often} more" if kind == "repeat" else f"{where} (new), {often}"


def _time(step: Step) -> str:
    if np.isnan(step.minutes):
        return ""
    return f" ({step.minutes:.0f} min)" if step.minutes >= 2 else f" ({60 * step.minutes:.0f} s)"


#: A kind of step and its place.
_Candidate = tuple[str, str]

#: Modes that are told of a step.
_TOLD = 3


class _Test:
    """A test at hand: what its channels tell of the poles, and what others would."""

    def __init__(self, result: Result) -> None:
        self.modes = modes = result.modes
        responses = [diagram.response for diagram in result.diagrams]
        if any(response.ambient or not response.separable for response in responses) or modes.participation is None:
            change = 'Give responses to forces; of records, analyze(data, route="frf").'
            raise DataError("next_measurement", "the data are no responses to forces that act one by one", change)
        if len(responses) != 1:
            have = f"the result has diagrams of {counted(len(responses), 'band')}"
            raise DataError("next_measurement", have, "Give a result of `analyze` with one band.")
        self._response = response = responses[0]
        interval = modes.interval() if len(modes) and modes.frequencies_std is not None else None
        if interval is None or not np.isfinite(interval["frequency"]).any():
            raise DataError(
                "next_measurement",
                f"none of {counted(len(modes), 'mode')} has an interval",
                "Give a result of `analyze` with refined modes.",
            )
        keys = {"damping": "damping_ratio", "frequency": "frequency"}
        self._widths = {what: np.diff(interval[key], axis=-1)[:, 0] / 2 for what, key in keys.items()}
        left = response.values - rebuilt(response, for_judging(response, modes))
        noise = np.sqrt(np.mean(np.abs(left) ** 2, axis=0) / (2 if np.iscomplexobj(left) else 1))
        if not np.all(noise > 0):
            have = "the data have channels without noise"
            raise DataError("next_measurement", have, "Further measurements lower nothing there: give measured data.")
        shapes, drive, known = self._places(modes, noise)
        residues = np.einsum("ok,ki->oik", shapes, drive)
        self._told = information(slopes_left(response, modes.poles), residues) / self._noise[:, :, None, None] ** 2
        self._sides = np.abs(drive.T) ** 2
        strength = np.max(np.abs(residues) / self._noise[:, :, None], axis=(0, 1)) / -modes.poles.real
        self._near_node = strength < _NODE * np.median(strength)
        self._before = dict(zip(("frequency", "damping"), deviations_foretold(self._sum({}), modes.poles), strict=True))
        self._stated = {what: self._told_of(what, "std") for what in _FIELDS}
        beyond = {what: stated > _BEYOND_NOISE * self._before[what] for what, stated in self._stated.items()}
        self._noise_part = {what: np.where(beyond[what], self._before[what], self._stated[what]) for what in _FIELDS}
        self._rest = {
            what: np.sqrt(np.maximum(self._stated[what] ** 2 - self._noise_part[what] ** 2, 0)) for what in _FIELDS
        }
        planned = np.isfinite(self._widths["frequency"])
        self.notes = _rests_on(result, planned, known) + self._beyond_noise(beyond["damping"] & planned)

    def _places(self, modes: ModalModel, noise: RealArray) -> tuple[Array, Array, bool]:
        """Return shapes (L, n) and participation (n, M) of all places that are known, and whether reciprocity tells of new ones."""
        shapes, drive, points = modes.shapes, modes.known_participation("a plan"), driving_points(self._response)
        self.outputs, self.inputs, self._noise = modes.output_dofs, modes.input_dofs, noise
        if not points:
            return shapes, drive, False
        o, i = np.array([(o, i) for o, i, _ in points]).T
        modes_alone = np.arange(len(modes))
        best = np.argmax(np.abs(shapes[o].T * drive[:, i]), axis=1)
        # of one mode both sides are one shape, but for a factor
        ratio = drive[modes_alone, i[best]] / shapes[o[best], modes_alone]
        forces = [k for k in range(len(self.outputs)) if k not in o]
        sensors = [k for k in range(len(self.inputs)) if k not in i]
        shapes, drive = (
            np.vstack([shapes, drive[:, sensors].T / ratio]),
            np.hstack([drive, (shapes[forces] * ratio).T]),
        )
        self.outputs = (*self.outputs, *(self.inputs[k] for k in sensors))
        self.inputs = (*self.inputs, *(modes.output_dofs[k] for k in forces))
        rows = np.vstack([noise, np.tile(np.exp(np.log(noise).mean(axis=0)), (len(sensors), 1))])
        self._noise = np.hstack([rows, np.tile(np.exp(np.log(rows).mean(axis=1))[:, None], (1, len(forces)))])
        return shapes, drive, True

    def candidates(self) -> list[_Candidate]:
        """Return what may be measured next."""
        forces, sensors = self._by_kind
        return [
            *(("repeat", dof) for dof in forces[0]),
            *(("force", dof) for dof in forces[1]),
            *(("sensor", dof) for dof in sensors[1]),
        ]

    @property
    def _by_kind(self) -> tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]:
        """Return measured and new places of forces, and of sensors; under a roving hammer outputs of the modes are where forces act."""
        heard, driven = len(self.modes.output_dofs), len(self.modes.input_dofs)
        sides = (self.inputs[:driven], self.inputs[driven:]), (self.outputs[:heard], self.outputs[heard:])
        return sides[::-1] if self._response.exchanged else sides

    def reached(self, what: str, more: dict[_Candidate, int]) -> RealArray:
        """Return what is reached with some measurements more, (n,)."""
        modes = self.modes
        if what == "shape":
            return self._mac(more)
        now = deviations_foretold(self._sum(more), modes.poles)[what == "damping"]
        return self._width(what, self._noise_part[what] * now / self._before[what])

    def floor(self, what: str) -> RealArray:
        """Return what would be left without noise, (n,): nothing but disagreement."""
        return self._width(what, np.zeros(len(self.modes)))

    def _width(self, what: str, noise: RealArray) -> RealArray:
        """Return half widths, relative, when noise alone had a deviation."""
        groups = np.nan_to_num(self._told_of(what, "repeatability"))
        widest = np.fmax(np.hypot(noise, self._rest[what]), groups) / np.fmax(self._stated[what], groups)
        return np.asarray(self._widths[what] * widest / getattr(self.modes, _FIELDS[what]))

    def _told_of(self, what: str, kind: str) -> RealArray:
        found = getattr(self.modes, f"{_FIELDS[what]}_{kind}")
        return np.full(len(self.modes), np.nan) if found is None else np.asarray(found)

    def _beyond_noise(self, beyond: BoolArray) -> tuple[str, ...]:
        """Return a sentence on modes whose damping other errors rule."""
        times = self._stated["damping"] / self._before["damping"]
        each = [f"{self.modes.frequencies[k]:.5g} Hz: {times[k]:.2g} times" for k in np.flatnonzero(beyond)]
        says = f"Disagreement of channels, not noise, rules the damping of {counted(len(each), 'mode')}, over what noise gives"
        return (f"{says} ({', '.join(each)}). Further places and repeats lower it little.",) if each else ()

    def step(self, one: _Candidate, asked: dict[str, float], may: Array) -> Step:
        """Return a candidate measured until it is enough for some modes."""
        for times in (2**k for k in range(_MOST.bit_length())):
            reached = {what: self.reached(what, {one: times}) for what in asked}
            lacking = float(np.concatenate(_lacking(reached, asked))[may].max())
            if lacking <= 1:
                break
        minutes = self._minutes({one: times})
        return Step(kind=one[0], place=one[1], times=times, minutes=minutes, reached=reached, lacking=lacking)

    def plan(self, every: list[_Candidate], asked: dict[str, float], may: Array) -> dict[_Candidate, int]:
        """Return how often to measure where, one measurement after the other that lowers what is lacking most per minute.

        What is lacking: the mean over modes of the logarithms of what exceeds what was asked.
        """
        plan: dict[_Candidate, int] = {}
        for _ in range(_MOST * len(every)):
            lack = self._excess(plan, asked, may)
            if lack <= 0:
                return dict(sorted(plan.items(), key=lambda each: every.index(each[0])))
            spent = self._minutes(plan)
            tried = [{**plan, each: plan.get(each, 0) + 1} for each in every if plan.get(each, 0) < _MOST]
            plan = max(
                tried,
                key=lambda p: (lack - self._excess(p, asked, may)) / max(self._minutes(p) - spent, 1e-9),
                default={},
            )
            if not plan:
                break
        return {}

    def _excess(self, plan: dict[_Candidate, int], asked: dict[str, float], may: Array) -> float:
        lacking = np.concatenate(_lacking({what: self.reached(what, plan) for what in asked}, asked))[may]
        return float(np.mean(np.log(np.maximum(lacking, 1))))

    def why(self, asked: dict[str, float], never: Array, best: dict[str, RealArray]) -> tuple[str, ...]:
        """Return which modes cannot be as sure as asked, by the reason."""
        reasons: dict[str, list[str]] = {}
        modes, step = self.modes, line_step(self._response)
        half = modes.damping_ratios * modes.frequencies
        for place in np.flatnonzero(never):
            what, k = list(asked)[place // len(modes)], int(place % len(modes))
            if what != "shape" and self.floor(what)[k] > asked[what]:
                why = "places or runs disagree by this much, whatever is repeated"
            elif step > half[k]:
                why = f"lines lie {step:.2g} Hz apart, further than the half bandwidth. Measure longer"
            elif self._near_node[k]:
                why = "every place that is known is near a node. Measure at another place"
            else:
                why = f"with {_MOST} times as many measurements. Lower the noise"
            reasons.setdefault(why, []).append(
                f"mode {k + 1} ({modes.frequencies[k]:.5g} Hz) {_said(what, best[what][k])}"
            )
        return tuple(f"Out of reach: {', '.join(each)}: {why}." for why, each in reasons.items())

    def _minutes(self, more: dict[_Candidate, int]) -> float:
        """Return how long measurements take: a line's distance tells how long one took; a new sensor needs all forces again."""
        step, averages = line_step(self._response), getattr(self._response, "averages", None) or 1
        rate = getattr(self._response, "sampling_rate", None)
        seconds = averages / step if step > 0 else self._response.count / rate if rate else np.nan
        forces = len(self._by_kind[0][0])
        each = [times * (forces if kind == "sensor" else 1) for (kind, _), times in more.items()]
        return float(seconds / 60 * sum(each) + sum(kind != "repeat" for kind, _ in more))

    def _weights(self, more: dict[_Candidate, int]) -> RealArray:
        """Return how often each channel is measured, (L, M)."""
        heard, driven = len(self.modes.output_dofs), len(self.modes.input_dofs)
        weight = np.zeros(self._noise.shape)
        weight[:heard, :driven] = 1
        for (kind, dof), times in more.items():
            if (kind == "sensor") != self._response.exchanged:
                weight[self.outputs.index(dof), :driven] += times
            else:
                weight[:heard, self.inputs.index(dof)] += times
        return weight

    def _sum(self, more: dict[_Candidate, int]) -> RealArray:
        return np.asarray(np.einsum("oi,oiab->ab", self._weights(more), self._told))

    def _mac(self, more: dict[_Candidate, int]) -> RealArray:
        """Return the expected MAC of each shape with the true one: what is across it has variances that fall with sum |b|^2 / s^2."""
        modes, heard = self.modes, len(self.modes.output_dofs)
        if modes.shapes_std is None:
            return np.full(len(modes), np.nan)
        size = np.sum(np.abs(modes.shapes) ** 2, axis=0)
        away = np.sum(modes.shapes_std**2, axis=0) / size * (1 - 1 / max(heard, 2))
        told = [np.mean((self._weights(w) / self._noise**2)[:heard] @ self._sides, axis=0) for w in ({}, more)]
        return np.asarray(np.where(np.isfinite(self._widths["frequency"]), 1 - away * told[0] / told[1], np.nan))


def _rests_on(result: Result, planned: Array, reciprocal: bool) -> tuple[str, ...]:
    """Return what a plan rests on."""
    open_ = [f"{f:.5g} Hz" for f in result.modes.frequencies[~planned]]
    return (
        "Foretold for the modes of this result: those that are not seen yet are not planned for.",
        *((f"No interval, not planned for: {', '.join(open_)}.",) if open_ else ()),
        *(f"Plan for these first. {note}" for note in result.notes if note.kind == BARE),
        *(() if reciprocal else ("No driving point was measured: what a force at a new place would do is not known.",)),
    )
