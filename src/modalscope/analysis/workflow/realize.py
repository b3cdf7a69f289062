"""Realize the model that predicts best what it was not fitted to: candidates by several rows, a part of the records held out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modalscope.analysis.workflow.prediction_error import directions, least_prediction_errors
from modalscope.analysis.workflow.simulation import (
    Candidate,
    ModelValidation,
    colour,
    explained,
    free_run,
    rebuilt,
    sampled,
    validated,
    with_noise,
)
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.response import Response, line_step
from modalscope.data.setups import as_test
from modalscope.data.shown import counted, percent, summary_of
from modalscope.data.statespace import StateSpace
from modalscope.identification.identify import identify
from modalscope.identification.matrices.driven import runs_of
from modalscope.identification.modal.state_space import deterministic, from_modes
from modalscope.identification.options import AllOptions
from modalscope.identification.routes import usual_route, without_delays
from modalscope.identification.sweep import sweep
from modalscope.numerics.arguments import COUNT, between, named
from modalscope.numerics.checks import RealArray, real_array, stays_locked
from modalscope.numerics.errors import DataError, as_printed
from modalscope.numerics.functions.poles import one_of_each_pair, to_discrete
from modalscope.numerics.progress import tell
from modalscope.numerics.resources import one_thread
from modalscope.signals.preprocess.excitation import few_tones

#: Orders that are tried: even ones to the first number, then every fourth.
_FINE_ORDERS, _MAX_ORDER = 20, 40

#: Stretches of a part that is held out, how often they are drawn again, and how often none of equal candidates may be told apart.
_STRETCHES, _DRAWS, _BY_CHANCE = 10, 400, 0.05

#: Least share of the forces in a part that is held out and in the rest, relative to their share of the time.
_MIN_SHARE = 0.5

#: Variance that a model by frequency responses explains of its own records, in per cent, below which it says so: less than all but a tenth.
_MIN_EXPLAINED = 90.0


@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class RealizedModel(StateSpace):
    """A state-space model with what was found on the way.

    Parameters
    ----------
    notes : tuple of Note
    validation : ModelValidation, optional
        On the part of records with inputs that was held out; None for responses, and with holdout=0.
    directions : array, (p, n + l, n + m), optional
        Of [[A, B], [C, D]], a standard deviation each, their outer products add to the covariance; of models of records with inputs.
    """

    notes: tuple[Note, ...] = ()
    validation: ModelValidation | None = None
    directions: RealArray | None = None

    def frequency_response_std(self, frequencies: ArrayLike) -> RealArray:
        """Return standard deviations (F, l, m) of the frequency response on lines in Hz, of real and imaginary part together.

        dH = [C R, I] d[[A, B], [C, D]] [R B; I] with R = (x I - A)^-1. The discs of radius 1.73 standard deviations around the response
        hold 95 % of what other records of the same noise would give (of a round Gaussian exp(-r^2) = .05). States that a model lacks are
        a bias, which is not in it; `validation` shows it.

        Parameters
        ----------
        frequencies : array, (F,)
            Lines in Hz.

        Raises
        ------
        DataError
            A model without `directions`: of responses, unstable, or too large for them.
        """
        if self.directions is None:
            raise DataError(
                "standard deviations of a frequency response:",
                "the model has no covariance: it was identified from responses, is unstable, or has too many states",
                "Realize it from records with inputs, with fewer states or samples.",
            )
        f = real_array("frequencies", frequencies, "(lines,)", (0, 1)).reshape(-1)
        points = np.exp(2j * np.pi * f * self.dt) if self.dt else 2j * np.pi * f
        (l, m), I = self.D.shape, np.eye(self.order)
        deviations = np.empty((f.size, l, m))
        for k, x in enumerate(points):
            left = np.hstack([np.linalg.solve((x * I - self.A).T, self.C.T).T, np.eye(l)])
            right = np.vstack([np.linalg.solve(x * I - self.A, self.B), np.eye(m)])
            deviations[k] = np.sqrt(np.sum(np.abs(left @ self.directions @ right) ** 2, axis=0))
        return deviations


@named(AllOptions.__annotations__, order=COUNT, stable=bool, holdout=between(0, 0.9, low_included=True))
@one_thread
def realize(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    order: int | None = None,
    stable: bool = True,
    holdout: float = 0.25,
    **options: Any,
) -> RealizedModel:
    """Return a state-space model for control work, of records with inputs the one that explains best what it was not fitted to.

    Of records with inputs several rows are candidates unless `method` or `route` says one: n4sid, records on lines, an observer (OKID) with
    ERA, and for hits and periodic forces Loewner matrices of their frequency responses. Each is fitted
    to a part of the records at many orders and simulates the rest from the inputs alone; the best is fitted again to all, and has the
    gain of its innovations.

    Parameters
    ----------
    data, method, domain, order, **options
        As in `identify`. domain="z" gives a sampled model of any records.
    stable : bool
        Whether poles that grow are mirrored, and inputs and direct terms fitted again; a note says what that costs.
    holdout : float
        Part of the records that is held out, of several runs whole runs: 0 to 0.9. With 0 nothing is validated, and order and method are
        chosen as by `identify`.

    Returns
    -------
    RealizedModel
        A `StateSpace` with `notes` and `validation`.

    Raises
    ------
    DataError
        As in `identify`.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> record = chain5().simulate(inputs="white", samples=800, sampling_rate=20.0, noise=0.02, seed=1)
    >>> model = realize(record, order=10)
    >>> bool(model.validation.free_run.min() > 99), bool(abs(model.poles).max() < 1)
    (True, True)
    """
    test = as_test(data) if isinstance(data, list | tuple) else data
    choice = {"method": method, "domain": domain, **{k: v for k, v in options.items() if v is not None}}
    records = as_records(test) if isinstance(test, Signals) else test
    if not isinstance(records, Records) or not records.input_dofs or holdout == 0:
        return _told(_of_one(data, order, choice, stable=stable))
    excluded = choice.pop("exclude", None)
    records = records if excluded is None else records.select(exclude=excluded)
    records, _, notes = without_delays(records, choice.pop("delays", None))
    return _told(_of_records(records, order, {**choice, "delays": {}}, notes, stable=stable, holdout=holdout))


def _told(model: RealizedModel) -> RealizedModel:
    """Return a model whose notes are records of the run."""
    tell(summary_of(model), *model.notes)
    return model


def _of_one(data: Any, order: int | None, choice: Mapping[str, Any], *, stable: bool) -> RealizedModel:
    found = identify(data, order=order, deviations=False, **choice)
    model, notes = found.state_space, (*found.notes, _fit_error(found.fit_error))
    if stable:
        model, _, said = stabilized(model, found.response)
        notes = (*notes, *said)
    return RealizedModel(**_fields(model, found.response), notes=notes)


def _fit_error(error: float) -> Note:
    return Note("fit error", {"error": error}, f"fit error {percent(error)}")


def _fields(model: StateSpace, channels: Response | Records) -> dict[str, Any]:
    """Return the matrices of a model with the names and units of its channels."""
    sides = {"output": (channels.output_dofs, channels.units[0]), "input": (channels.input_dofs, channels.units[1])}
    counts = {"output": len(model.C), "input": model.B.shape[1]}
    names: dict[str, Any] = {}
    for side, (dofs, units) in sides.items():
        if len(dofs) == counts[side]:
            names |= {f"{side}_dofs": dofs, f"{side}_units": units if any(units) else ()}
    return {f.name: getattr(model, f.name) for f in fields(StateSpace)} | names


# -------------------------------------------------------------------------------------------------------------- stability
def _length(response: Response, dt: float | None) -> float:
    """Return the length of the data, seconds: of samples dt apart, or what the distance of lines tells."""
    step = line_step(response)
    return 1 / step if step else response.count * (dt or 1.0)


def stabilized(model: StateSpace, response: Response) -> tuple[StateSpace, int, tuple[Note, ...]]:
    """Return a model with growing poles mirrored, inputs and direct term fitted again to the response, their number, and the cost.

    z goes to 1 / z*, s to -s*; shapes stay. A mirrored pole decays within the length of the data at the slowest, |z| <= exp(-1 / N).
    """
    values, vectors = np.linalg.eig(model.A)
    grows = np.abs(values) >= 1 if model.dt else values.real >= 0
    if not np.any(grows):
        return model, 0, ()
    s = np.log(values.astype(complex)) / model.dt if model.dt else values.astype(complex)
    kept = one_of_each_pair(s)
    s, shapes = s[kept], model.C @ vectors[:, kept]
    # data of a length T tell no decay below 1 / T; of one pole on the axis itself rounding decides which way it goes
    least = np.where(grows[kept], 1 / _length(response, model.dt), 1e-9 * np.abs(s))
    s = np.minimum(-np.abs(s.real), -least) + 1j * s.imag
    basis = response.basis(s)
    participation, terms = basis.fit_participation(shapes)
    own = response.of_inputs(participation)
    poles = s if model.dt is None else to_discrete(s, model.dt)
    poles = np.where(np.isin(kept, np.flatnonzero(values.imag == 0)), poles.real, poles)
    factor = 1 if model.dt is None else poles[:, None] ** response.steps_late
    # samples of a response have no direct term: it was measured beside them
    made = from_modes(poles, shapes, own * factor, terms[0] if len(terms) else model.D, model.dt)
    left = basis.data - basis.rebuilt(shapes, participation, terms)
    cost = float(np.linalg.norm(left) / np.linalg.norm(basis.data))
    count = int(np.count_nonzero(grows))
    text = f"{count} unstable poles were mirrored: {percent(cost)} of the data are unexplained; stable=False keeps these poles"
    return made, count, (Note("mirrored", {"poles": count, "left": cost}, text),)


# ------------------------------------------------------------------------------------------------------------- validation
class _Fold(NamedTuple):
    """Records to fit to, and records to simulate."""

    fitted: Records
    tested: Records


def _folds(records: Records, holdout: float) -> tuple[list[_Fold], str]:
    """Hold out the first and the last part of the records in turn, and say so: of runs that share their inputs whole ones.

    A part without its share of the forces tests nothing; of a single transient all is fitted, and simulated.
    """
    count = len(records.runs)
    size = max(round(count * holdout), 1)
    if count > 1:
        ends = [(records.runs[size:], records.runs[:size]), (records.runs[:-size], records.runs[-size:])]
        folds = [_Fold(_of_runs(records, kept), _of_runs(records, held)) for kept, held in ends]
        if all(set(fold.fitted.input_dofs) == set(records.input_dofs) == set(fold.tested.input_dofs) for fold in folds):
            return folds, f"the first and the last {size} of {count} runs"
    share = _shares(records)
    folds, names = [], []
    ends_of = {"first": (holdout, 1.0, (0.0, holdout)), "last": (0.0, 1 - holdout, (1 - holdout, 1.0))}
    for name, (first, last, tested) in ends_of.items():
        left = share(*tested)
        if _MIN_SHARE * holdout <= left <= 1 - _MIN_SHARE * (1 - holdout):
            folds.append(_Fold(_cut(records, first, last), _cut(records, *tested)))
            names.append(name)
    if folds:
        return folds, f"the {' and the '.join(names)} {percent(holdout)}"
    return [_Fold(records, records)], "what it was fitted to (one transient, no part of it can be held out)"


def _cut(records: Records, first: float, last: float) -> Records:
    """Return a part of every run, from and to fractions of its length."""

    def of(run: Signals) -> Signals:
        assert run.inputs is not None
        part = slice(int(first * run.samples), int(last * run.samples))
        return replace(run, outputs=run.outputs[part], inputs=run.inputs[part])

    return _of_runs(records, map(of, records.runs))


def _shares(records: Records) -> Callable[[float, float], float]:
    """Return the least share of the forces of any run between two fractions of its length."""
    sums = []
    for run in records.runs:
        assert run.inputs is not None
        u = run.inputs - np.median(run.inputs, axis=0)
        power = np.sum(u**2 / np.maximum(np.mean(u**2, axis=0), np.finfo(float).tiny), axis=1)
        sums.append(np.concatenate([[0.0], np.cumsum(power)]) / max(float(power.sum()), np.finfo(float).tiny))
    return lambda first, last: float(min(s[int(last * (s.size - 1))] - s[int(first * (s.size - 1))] for s in sums))


def _of_runs(records: Records, runs: Iterable[Signals]) -> Records:
    return replace(records, runs=tuple(runs), groups=None)


# ------------------------------------------------------------------------------------------------------------- candidates
def _ways(records: Records, choice: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the rows that are tried, by a name; the one that was asked alone."""
    if any(choice.get(name) is not None for name in ("method", "route")):
        asked = {name: choice[name] for name in ("method", "route", "domain") if choice.get(name) is not None}
        return {" ".join(map(str, asked.values())): asked}
    ways: dict[str, dict[str, Any]] = {
        "n4sid": {"method": "n4sid"},
        "records on lines": {"route": "records", "domain": "z"},
        "OKID and ERA": {"route": "markov", "method": "era"},
    }
    if usual_route(records) == "frf":
        ways["Loewner of frequency responses"] = {"route": "frf", "method": "loewner", "domain": "s"}
    return ways


class _Tried(NamedTuple):
    """A way and an order with its models, one a fold, none where it failed.

    `blocks`, `levels`: simulation errors of stretches of the hold-out, and twice their negative log likelihood per sample.
    `refined`: to the least errors of prediction. `own`: nothing is held out, and the likelihood pays for its unknowns.
    """

    candidate: Candidate
    way: dict[str, Any]
    models: tuple[StateSpace, ...] = ()
    blocks: RealArray = np.zeros(0)
    levels: RealArray = np.zeros(0)
    refined: bool = False
    own: bool = False


def _of_fold(
    fold: _Fold, way: dict[str, Any], orders: list[int], options: dict[str, Any], stable: bool
) -> dict[int, tuple[StateSpace, int]]:
    """Return sampled models of one row by order with the poles that were mirrored; of lower orders where a short record asks it."""
    try:
        cuts = sweep(fold.fitted, orders=orders, deviations=False, **{**options, **way})
        found = {}
        for cut in cuts:
            model, mirrored = deterministic(cuts.pipeline.matrix, cut.triple, cut.modal), 0
            if stable:
                model, mirrored, _ = stabilized(model, cuts.pipeline.response)
            found[cut.order] = sampled(model, fold.fitted), mirrored
        return found
    except (DataError, ValueError, ArithmeticError):
        if len(orders) < 2:
            raise
        return _of_fold(fold, way, orders[: len(orders) // 2], options, stable)


def _tried(
    name: str, way: dict[str, Any], folds: list[_Fold], orders: list[int], options: dict[str, Any], stable: bool
) -> Iterator[_Tried]:
    """Yield a candidate an order by one row, fitted to the rest of each fold and simulated on what is held out."""
    try:
        by_fold = [_of_fold(fold, way, orders, options, stable) for fold in folds]
    except (DataError, ValueError, ArithmeticError) as error:
        yield _Tried(Candidate(name, 0, failure=as_printed(error)), way)
        return
    for order in sorted(set.intersection(*(set(found) for found in by_fold))):
        models = tuple(found[order][0] for found in by_fold)
        yield _judged(Candidate(name, order, mirrored=max(found[order][1] for found in by_fold)), way, models, folds)


def _judged(
    candidate: Candidate,
    way: dict[str, Any],
    models: tuple[StateSpace, ...],
    folds: list[_Fold],
    *,
    refined: bool = False,
) -> _Tried:
    """Return a candidate with the errors of its models on stretches of the hold-out, mean over the outputs, see `FreeRun.squares`."""
    blocks, levels = [], []
    for model, fold in zip(models, folds, strict=True):
        plain = replace(model, gain=None, innovation_covariance=None)
        runs = [(y, free_run(plain, y, u)) for y, u in runs_of(fold.tested)]
        power = np.var(np.concatenate([y - y.mean(axis=0) for y, _ in runs]), axis=0)
        with np.errstate(all="ignore"):
            left = [f.squares(y, power) for y, f in runs]
            seen = [f.likelihood(y) for y, f in runs]
        blocks += [float(np.mean(stretch)) for stretch in np.array_split(np.concatenate(left), _STRETCHES)]
        # what a model was fitted to itself it explains too well by its unknowns: Schwarz, Annals of Statistics 6 (1978), 461-464
        samples = sum(fold.tested.samples)
        (l, m), n = model.D.shape, model.order
        own = (n * (l + m) + l * m) * np.log(samples) / samples if fold.fitted is fold.tested else 0.0
        levels += [float(np.mean(stretch)) + own for stretch in np.array_split(np.concatenate(seen), _STRETCHES)]
    scored = candidate._replace(free_run=100 * (1 - float(np.mean(blocks))))
    return _Tried(scored, way, models, np.array(blocks), np.array(levels), refined, folds[0].fitted is folds[0].tested)


def _refined(found: list[_Tried], folds: list[_Fold]) -> Iterator[_Tried]:
    """Yield candidates refined to the least errors of prediction, the last at the lowest order that is as good: by halving, on one fold.

    At orders above that of the structure a descent spends what is too much on noise, so that orders are not compared before it.
    """
    best = _best(found)
    starts: dict[int, _Tried] = {}
    for one in found:
        order = one.candidate.order
        if order not in starts or _level(one) < _level(starts[order]):
            starts[order] = one
    orders = sorted(starts)
    seen: dict[int, _Tried] = {}

    def descended(order: int, folds_of: list[_Fold]) -> _Tried | None:
        start = starts[order]
        first = len(folds) - len(folds_of)
        models = [
            least_prediction_errors(model, fold.fitted)
            for model, fold in zip(start.models[first:], folds_of, strict=True)
        ]
        whole = tuple(model for model in models if model is not None)
        if len(whole) < len(models):
            return None
        name = f"{start.candidate.how}, prediction errors minimized"
        return _judged(
            Candidate(name, order, mirrored=start.candidate.mirrored), start.way, whole, folds_of, refined=True
        )

    def tried(order: int) -> _Tried | None:
        if order not in seen and (one := descended(order, folds[-1:])) is not None:
            seen[order] = one
        return seen.get(order)

    low, high = -1, orders.index(best.candidate.order)
    tried(orders[high])
    while high - low > 1:
        middle = (low + high) // 2
        there = tried(orders[middle])
        if there is not None and _as_good(there.levels, min((s.levels for s in seen.values()), key=np.mean)):
            high = middle
        else:
            low = middle
    for order in (orders[high], *orders[high + 1 : high + 2]):
        if tried(order) is not None and (whole := descended(order, folds)) is not None:
            yield whole


def _of_records(
    records: Records,
    order: int | None,
    choice: dict[str, Any],
    notes: tuple[Note, ...],
    *,
    stable: bool,
    holdout: float,
) -> RealizedModel:
    folds, words = _folds(records, holdout)
    options = {k: v for k, v in choice.items() if k not in ("method", "route", "domain") and v is not None}
    orders = [order] if order else [*range(2, _FINE_ORDERS + 1, 2), *range(_FINE_ORDERS + 4, _MAX_ORDER + 1, 4)]
    tried = [
        one for name, way in _ways(records, choice).items() for one in _tried(name, way, folds, orders, options, stable)
    ]
    found = [t for t in tried if np.isfinite(t.candidate.free_run)]
    if not found:  # nothing can be fitted to a part: what identify finds in all, or its error
        return _of_one(records, order, choice, stable=stable)
    more = list(_refined(found, folds))
    tried, found = tried + more, found + more
    best = _best(found)
    validation = _validation(best, tried, folds, words)
    model, said = _again(best, records, options, stable=stable)
    warning = (*_warnings(validation, asked=choice.get("route")), *_too_few_tones(records, model))
    return RealizedModel(
        **_fields(model, records),
        notes=(*notes, *said, *warning),
        validation=validation,
        directions=directions(model, records),
    )


def _best(found: list[_Tried]) -> _Tried:
    """Return the candidate of fewest states that simulates as well as the best, by what is held out.

    With strong unmeasured forces good models differ by chance, and the best of sixty is the luckiest: all stay that no test tells apart
    (`_confidence_set`). Between these the likelihood decides, of what simulation leaves, an autoregression for its colour; of what
    predicts as well, to one standard error of the difference, that of fewest states whose error is within one of the least. Breiman et
    al., Classification and Regression Trees, 1984, section 3.4.3. Where nothing is held out, chance is no excuse: what simulates as well as
    the best of every row comes first.
    """
    if any(t.own for t in found):
        # more states simulate better what they were fitted to: likelihood chooses the order of a row, and growing poles speak against one
        sound = [t for t in found if not t.candidate.mirrored] or found
        names = dict.fromkeys(t.candidate.how for t in sound)
        able = _simulating([min((t for t in sound if t.candidate.how == name), key=_level) for name in names])
    else:
        able = _confidence_set(found)
    likely = min(able, key=_level)
    able = _simulating([t for t in able if _as_good(t.levels, likely.levels)])
    return min(able, key=lambda t: (t.candidate.order, _level(t)))


def _confidence_set(tried: list[_Tried]) -> list[_Tried]:
    """Return those whose errors on the held-out stretches do not differ significantly.

    d_i is the mean logarithm of the error of candidate i, less that of all. The one of the largest t = d / sd(d) goes, and the others are
    compared again, until that t is what the largest of equal candidates exceeds in one of twenty: of stretches drawn again, with
    replacement, for all candidates the same. By logarithms no stretch outweighs the others. Hansen, Lunde and Nason, "The model confidence
    set", Econometrica 79 (2011), 453-497.
    """
    rng = np.random.default_rng(0)
    left = np.log([t.blocks for t in tried]).reshape(len(tried), -1, _STRETCHES)
    draws = rng.integers(0, _STRETCHES, (left.shape[1], _DRAWS, _STRETCHES))
    again = np.mean([left[:, part, drawn].mean(axis=-1) for part, drawn in enumerate(draws)], axis=0)
    mean, kept = left.mean(axis=(1, 2)), np.arange(len(tried))
    while kept.size > 1:
        d = mean[kept] - mean[kept].mean()
        by_chance = again[kept] - again[kept].mean(axis=0) - d[:, None]
        # what differs by rounding does not differ
        deviation = np.maximum(np.sqrt(np.mean(by_chance**2, axis=1)), np.sqrt(np.finfo(float).eps))
        largest, worst = np.max(by_chance / deviation[:, None], axis=0), int(np.argmax(d / deviation))
        if d[worst] <= max(float(np.quantile(largest, 1 - _BY_CHANCE)), 1.0) * deviation[worst]:
            break
        kept = np.delete(kept, worst)
    return [tried[i] for i in kept]


def _simulating(tried: list[_Tried]) -> list[_Tried]:
    """Return those that simulate as well as the best of them, see `_as_good`."""
    top = min(tried, key=lambda t: float(np.mean(t.blocks)))
    return [t for t in tried if _as_good(t.blocks, top.blocks)]


def _level(tried: _Tried) -> float:
    return float(np.mean(tried.levels))


def _as_good(one: RealArray, top: RealArray) -> bool:
    """Whether the errors on stretches are as small as the smallest, within one standard error of the mean difference."""
    worse = one - top
    return bool(np.mean(worse) <= np.std(worse) / np.sqrt(worse.size))


def _validation(best: _Tried, tried: list[_Tried], folds: list[_Fold], words: str) -> ModelValidation:
    parts = [
        rebuilt(with_noise(model, fold.fitted), fold.tested) for model, fold in zip(best.models, folds, strict=True)
    ]
    y, free, ahead = (np.concatenate([part[k] for part in parts]) for k in range(3))
    error = y - ahead
    return ModelValidation(
        free_run=explained(y, free),
        one_step=explained(y, ahead) if np.all(np.isfinite(ahead)) else np.full(y.shape[1], np.nan),
        whiteness=colour(error) if np.all(np.isfinite(error)) else np.nan,
        order=best.candidate.order,
        method=best.candidate.how,
        candidates=tuple(t.candidate for t in tried),
        held_out=words,
        outputs=folds[0].tested.output_dofs,
    )


def _again(
    best: _Tried, records: Records, options: dict[str, Any], *, stable: bool
) -> tuple[StateSpace, tuple[Note, ...]]:
    """Return the model of all records by the way that was best; that of a part where it leaves less than half of all records.

    A model that was fitted to all records is what it is: at another largest order its data matrix, and so its poles, would be others.
    """
    if best.own:
        count = best.candidate.mirrored
        grew = Note("mirrored", {"poles": count}, f"{count} unstable poles were mirrored; stable=False keeps them")
        return with_noise(best.models[0], records), (grew,) if count else ()
    whole: list[tuple[StateSpace, tuple[Note, ...]]] = []
    try:
        found = identify(records, order=best.candidate.order, deviations=False, **{**options, **best.way})
        model, notes = found.state_space, found.notes
        if stable:
            model, _, said = stabilized(model, found.response)
            notes = (*notes, *said)
        whole.append((sampled(model, records), notes))
    except DataError as error:
        notes = (Note("fitted part", {}, f"No model fits all records together: {error.found}"),)
    if best.refined and whole:
        descended = least_prediction_errors(whole[0][0], records)
        whole = whole if descended is None else [(descended, notes)]
    text = Note(
        "fitted part", {}, "Fitted to a part of the records: a fit to all of them has more than twice its error"
    )
    whole += [(model, (*notes, text)) for model in best.models]
    plain = [replace(m, gain=None, innovation_covariance=None) for m, _ in whole]
    left = [100 - float(np.mean(validated(m, records)[0])) for m in plain]
    best_part = int(np.argmin(left))
    model, notes = whole[best_part if left[best_part] < left[0] / 2 else 0]
    return with_noise(model, records), notes


def _too_few_tones(records: Records, model: StateSpace) -> tuple[Note, ...]:
    """Return a note where the forces are fewer sinusoids than determine so many states."""
    tones, (outputs, order) = few_tones(records), (len(model.C), model.order)
    if not tones or order * (1 + outputs) <= 2 * len(tones) * outputs:
        return ()
    states, at = 2 * len(tones) * outputs // (1 + outputs), ", ".join(f"{f:.4g}" for f in tones)
    text = (
        f"WARNING: the forces are sinusoids at {at} Hz, which determine {counted(states, 'state')} at most, and the model has {order}: "
        "it is valid only at these frequencies. Drive with noise, a sweep or hits"
    )
    return (Note("few lines", {"states": states, "order": order}, text),)


def _warnings(validation: ModelValidation, asked: str | None) -> tuple[Note, ...]:
    """Return a note where the model explains little of what was held out; `asked`: the route that was."""
    free = float(np.mean(validation.free_run))
    if free >= _MIN_EXPLAINED:
        return ()
    text = f"WARNING: the model explains {free:.1f} % of {validation.held_out} by simulation"
    if asked == "frf":
        text += ". Frequency responses leak, or were not excited on all lines: omit route, and the record itself is fitted, too"
    return (Note("explains little", {"free run": free}, text),)
