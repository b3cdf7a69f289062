"""Calibrate intervals by simulation: replicates of the test are identified as the measured data were.

First-order standard deviations contain neither bias nor thresholds nor modes that split. Replicates do: the rebuilt response plus noise of
the estimated variance, identified by the same row at the same order, and refined where the reported modes were.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.rebuilt import rebuilt
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.data.sameness import same_modes
from modalscope.data.shown import Shown, counted, figures, summary_of, text_table
from modalscope.identification.method_names import find_method
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import Measured, pose
from modalscope.identification.stabilize import stabilized
from modalscope.identification.suits import of_past
from modalscope.identification.sweep import Sweep
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.selection.judging.bands import terms_of
from modalscope.selection.judging.refine import refine
from modalscope.selection.judging.select import selected
from modalscope.selection.likelihood.descent import astray
from modalscope.selection.likelihood.deviations import residual_variance, unexplained_energy
from modalscope.selection.likelihood.joint_fit import joint_residues
from modalscope.selection.likelihood.noise import SPLIT, Noise, noise_of


@dataclass(frozen=True, eq=False, slots=True)
class Replicates:
    """How replicates of a result are made and identified; made by `replicates_of`.

    `modes`: the truth of every replicate. `clean`: the rebuilt response. `beside`: poles that refinement holds fixed, rad/s.
    `whole`: whether the selection is replayed, too.
    """

    diagram: StabilizationDiagram
    modes: ModalModel
    clean: Array
    noise: Noise
    order: int
    beside: ComplexArray
    whole: bool

    def one(self, rng: np.random.Generator) -> RealArray:
        """Return frequencies, damping ratios and their deviations of one replicate, (4, n); NaN where a mode is not found."""
        noisy = self.clean + self.noise.drawn(self.clean.shape, rng)
        response: Response = replace(self.diagram.response, values=noisy)
        values = np.full((4, len(self.modes)), np.nan)
        try:
            modes = self._identified(response)
        except DataError:  # no model, no mode
            return values
        true, of_replicate = same_modes(self.modes, modes)
        if self.modes.unrefined is not None and len(of_replicate):
            modes, true, of_replicate = self._refined(response, modes.poles[of_replicate], true)
        values[0, true], values[1, true] = modes.frequencies[of_replicate], modes.damping_ratios[of_replicate]
        for row, name in ((2, "frequencies_std"), (3, "damping_ratios_std")):
            reported, std = _as_normal(self.modes, name), _as_normal(modes, name)
            if reported is not None:  # also used where a replicate has none, as of correlations without records
                of_modes = np.full(len(true), np.nan) if std is None else std[of_replicate]
                values[row, true] = np.where(np.isfinite(of_modes), of_modes, reported[true])
        return values

    def _refined(
        self, response: Response, poles: ComplexArray, found: IntArray
    ) -> tuple[ModalModel, IntArray, IntArray]:
        """Return refined modes of a replicate, and which of them are which of those found, with an interval.

        Modes not found begin at their true values: without them the others would be biased. What went astray, and what the replicate
        leaves open, has no interval in an analysis either.

        `poles`: of the modes found.
        """
        begun = self.modes.poles.copy()
        begun[found] = poles
        modes = refine(response, replace(self.modes, poles=begun, unrefined=None), fixed=self.beside)
        true, of_replicate = same_modes(self.modes, modes)
        kept = np.isin(true, found) & ~astray(begun[true], modes.poles[of_replicate])
        if modes.degrees is not None:
            kept &= (modes.degrees[of_replicate] != 0).all(axis=1)
        return modes, true[kept], of_replicate[kept]

    def _identified(self, response: Response) -> ModalModel:
        diagram, settings = self.diagram, self.diagram.settings
        row = find_method(diagram.method, diagram.domain, diagram.domain, settings.route)
        options = {k: v for k, v in settings.items() if k not in ("band", "exclude", "route", *row.fixed)}
        measured = Measured(
            response, None, "a replicate", row.name, row.domain, band=settings.band, route=settings.route
        )
        problem = pose(measured, row, options)
        if self.whole:
            return selected(stabilized(problem, list(diagram.asked_orders or diagram.orders)))
        found = Sweep(factor(problem, self.order), [self.order]).cut(self.order)
        return found.modes.take(found.reported)


def _as_normal(modes: ModalModel, name: str) -> RealArray | None:
    """Return the deviations from the noise of which 1.96 make the interval: Student's quantile of few degrees of freedom is wider."""
    std: RealArray | None = getattr(modes, name)
    degrees = modes.degrees
    # with groups the degrees may be theirs
    if std is None or degrees is None or modes.frequencies_repeatability is not None:
        return std
    known = degrees[:, 0 if name == "frequencies_std" else 1]
    return np.asarray(std * stdtrit(np.where(known > 0, known, np.inf), 1 - (1 - _LEVEL) / 2) / _Z)


def replicates_of(
    diagram: StabilizationDiagram, modes: ModalModel, records: Signals | None = None, *, whole: bool = False
) -> Replicates:
    """Return how to make replicates of modes that were selected from a diagram.

    `records`: that correlations were made from. `whole`: whether the selection is replayed, too.

    Raises `DataError`: no modes, noise of which nothing is known, or a method that works on past records themselves.
    """
    if not len(modes):
        raise DataError("a certificate needs modes", "there are none", "Give a result with modes.")
    if diagram.response.ambient and modes.unrefined is not None:
        modes = _of_correlations(modes, modes.unrefined)
    row = find_method(diagram.method, diagram.domain, diagram.domain, diagram.settings.route)
    if of_past(row):
        have = "it needs records, and replicates are responses"
        raise DataError(f"a certificate of {row.label}:", have, "Certify another method on the same record.")
    response, order = diagram.response, nearest_order(diagram, modes.unrefined or modes)
    beside = np.zeros(0, complex) if modes.unrefined is None else terms_of(modes.unrefined)[0]
    clean = rebuilt(response, modes)
    if modes.residual_terms:
        left = (response.values - clean) * np.sqrt(_growth_of_residual(response, modes))
        noise = noise_of(response, records).beside(np.mean(np.abs(left) ** 2, axis=0), left)
    else:
        noise = _noise_beside(diagram, modes, order, records)
    noise.drawn(clean.shape, np.random.default_rng(0))  # raises where nothing is known of it
    return Replicates(diagram, modes, clean, noise, order, beside, whole)


def _of_correlations(modes: ModalModel, before: ModalModel) -> ModalModel:
    """Return modes that were refined on the lines of a record as they were before: replicates are correlations."""
    names = ("poles", "frequencies_std", "damping_ratios_std", "degrees")
    text = "The values before refinement are certified: refinement needs the record, and replicates are correlations"
    own: dict[str, Any] = {name: getattr(before, name) for name in names}
    return replace(modes, **own, unrefined=None).noted(Note("before refinement", {"modes": float(len(modes))}, text))


def _growth_of_residual(response: Response, modes: ModalModel) -> float:
    """Return by what the mean square of a residual is multiplied to be that of the noise: a fit explains some of it."""
    values = response.values.size * (1 + bool(np.iscomplexobj(response.values)))
    unknowns = 2 * len(modes) * (len(modes.shapes) + response.drives) + sum(t.unknowns for t in modes.residual_terms)
    return values / max(values - unknowns, 1)


def _noise_beside(diagram: StabilizationDiagram, modes: ModalModel, order: int, records: Signals | None) -> Noise:
    """Return the noise, given what all decaying poles of the order that made the modes leave, with its spectrum where that is seen."""
    response = diagram.response
    is_complex = bool(np.iscomplexobj(response.values))
    own = np.flatnonzero((diagram.order_of_pole == order) & (diagram.poles.real < 0))
    poles, shapes = (diagram.poles[own], diagram.shapes[:, own]) if own.size else (modes.poles, modes.shapes)
    basis = response.basis(poles - response.added_damping, response.outside_powers)
    free = response.count * (1 + is_complex) - basis.columns.shape[1]
    variance = residual_variance(unexplained_energy(basis), free, is_complex)
    noise = noise_of(response, records)
    if not is_complex:
        return noise.beside(variance)
    shapes, fitted = joint_residues(response, poles, shapes)
    model = ModalModel(
        poles=poles, shapes=shapes, dt=diagram.dt, held_input=response.held_input, **fitted, **response.labelled()
    )
    left = response.values - rebuilt(response, model)
    level = np.sqrt(variance / np.maximum(np.mean(np.abs(left) ** 2, axis=0), 1e-300))
    return noise.beside(variance, left * level)


def nearest_order(diagram: StabilizationDiagram, modes: ModalModel) -> int:
    """Return the order whose poles are nearest to the modes, each at most a half bandwidth to its account, and split the fewest of them.

    Of a mode that is split in two the deviation is, rightly, many times that of the mode.

    `modes`: selected from it.
    """
    costs, nearest = [], []
    for order in diagram.orders:
        own = np.flatnonzero(diagram.order_of_pole == order)
        distance = np.abs(diagram.poles[own][:, None] - modes.poles) / np.abs(modes.poles.real)
        if not own.size:
            costs.append(np.inf if len(modes) else 0.0)
            nearest.append(own)
            continue
        costs.append(float(np.sum(np.minimum(distance.min(axis=0), 1.0))))
        nearest.append(own[np.argmin(distance, axis=0)])
    # deviations that were read show some of the split modes, others only add to them
    least = [c + _split_modes(diagram, own, modes, known=True) for c, own in zip(costs, nearest, strict=True)]
    best, at = np.inf, 0
    for k in np.argsort(least, kind="stable").tolist():
        if least[k] > best:  # deviations of other orders are not needed
            break
        cost = costs[k] + _split_modes(diagram, nearest[k], modes)
        if cost < best or (cost == best and k < at):
            best, at = cost, k
    return int(diagram.orders[at])


def _split_modes(diagram: StabilizationDiagram, nearest: IntArray, modes: ModalModel, *, known: bool = False) -> int:
    """Return how many modes an order splits in two, by the poles of it that are nearest to them: their deviation is many times as large.

    `known`: of those whose deviations were read.
    """
    if modes.frequencies_std is None or not nearest.size:
        return 0
    std, _ = diagram.deviations_at(nearest, known=known)
    return 0 if std is None else int(np.count_nonzero(std > SPLIT * modes.frequencies_std))


#: Limits of an interval that holds: |bias| in deviations, deviation found over predicted, coverage of the 95 % interval.
LARGEST_BIAS, RATIOS, LEAST_COVERAGE = 0.5, (0.8, 1.25), 0.88

#: Replicates more, in multiples of the first, for what fails: a perfect interval of 40 replicates fails a figure by chance in 5 %.
MORE = 4

#: Probability, to either side, beyond which a reported standard deviation is unlike those of the replicates.
_UNLIKE_PROBABILITY = 0.9985

#: Number of replicates below which a note states their uncertainty.
_MIN_REPLICATES = 20

#: Normal quantile of the 95 % interval, and its level.
_Z, _LEVEL = 1.959964, 0.95


class Calibration(NamedTuple):
    """What replicates say of the deviations, (n, 2) each: of frequencies and of damping ratios; NaN where none is given."""

    bias: RealArray
    ratio: RealArray
    coverage: RealArray
    error: RealArray
    seen: RealArray

    @property
    def holds(self) -> BoolArray:
        """Whether the interval holds, (n, 2)."""
        return _holding({"bias": self.bias, "ratio": self.ratio, "coverage": self.coverage}, self.seen)


def _holding(told: Mapping[str, RealArray], count: Array) -> BoolArray:
    """Whether the figures of so many replicates are those of an interval that holds.

    Of K replicates of a perfect interval the mean scatters by 1 / sqrt(K) deviations, the ratio by 1 / sqrt(2 (K - 1)) and the coverage by
    sqrt(.95 x .05 / K). Below some forty that is more than the limits leave: they are widened to the 95 % of it.
    """
    K = np.maximum(count, 2)
    bias, scatter = _by_chance(K)
    covered = np.minimum(LEAST_COVERAGE, _LEVEL - _Z * np.sqrt(_LEVEL * (1 - _LEVEL) / K))
    with np.errstate(invalid="ignore"):
        right = (told["ratio"] >= np.minimum(RATIOS[0], 1 - scatter)) & (
            told["ratio"] <= np.maximum(RATIOS[1], 1 + scatter)
        )
        return np.asarray(
            (np.abs(told["bias"]) < np.maximum(LARGEST_BIAS, bias)) & right & (told["coverage"] >= covered)
        )


def _by_chance(K: Array) -> tuple[RealArray, RealArray]:
    """Return the bias, in deviations, and the error of the ratio that K replicates of a perfect interval stay within, in 95 %."""
    return np.asarray(_Z / np.sqrt(K)), np.asarray(_Z / np.sqrt(2 * (K - 1)))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Certificate(Shown):
    """Whether the intervals of modes hold, mode by mode.

    Parameters
    ----------
    modes : ModalModel
        The reported modes; what does not hold has the deviation of the replicates in its place.
    frequency, damping_ratio : mapping of "bias", "ratio", "coverage" to array (n,)
        Mean error over the predicted deviation, deviation of the replicates over the predicted one, and the share of the replicates
        whose own 95 % interval holds the truth.
    holds : array of bool, (n,)
        Whether both intervals hold as they were reported.
    found : array of int, (n,)
        Replicates in which each mode was found.
    replicates : array of int, (n,)
        Replicates that each mode was judged on.
    order : int
        The order that was replayed.
    notes : tuple of Note
        What does not hold, and why; how little few replicates tell.
    """

    modes: ModalModel
    frequency: dict[str, RealArray]
    damping_ratio: dict[str, RealArray]
    holds: BoolArray
    found: IntArray
    replicates: IntArray
    order: int
    notes: tuple[Note, ...] = ()

    @property
    def frequency_holds(self) -> BoolArray:
        """Whether the interval of each frequency holds, (n,)."""
        return _holding(self.frequency, self.found)

    @property
    def damping_ratio_holds(self) -> BoolArray:
        """Whether the interval of each damping ratio holds, (n,)."""
        return _holding(self.damping_ratio, self.found)

    @property
    def bias(self) -> RealArray:
        """The larger bias of frequency and damping ratio, in deviations, (n,)."""
        both = np.stack([self.frequency["bias"], self.damping_ratio["bias"]])
        larger = np.argmax(np.where(np.isnan(both), -1.0, np.abs(both)), axis=0)
        return np.asarray(both[larger, np.arange(both.shape[1])])

    @property
    def ratio(self) -> RealArray:
        """The ratio of frequency or damping ratio that is farther from one, (n,)."""
        both = np.stack([self.frequency["ratio"], self.damping_ratio["ratio"]])
        farther = np.argmax(np.where(np.isnan(both), -1.0, np.abs(np.log(np.maximum(both, 1e-12)))), axis=0)
        return np.asarray(both[farther, np.arange(both.shape[1])])

    @property
    def coverage(self) -> RealArray:
        """The smaller coverage of the two intervals, (n,)."""
        return np.fmin(self.frequency["coverage"], self.damping_ratio["coverage"])

    def table(self) -> str:
        """Return the certificate as a text table."""
        head = ("mode", "f [Hz]", "f bias", "ratio", "cover", "zeta bias", "ratio", "cover", "found", "interval")
        rows: list[tuple[str, ...]] = [head]
        for j, f in enumerate(self.modes.frequencies):
            parts = [f"{self.frequency[k][j]:.2f}" for k in ("bias", "ratio", "coverage")]
            parts += [f"{self.damping_ratio[k][j]:.2f}" for k in ("bias", "ratio", "coverage")]
            verdict = "holds" if self.holds[j] else "does not hold"
            rows.append((str(j + 1), f"{f:.4f}", *parts, f"{self.found[j]} of {self.replicates[j]}", verdict))
        return text_table(rows)


def calibration(truth: ModalModel, found: RealArray) -> Calibration:
    """Return what replicates (K, 4, n) say of their own deviations, and of those reported where these are unlike them."""
    true = np.stack([truth.frequencies, truth.damping_ratios])
    values, std = found[:, :2], _judged(truth, found[:, 2:])
    error = values - true
    with np.errstate(invalid="ignore", divide="ignore"):
        there = np.sum(np.isfinite(values), axis=0)
        mean = np.nansum(error, axis=0) / there
        spread = np.sqrt(np.nansum((error - mean) ** 2, axis=0) / (there - 1))
        typical = _median(std)
        inside = np.sum(np.abs(error) <= _Z * std, axis=0) / np.sum(np.isfinite(std), axis=0)
        size = np.sqrt(np.nansum(error**2, axis=0) / there)
        # a deviation of nothing, as of the damping ratio of a real pole, is passed by no error
        bias, ratio = mean / typical, spread / typical
    return Calibration(bias.T, ratio.T, inside.T, size.T, there.T.astype(float))


def _judged(truth: ModalModel, own: RealArray) -> RealArray:
    """Return the deviations that are judged, (K, 2, n): the replicates' own, or the reported one where it is not of their kind.

    The logarithms of the replicates' own scatter as they may; a reported deviation further off than one more of them would lie (Student's
    quantile), and by more than an interval that holds may be wrong, is not what this case gives.
    """
    told = (_as_normal(truth, "frequencies_std"), _as_normal(truth, "damping_ratios_std"))
    stated = np.stack([np.full(len(truth), np.nan) if std is None else std for std in told])
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.where(own > 0, np.log(own), np.nan)
        count = np.sum(np.isfinite(log), axis=0)
        away = np.abs(np.log(stated) - np.log(_median(own)))
        mean = np.nansum(log, axis=0) / count
        scatter = np.sqrt(np.nansum((log - mean) ** 2, axis=0) / (count - 1) * (1 + 1 / count))
        unlike = away > np.maximum(np.log(RATIOS[1]), stdtrit(count - 1.0, _UNLIKE_PROBABILITY) * scatter)
    return np.where(unlike & (count > 1), np.broadcast_to(stated, own.shape), own)


def _median(values: RealArray) -> RealArray:
    """Return the median over replicates of what is known; NaN where nothing is."""
    known = np.isfinite(values)
    ordered = np.sort(np.where(known, values, np.inf), axis=0)
    middle = np.maximum(known.sum(axis=0) - 1, 0) // 2
    found = np.take_along_axis(ordered, middle[None], axis=0)[0]
    return np.where(known.any(axis=0), found, np.nan)


def certified(
    made: Replicates, count: int, rng: np.random.Generator, progress: Callable[[int, int], None] | None = None
) -> Certificate:
    """Return the certificate: `count` replicates, and four times as many more for what fails.

    `progress`: called with (replicates done, replicates in all).
    """
    found = np.stack([_one(made, rng, i, count, progress) for i in range(count)])
    told = calibration(made.modes, found)
    judged = np.full(len(made.modes), count)
    seen = np.sum(np.isfinite(found[:, 0]), axis=0)
    fails = np.asarray(~told.holds.all(axis=1))
    if fails.any():
        more = [_one(made, rng, count + i, (1 + MORE) * count, progress) for i in range(MORE * count)]
        everything = np.concatenate([found, np.stack(more)])
        again = calibration(made.modes, everything)
        told = Calibration(*(np.where(fails[:, None], new, old) for old, new in zip(told, again, strict=True)))
        judged[fails] = len(everything)
        seen = np.where(fails, np.sum(np.isfinite(everything[:, 0]), axis=0), seen)
    modes, notes = _inflated(made.modes, told)
    one, two = ({k: getattr(told, k)[:, i] for k in ("bias", "ratio", "coverage")} for i in (0, 1))
    return Certificate(
        modes=modes,
        frequency=one,
        damping_ratio=two,
        holds=np.asarray(told.holds.all(axis=1)),
        found=seen,
        replicates=judged,
        order=made.order,
        notes=(*(note for note in made.modes.notes if note.kind == "before refinement"), *notes, *note_on_few(count)),
    )


def note_on_few(count: int) -> list[Note]:
    """Return how wrong an interval may be that so few replicates pass; nothing of as many as tell."""
    if count >= _MIN_REPLICATES:
        return []
    bias, scatter = (float(v) for v in _by_chance(np.array(count)))
    text = (
        f"Only {count} replicates: an interval may pass with a bias of {bias:.1f} standard deviations, or {1 + scatter:.1f} times "
        f"too narrow (40 replicates: {LARGEST_BIAS:g}, {RATIOS[1]:g})"
    )
    return [Note("few replicates", {"replicates": float(count)}, text)]


def _one(made: Replicates, rng: np.random.Generator, done: int, count: int, progress: Any) -> RealArray:
    found = made.one(rng)
    if progress is not None:
        progress(done + 1, count)
    return found


def _inflated(modes: ModalModel, told: Calibration) -> tuple[ModalModel, tuple[Note, ...]]:
    """Return the modes with the replicates' error where an interval does not hold, and what was wrong with it."""
    fields, notes = {}, []
    for i, (name, word) in enumerate((("frequencies_std", "frequency"), ("damping_ratios_std", "damping ratio"))):
        std = getattr(modes, name)
        if std is None:
            continue
        fails = ~told.holds[:, i]
        fields[name] = np.where(fails & np.isfinite(told.error[:, i]), np.fmax(std, told.error[:, i]), std)
        notes += [_why(modes, told, int(j), i, word, bool(np.isfinite(std[j]))) for j in np.flatnonzero(fails)]
    return replace(modes, **fields).noted(notes), tuple(notes)


def _why(modes: ModalModel, told: Calibration, j: int, i: int, word: str, given: bool) -> Note:
    """Return why the interval of one quantity of one mode does not hold, where a deviation was given or not."""
    bias, ratio, cover = (float(part[j, i]) for part in (told.bias, told.ratio, told.coverage))
    reasons = []
    if not abs(bias) < LARGEST_BIAS:
        reasons.append(f"bias {figures(bias, 2)} standard deviations")
    if not RATIOS[0] <= ratio <= RATIOS[1]:
        reasons.append(f"scatter {figures(ratio, 2)} times the predicted")
    if not cover >= LEAST_COVERAGE:
        reasons.append(f"coverage {100 * cover:.0f} % instead of 95 %")
    if np.isnan(cover):
        reasons = ["the replicates do not find the mode" if given else "no standard deviation is given"]
    text = f"The interval of the {word} at {modes.frequencies[j]:.5g} Hz does not hold: {', '.join(reasons)}"
    numbers = {"frequency_hz": float(modes.frequencies[j]), "bias": bias, "ratio": ratio, "coverage": cover}
    return Note("interval does not hold", numbers, text)


@summary_of.register
def _(found: Certificate) -> str:
    return f"certificate: the intervals of {int(found.holds.sum())} of {counted(len(found.modes), 'mode')} hold"
