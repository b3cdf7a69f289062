"""What to measure next, so that modes are as sure as you want them (`next_measurement`)."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc, ndtri

from modalscope.analysis.planning.foretold import deviations_foretold, information, slopes_left
from modalscope.data.modes import ModalModel
from modalscope.data.rebuilt import rebuilt
from modalscope.data.response import line_step
from modalscope.data.results import Result
from modalscope.data.shown import counted, figures, percent
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, BoolArray, RealArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.selection.judging.bare_peaks import BARE
from modalscope.selection.likelihood.covariance import PARTS
from modalscope.selection.likelihood.joint_fit import for_judging
from modalscope.signals.doctor.polarity import driving_points

#: How often a place is measured more, at most: an eighth of the deviation.
_MOST = 64

#: Part of the strength of the others, in the median, by which all places are near a node of a mode.
_NODE = 0.02

#: Stated deviations are within 15 % of what noise gives (docs/validation/planning.md); beyond, a chi-square test of their groups says
#: that this is no chance.
_FORETOLD_WITHIN, _CHANCE = 1.15, 0.01

#: Probability at which one place is told from another, and channels below which their noise does not say how it scatters.
TOLD_APART, _MIN_CHANNELS = 0.8, 4

#: Lines over the half bandwidth of a mode, below which a longer record is a step.
_LINES_OF_A_HALF_BANDWIDTH = 2

#: What may be asked, with the words for it.
_WORDS = {"damping": "damping zeta", "frequency": "f frequency frequencies", "shape": "shape shapes mac"}

#: The fields of modes that hold a quantity.
_FIELDS = {"damping": "damping_ratios", "frequency": "frequencies"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Step:
    """Measurements at one place, and what they reach by themselves.

    Parameters
    ----------
    kind : {"repeat", "force", "sensor", "longer"}
        A place of force as before, a new place of force, a new place of a sensor, all forces as before with longer records.
    place : str
        Its label; of longer records the distance of their lines.
    times : int
        How often, each as long as what was measured at one place.
    minutes : float
        How long that takes, with a minute for a new place; NaN where the length of a measurement is not known.
    reached : mapping of str to array (n,)
        Foretold half widths of 95 % intervals, relative ("damping", "frequency"), and the expected MAC ("shape").
    lacking : float
        The worst of them over the wanted values, of the modes that can have it: 1 or less is enough.
    uncertainty : float
        Standard deviation of the logarithm of `lacking` from the noise of a new place, which nobody has measured; else zero.
    """

    kind: str
    place: str
    times: int
    minutes: float
    reached: dict[str, RealArray]
    lacking: float
    uncertainty: float


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
    first : tuple of int
        Numbers of the steps that may be the best: 1, and those that cannot be told from it (80 %) as noise at new places is not known.
    plan : mapping of (kind, place) to int
        Places that together reach the wanted values in little time, and how often each is measured; none where that is not possible.
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
    first: tuple[int, ...]
    plan: dict[tuple[str, str], int]
    out_of_reach: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def reached(self) -> bool:
        """Whether every wanted value is reached already, in the modes that have a deviation."""
        return all(np.any(lack <= 1) and not np.any(lack > 1) for lack in _lacking(self.now, self.asked))

    def __str__(self) -> str:
        lines = [f"Asked: {', '.join(_said(what, limit) for what, limit in self.asked.items())} (95 %)."]
        if self.reached:
            some = "" if np.isfinite([*self.now.values()]).all() else ", of the modes with an interval"
            lines.append(f"All of it is reached{some}: stop here.")
        for (what, values), lack in zip(self.now.items(), _lacking(self.now, self.asked), strict=True):
            short = [_mode(k, self.frequencies, what, values) for k in np.flatnonzero(lack > 1).tolist()]
            lines += [f"Now: {', '.join(short)}."] if short else []
        for number, step in enumerate(self.steps, 1):
            lines.append(f"{number}. {_order(step.kind, step.place, step.times)}{_time(step)}: {self._worst(step)}.")
        if len(self.first) > 1:
            either = f"{', '.join(map(str, self.first[:-1]))} or {self.first[-1]}"
            why = f"they cannot be told apart ({percent(TOLD_APART)}), as noise at new places is not known"
            lines.append(f"First choice: {either}, whichever is easiest to reach: {why}.")
        if len(self.plan) > 1:
            lines.append(f"Together: {'; '.join(_order(*one, times) for one, times in self.plan.items())}.")
        lines += ["A force twice as strong does what four measurements do."] if self.steps else []
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
    was foretold of the measurement at hand. Where that is what inputs, outputs or runs differ by, and more than chance allows (chi-square
    test, 99 %), disagreement rules the mode, and no place is named for it. What a force does where a sensor was follows by
    reciprocity, and the other way round.

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
    asked, test = asked_of(ask), _Test(result)
    every = test.candidates()
    if candidates is None:
        every += test.longer()
    else:
        wanted, known = list(candidates), dict.fromkeys(label for _, label in every)
        unknown = [label for label in wanted if label not in known]
        if unknown or not wanted:
            change = "Give these, or measure at the others once."
            have = f"the modes have {', '.join(known) or 'no place'}"
            raise DataError(f"candidates={unknown or wanted}", have, change)
        every = [each for each in every if each[1] in wanted]
    now = {what: test.reached(what, {}) for what in asked}
    best = {what: test.reached(what, dict.fromkeys(every, _MOST)) for what in asked}
    lack, left = (np.concatenate(_lacking(values, asked)) for values in (now, best))
    open_, never = lack > 1, left > 1
    may = open_ & ~never
    steps = [test.step(each, asked, may) for each in every] if may.any() else []
    worth = np.log(np.max(lack[may], initial=1.0))
    steps = [s for s in steps if np.log(max(s.lacking, 1.0)) < 0.95 * worth]
    spent = np.array([s.minutes if s.minutes > 0 else s.times for s in steps])
    lacking, doubt = (np.log([max(s.lacking * np.exp(k * s.uncertainty), 1.0) for s in steps]) for k in (0, 1))
    order = np.argsort((lacking - worth) / spent, kind="stable")
    first = not_told_apart(((worth - lacking) / spent)[order], ((doubt - lacking) / spent)[order]) if steps else []
    return NextMeasurement(
        asked=asked,
        frequencies=test.modes.frequencies,
        now=now,
        served=dict(zip(asked, may.reshape(len(asked), -1), strict=True)),
        steps=tuple(steps[k] for k in order),
        first=tuple(k + 1 for k in first),
        plan=test.plan(every, asked, may) if may.any() else {},
        out_of_reach=test.why(asked, open_ & never, best),
        notes=(*test.notes, *test.of_noise({step.kind for step in steps})),
    )


def asked_of(ask: str) -> dict[str, float]:
    """Return the wanted values by name; raise `DataError` for a wish that cannot be read."""
    found = {}
    for part in re.split(r"[,;]", ask):
        parts = re.fullmatch(r"\s*([a-z]+)\s+(\d*\.?\d+)\s*(%?)\s*", part)
        word = next((what for what, words in _WORDS.items() if parts and parts[1] in words.split()), None)
        limit = 0.0 if parts is None else float(parts[2]) / (100 if parts[3] else 1)
        if word is None or not 0 < limit < 1:
            change = 'Write such as "damping 5 %", "f 0.1 %" or "shapes 0.98", with numbers between 0 and 100 %.'
            raise DataError(f"ask={ask!r}", f"{part.strip()!r} cannot be read", change)
        found[word] = limit
    return found


def _lacking(values: dict[str, RealArray], asked: dict[str, float]) -> list[RealArray]:
    """Return the values over the wanted ones, (n,) each: above one is too much; NaN where there is no value."""
    return [
        (1 - values[what]) / (1 - limit) if what == "shape" else values[what] / limit for what, limit in asked.items()
    ]


def _said(what: str, value: float) -> str:
    digits = max(3, int(np.ceil(-np.log10(max(1 - value, 1e-6)))))
    return f"MAC {value:.{digits}g}" if what == "shape" else f"{what} ±{percent(value, 2)}"


def _mode(k: int, frequencies: RealArray, what: str, values: RealArray) -> str:
    return f"mode {k + 1} ({frequencies[k]:.5g} Hz) {_said(what, values[k])}"


def _order(kind: str, place: str, times: int) -> str:
    often = "once" if times == 1 else f"{times} times"
    if kind == "longer":
        return f"every force with longer records (lines {place} apart), {often}"
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
        self._heard, self._driven = len(modes.output_dofs), len(modes.input_dofs)
        responses = [diagram.response for diagram in result.diagrams]
        if any(response.ambient or not response.separable for response in responses) or modes.participation is None:
            change = 'Measure the forces, too, or estimate responses from those measured (route="frf").'
            raise DataError("a plan:", "the data are no responses to forces that act one by one", change)
        if len(responses) != 1:
            have = f"the result has diagrams of {counted(len(responses), 'band')}"
            raise DataError("a plan:", have, "Give a result of `analyze` with one band.")
        self._response = response = responses[0]
        interval = modes.interval() if len(modes) and modes.frequencies_std is not None else None
        if interval is None or not np.isfinite(interval["frequency"]).any():
            change = "Widen the band, or give a result of `analyze` with refined modes."
            raise DataError("a plan:", f"none of {counted(len(modes), 'mode')} has an interval", change)
        keys = {"damping": "damping_ratio", "frequency": "frequency"}
        self._widths = {what: np.diff(interval[key], axis=-1)[:, 0] / 2 for what, key in keys.items()}
        left = response.values - rebuilt(response, for_judging(response, modes))
        noise = np.sqrt(np.mean(np.abs(left) ** 2, axis=0) / (2 if np.iscomplexobj(left) else 1))
        if not np.all(noise > 0):
            have = "the data have channels without noise"
            raise DataError("a plan:", have, "Further measurements lower nothing there: give measured data.")
        shapes, drive, known = self._places(modes, noise)
        self._residues = np.einsum("ok,ki->oik", shapes, drive) / self._noise[:, :, None]
        self._told = information(slopes_left(response, modes.poles), self._residues)
        self._sides = np.abs(drive.T) ** 2
        strength = np.max(np.abs(self._residues), axis=(0, 1)) / -modes.poles.real
        self._near_node = strength < _NODE * np.median(strength)
        self._longer, self._length = self._told[0, 0], 1
        self._before = dict(zip(("frequency", "damping"), self._foretold({}), strict=True))
        self.disagree = self._disagreeing()
        self.notes = _rests_on(result, np.isfinite(self._widths["frequency"]), known)

    def _foretold(self, more: Mapping[_Candidate, float]) -> tuple[RealArray, RealArray]:
        """Return the deviations of frequencies (Hz) and damping ratios that noise gives."""
        told = np.einsum("oi,oiab->ab", self._weights(more), self._told)
        longer = sum(times for (kind, _), times in more.items() if kind == "longer")
        return deviations_foretold(told + longer * self._longer, self.modes.poles)

    def _disagreeing(self) -> dict[str, BoolArray]:
        """Return the modes whose deviation comes from groups that differ by more than noise gives; for a shape, as for its frequency.

        The widest of noise, lines and groups is stated. Where it is that of groups (outputs, inputs, channels, parts in time, runs), its
        degrees of freedom are one less than their number.
        """
        heard, driven = self._heard, self._driven
        counts = np.array([heard, driven, heard * driven, PARTS, len(set(self._response.groups or ()))])
        found = {}
        for k, what in enumerate(("frequency", "damping")):
            degrees = np.zeros(len(self.modes)) if self.modes.degrees is None else self.modes.degrees[:, k]
            of_groups = (degrees > 0) & np.isin(degrees, counts - 1)
            squares = (self._stated(what) / self._before[what] / _FORETOLD_WITHIN) ** 2
            found[what] = of_groups & (chdtrc(degrees, degrees * squares) < _CHANCE)
        return {**found, "shape": found["frequency"]}

    def _places(self, modes: ModalModel, noise: RealArray) -> tuple[Array, Array, bool]:
        """Return shapes (L, n) and participation (n, M) of all places that are known, and whether reciprocity tells of new ones."""
        shapes, drive, points = modes.shapes, modes.known_participation("a plan"), driving_points(self._response)
        self.outputs, self.inputs, self._noise = modes.output_dofs, modes.input_dofs, noise
        self.scatter: dict[str, float] = {}
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
        # channels of other units say nothing of the noise at new places
        levels, units = np.log(noise), zip(self._response.units, (o[0], i[0]), strict=True)
        heard, driven = ([k for k, unit in enumerate(side) if unit == side[at]] for side, at in units)
        rows = np.vstack([levels, np.tile(levels[heard].mean(axis=0), (len(sensors), 1))])
        self._noise = np.exp(np.hstack([rows, np.tile(rows[:, driven].mean(axis=1)[:, None], (1, len(forces)))]))
        kinds = ("force", "sensor") if self._response.exchanged else ("sensor", "force")
        new = zip(kinds, (sensors, forces), (levels[heard], levels[:, driven].T), strict=True)
        self.scatter = {kind: scatter_of_noise(known) for kind, places, known in new if places}
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
        both = (self.inputs, self._driven), (self.outputs, self._heard)
        sides = tuple((labels[:measured], labels[measured:]) for labels, measured in both)
        return sides[::-1] if self._response.exchanged else sides

    def of_noise(self, kinds: set[str]) -> Iterator[str]:
        """Yield what is known of the noise at new places, of steps of some kinds."""
        if new := [scatter for kind, scatter in self.scatter.items() if kind in kinds]:
            factor = f"from place to place it differs by a factor of {figures(np.exp(max(new)), 2)}"
            differs = factor if np.isfinite(new).all() else "too few channels tell how it differs from place to place"
            yield f"Noise at new places is taken as the mean of those measured: {differs}."

    def longer(self) -> list[_Candidate]:
        """Return records so long that lines tell the narrowest mode, where they do not; a blow then has as much more noise."""
        half, step = self.modes.damping_ratios * self.modes.frequencies, line_step(self._response)
        times = int(np.ceil(step * _LINES_OF_A_HALF_BANDWIDTH / half[half > 0].min(initial=np.inf)))
        grid = self._response.grid
        if times < 2 or grid is None:
            return []
        fine = np.linspace(grid[0], grid[-1], times * (len(grid) - 1) + 1)
        one: dict[str, Any] = {"frequencies": fine, "values": np.full((len(fine), 1, 1), 1j)}
        one |= {"variance": None, "coherence": None}
        light = replace(self._response.select(outputs=[0], inputs=[0]), **one)
        told = information(slopes_left(light, self.modes.poles), self._residues[: self._heard, : self._driven])
        self._longer, self._length = told.sum(axis=(0, 1)) / times, times
        return [("longer", f"{figures(step / times)} Hz")]

    def reached(self, what: str, more: Mapping[_Candidate, float]) -> RealArray:
        """Return what is reached with some measurements more, (n,): no more than now where disagreement rules."""
        if what == "shape":
            return self._mac(more)
        fall = np.where(self.disagree[what], 1, self._foretold(more)[what == "damping"] / self._before[what])
        return np.asarray(self._widths[what] * fall / getattr(self.modes, _FIELDS[what]))

    def _stated(self, what: str) -> RealArray:
        """Return the wider of the deviations from the noise and between groups, (n,)."""
        each = (getattr(self.modes, f"{_FIELDS[what]}_{kind}") for kind in ("std", "repeatability"))
        return np.asarray(np.fmax(*(np.full(len(self.modes), np.nan) if one is None else one for one in each)))

    def step(self, one: _Candidate, asked: dict[str, float], may: Array) -> Step:
        """Return a candidate measured until it is enough for some modes."""

        def lacking(often: float) -> float:
            return float(self._lacking({one: often}, asked, may).max())

        kind, place = one
        times = 1 + bisect_left(range(1, _MOST), True, key=lambda often: lacking(often) <= 1)
        reached, minutes = {what: self.reached(what, {one: times}) for what in asked}, self._minutes({one: times})
        # noise larger by a factor does what so many fewer measurements do, its square
        doubt = float(np.log(lacking(times * np.exp(-2 * self.scatter.get(kind, 0))) / lacking(times)))
        told: dict[str, Any] = {"reached": reached, "lacking": lacking(times), "uncertainty": doubt}
        return Step(kind=kind, place=place, times=times, minutes=minutes, **told)

    def plan(self, every: list[_Candidate], asked: dict[str, float], may: Array) -> dict[_Candidate, int]:
        """Return how often to measure where, one measurement after the other that lowers what is lacking most per minute.

        What is lacking: the mean over modes of the logarithms of what exceeds the wanted values.
        """
        plan: dict[_Candidate, int] = {}
        while (lack := self._excess(plan, asked, may)) > 0:
            spent = self._minutes(plan)
            tried = [{**plan, each: plan.get(each, 0) + 1} for each in every if plan.get(each, 0) < _MOST]
            if not tried:
                return {}
            paces = [(lack - self._excess(p, asked, may)) / max(self._minutes(p) - spent, 1e-9) for p in tried]
            plan = tried[int(np.argmax(paces))]
        return dict(sorted(plan.items(), key=lambda each: every.index(each[0])))

    def _excess(self, plan: dict[_Candidate, int], asked: dict[str, float], may: Array) -> float:
        return float(np.mean(np.log(np.maximum(self._lacking(plan, asked, may), 1))))

    def _lacking(self, plan: Mapping[_Candidate, float], asked: dict[str, float], may: Array) -> RealArray:
        return np.concatenate(_lacking({what: self.reached(what, plan) for what in asked}, asked))[may]

    def why(self, asked: dict[str, float], never: Array, best: dict[str, RealArray]) -> tuple[str, ...]:
        """Return which modes cannot be as sure as asked, by the reason."""
        reasons: dict[str, list[str]] = {}
        modes, step = self.modes, line_step(self._response)
        half = modes.damping_ratios * modes.frequencies
        for place in np.flatnonzero(never):
            what, k = list(asked)[place // len(modes)], int(place % len(modes))
            if self.disagree[what][k]:
                why = (
                    "disagreement, not noise, rules: more places of the same kind will not help. "
                    "Look for its cause: mass of sensors, temperature, level of force"
                )
            elif step > half[k]:
                why = f"lines lie {figures(step, 2)} Hz apart, further than the half bandwidth. Measure longer"
            elif self._near_node[k]:
                why = "every place that is known is near a node. Measure at another place"
            else:
                why = f"with {_MOST} times as many measurements. Lower the noise"
            reasons.setdefault(why, []).append(_mode(k, modes.frequencies, what, best[what]))
        return tuple(f"Out of reach: {', '.join(each)}: {why}." for why, each in reasons.items())

    def _minutes(self, more: Mapping[_Candidate, float]) -> float:
        """Return how long measurements take: a line's distance tells how long one took; a new sensor needs all forces again."""
        step, averages = line_step(self._response), getattr(self._response, "averages", None) or 1
        rate = getattr(self._response, "sampling_rate", None)
        seconds = averages / step if step > 0 else self._response.count / rate if rate else np.nan
        forces = len(self._by_kind[0][0])
        each = {"sensor": forces, "longer": forces * self._length}
        long = sum(times * each.get(kind, 1) for (kind, _), times in more.items())
        return float(seconds / 60 * long + sum(kind in ("force", "sensor") for kind, _ in more))

    def _weights(self, more: Mapping[_Candidate, float]) -> RealArray:
        """Return how often each channel is measured, (L, M)."""
        weight = np.zeros(self._noise.shape)
        weight[: self._heard, : self._driven] = 1
        for (kind, dof), times in more.items():
            if kind == "longer":
                continue
            if (kind == "sensor") != self._response.exchanged:
                weight[self.outputs.index(dof), : self._driven] += times
            else:
                weight[: self._heard, self.inputs.index(dof)] += times
        return weight

    def _mac(self, more: Mapping[_Candidate, float]) -> RealArray:
        """Return the expected MAC of each shape with the true one: what is across it has variances that fall with sum |b|^2 / s^2."""
        modes, heard = self.modes, self._heard
        if modes.shapes_std is None or heard < 2:
            have = "shapes without deviations" if heard > 1 else "one output, whose shape is a single number"
            raise DataError("shapes:", f"the result has {have}", "Ask for damping or frequency.")
        size = np.sum(np.abs(modes.shapes) ** 2, axis=0)
        away = np.sum(modes.shapes_std**2, axis=0) / size * (1 - 1 / max(heard, 2))
        told = [np.mean((self._weights(w) / self._noise**2)[:heard] @ self._sides, axis=0) for w in ({}, more)]
        fall = np.where(self.disagree["shape"], 1, told[0] / told[1])
        return np.asarray(np.where(np.isfinite(self._widths["frequency"]), 1 - away * fall, np.nan))


def _rests_on(result: Result, planned: Array, reciprocal: bool) -> tuple[str, ...]:
    """Return what a plan rests on."""
    open_ = [f"{f:.5g} Hz" for f in result.modes.frequencies[~planned]]
    notes = ["Foretold for the modes of this result: modes that are not detected yet are not planned for."]
    notes += [f"No interval, not planned for: {', '.join(open_)}."] if open_ else []
    notes += [f"Plan for these first. {note}" for note in result.notes if note.kind == BARE]
    unknown = "What a new place would do is not known without a driving point: measure a force at a sensor once."
    return (*notes, *(() if reciprocal else (unknown,)))


def scatter_of_noise(levels: RealArray) -> float:
    """Return the standard deviation of the log noise of a new place about the mean of those measured; infinite if they do not tell it.

    `levels` (places, channels of each): logarithms, log-normal from place to place. Of one place, its channels tell how noise scatters.
    """
    several = levels if len(levels) > 1 else levels.T
    if several.size < _MIN_CHANNELS:
        return np.inf
    return float(np.sqrt(np.mean(several.var(axis=0, ddof=1))))


def not_told_apart(values: RealArray, deviations: RealArray) -> list[int]:
    """Return the largest of normal numbers and those that are not smaller at `TOLD_APART`: (x_1 - x_k) / sqrt(d_1^2 + d_k^2) < z."""
    first = int(np.argmax(values))
    near = values[first] - values < ndtri(TOLD_APART) * np.hypot(deviations, deviations[first])
    return [first, *(int(k) for k in np.flatnonzero(near) if k != first)]
