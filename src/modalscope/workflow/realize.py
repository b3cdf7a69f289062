"""Realize the model that predicts best what it was not fitted to: candidates by several rows, a part of the records held out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import lfilter

from modalscope.blocks.driven import innovations
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.response import Response
from modalscope.data.setups import as_test
from modalscope.data.shown import Shown, cells_of, summary_of, text_table
from modalscope.data.statespace import StateSpace
from modalscope.functions.poles import one_of_each_pair, to_discrete
from modalscope.identification.identify import identify
from modalscope.identification.options import AllOptions
from modalscope.identification.routes import usual_route, without_delays
from modalscope.identification.sweep import sweep
from modalscope.modal.eigenmodes import deterministic, from_modes
from modalscope.numerics.arguments import COUNT, between, named
from modalscope.numerics.checks import Array, RealArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread

#: Orders that are tried: even ones to the first number, then every fourth.
_FINE_ORDERS, _MAX_ORDER = 20, 40

#: Candidates within this many per cent of the best free run count as equal: of these the best one-step prediction is taken.
_EQUAL = 0.5

#: Cuts of a run that are considered, evenly, and the least share of the forces in either part, relative to what was asked.
_CUTS, _MIN_SHARE = 40, 0.5

#: Rows of a run to which first state and offset are fitted at most.
_MAX_ROWS = 20_000

#: Condition of eigenvectors beyond which a model is simulated sample by sample.
_MAX_CONDITION = 1e8

#: Variance that a model by frequency responses explains of its own records, in per cent, below which it says so: less than all but a tenth.
_MIN_EXPLAINED = 90.0


class Candidate(NamedTuple):
    """A model that was tried: how, its order, and the variance explained of the held-out part, in per cent, mean over the outputs.

    `one_step`: NaN where it was not computed. `mirrored`: poles that were unstable. `failure`: why there is no model.
    """

    how: str
    order: int
    free_run: float = np.nan
    one_step: float = np.nan
    mirrored: int = 0
    failure: str = ""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class ModelValidation(Shown):
    """How well a model that was fitted to a part of the records explains the rest.

    Parameters
    ----------
    free_run : array, (l,)
        Variance explained by simulation from the inputs alone, in per cent, of every output: 100 (1 - var(y - y^) / var(y)).
    one_step : array, (l,)
        The same by predictions one sample ahead; NaN without a gain.
    whiteness : float
        Largest correlation of the one-step errors of an output at lags of 1 to 10 samples, over two deviations of that of white noise:
        about 1 for white errors; NaN without a gain.
    order : int
    method : str
    candidates : tuple of Candidate
    held_out : str
        What was kept apart, in words.
    """

    free_run: RealArray
    one_step: RealArray
    whiteness: float
    order: int
    method: str
    candidates: tuple[Candidate, ...] = ()
    held_out: str = ""

    def table(self) -> str:
        """Return one line a candidate, the best first."""
        rows = [("model", "order", "free run %", "one step %", "mirrored poles", "")]
        ranked = sorted(self.candidates, key=lambda c: (np.isnan(c.free_run), -c.free_run))
        rows += [
            (c.how, str(c.order), f"{c.free_run:.1f}", f"{c.one_step:.1f}", str(c.mirrored), c.failure) for c in ranked
        ]
        return text_table(rows, left=(0, 5))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class RealizedModel(StateSpace):
    """A state-space model with what was found on the way.

    Parameters
    ----------
    notes : tuple of Note
    validation : ModelValidation, optional
        On the part of records with inputs that was held out; None for responses, and with holdout=0.
    initial_states : array, (runs, n), optional
        First states that fit the records best.
    """

    notes: tuple[Note, ...] = ()
    validation: ModelValidation | None = None
    initial_states: RealArray | None = None


@summary_of.register
def _(found: ModelValidation) -> str:
    free, one = np.mean(found.free_run), np.mean(found.one_step)
    return f"{found.method} at order {found.order} explains {free:.1f} % of {found.held_out} by simulation, {one:.1f} % one sample ahead"


@cells_of.register
def _(found: ModelValidation) -> list[list[str]]:
    return [[f"{free:.1f}", f"{one:.1f}"] for free, one in zip(found.free_run, found.one_step, strict=True)]


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
    ERA, and for hits and periodic forces Loewner matrices of their frequency responses. Each is fitted to a part of the records at
    many orders and simulates the rest from the inputs alone; the best is fitted again to all, and has the gain of its innovations.

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
        A `StateSpace` with `notes`, `validation` and `initial_states`.

    Raises
    ------
    DataError
        As in `identify`.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> record = chain5().simulate(inputs="white", samples=1500, sampling_rate=20.0, noise=0.02, seed=1)
    >>> model = realize(record, order=10)
    >>> bool(model.validation.free_run.min() > 99), bool(abs(model.poles).max() < 1)
    (True, True)
    """
    test = as_test(data) if isinstance(data, list | tuple) else data
    choice = {"method": method, "domain": domain, **{k: v for k, v in options.items() if v is not None}}
    records = as_records(test) if isinstance(test, Signals) else test
    if not isinstance(records, Records) or not records.input_dofs or holdout == 0:
        return _of_one(data, order, choice, stable=stable)
    excluded = choice.pop("exclude", None)
    records = records if excluded is None else records.select(exclude=excluded)
    records, _, notes = without_delays(records, choice.pop("delays", None))
    return _of_records(records, order, {**choice, "delays": {}}, notes, stable=stable, holdout=holdout)


def _of_one(data: Any, order: int | None, choice: Mapping[str, Any], *, stable: bool) -> RealizedModel:
    found = identify(data, order=order, deviations=False, **choice)
    model, notes = found.state_space, (*found.notes, _fit_error(found.fit_error))
    if stable:
        model, _, said = stabilized(model, found.response)
        notes = (*notes, *said)
    return RealizedModel(**_fields(model), notes=notes)


def _fit_error(error: float) -> Note:
    return Note("fit error", {"error": error}, f"fit error {100 * error:.3g} %")


def _fields(model: StateSpace) -> dict[str, Any]:
    return {f.name: getattr(model, f.name) for f in fields(StateSpace)}


# -------------------------------------------------------------------------------------------------------------- stability
def stabilized(model: StateSpace, response: Response) -> tuple[StateSpace, int, tuple[Note, ...]]:
    """Return a model with growing poles mirrored, inputs and direct term fitted again to the response, their number, and the cost.

    z goes to 1 / z*, s to -s*; shapes stay.
    """
    values, vectors = np.linalg.eig(model.A)
    grows = np.abs(values) >= 1 if model.dt else values.real >= 0
    if not np.any(grows):
        return model, 0, ()
    s = np.log(values.astype(complex)) / model.dt if model.dt else values.astype(complex)
    kept = one_of_each_pair(s)
    s, shapes = s[kept], model.C @ vectors[:, kept]
    # a pole on the axis itself is moved by rounding of the sampled one, so that it decays
    s = np.minimum(-np.abs(s.real), -1e-9 * np.abs(s)) + 1j * s.imag
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
    text = f"{count} poles that grow were mirrored: the stable model leaves {100 * cost:.3g} % of the data; stable=False keeps them"
    return made, count, (Note("mirrored", {"poles": count, "left": cost}, text),)


# ------------------------------------------------------------------------------------------------------------- validation
class _Parts(NamedTuple):
    """Records to fit to, and of every run the samples that are held out."""

    fitted: Records
    held_out: tuple[slice, ...]
    words: str


def _parts(records: Records, holdout: float) -> _Parts:
    """Hold out the last part of every run, with a share of its forces; of many runs the last ones, each as a whole.

    A single transient has no such part: all of it is fitted, and simulated.
    """
    count = len(records.runs)
    whole = int(count * holdout)
    if whole:
        kept = records.runs[: count - whole]
        held = tuple(slice(0, 0) if r < len(kept) else slice(0, None) for r in range(count))
        return _Parts(_of_runs(records, kept), held, f"{whole} of {count} runs")
    ends = [_end(run, holdout) for run in records.runs]
    if None in ends:
        return _Parts(
            records,
            tuple(slice(0, None) for _ in ends),
            "what it was fitted to (one transient, no part of it can be held out)",
        )
    runs = tuple(
        replace(run, outputs=run.outputs[:end], inputs=None if run.inputs is None else run.inputs[:end])
        for run, end in zip(records.runs, ends, strict=True)
    )
    held = tuple(slice(end, None) for end in ends)
    part = 1 - sum(end or 0 for end in ends) / sum(records.samples)
    return _Parts(_of_runs(records, runs), held, f"the last {100 * part:.0f} %")


def _end(run: Signals, holdout: float) -> int | None:
    """Return where a run is cut: where the part `holdout` of its time is left, or earlier so that half of that part of the forces is.

    None where the forces lie too close together for any cut.
    """
    assert run.inputs is not None
    u = run.inputs - np.median(run.inputs, axis=0)
    power = np.sum(u**2 / np.maximum(np.mean(u**2, axis=0), np.finfo(float).tiny), axis=1)
    ends = np.unique(np.linspace(0, run.samples, _CUTS + 1)[1:-1].astype(int))
    rest = 1 - np.cumsum(power)[ends - 1] / max(float(power.sum()), np.finfo(float).tiny)
    able = ends[(rest >= _MIN_SHARE * holdout) & (rest <= 1 - _MIN_SHARE * (1 - holdout))]
    wanted = (1 - holdout) * run.samples
    return int(able[np.argmin(np.abs(able - wanted))]) if able.size else None


def _of_runs(records: Records, runs: Iterable[Signals]) -> Records:
    return replace(records, runs=tuple(runs), groups=None)


def _runs(records: Records) -> Iterator[tuple[RealArray, RealArray]]:
    """Yield outputs (N, l) and all inputs (N, m) of every run."""
    for r, run in enumerate(records.runs):
        u = np.zeros((run.samples, len(records.input_dofs)))
        assert run.inputs is not None
        u[:, list(records.inputs_of(r))] = run.inputs
        yield run.outputs, u


def driven_outputs(model: StateSpace, u: RealArray) -> RealArray:
    """Return the outputs (N, l) of a sampled model at rest, pole by pole where its eigenvectors allow it."""
    values, V = np.linalg.eig(model.A)
    if np.linalg.cond(V) > _MAX_CONDITION:
        return model.simulate(u)
    pushed = u @ np.linalg.solve(V, model.B.astype(complex)).T
    states = np.stack([lfilter([0, 1], [1, -z], x) for z, x in zip(values, pushed.T, strict=True)], axis=1)
    return np.asarray((states @ (model.C @ V).T).real + u @ model.D.T)


def free_run(model: StateSpace, y: RealArray, u: RealArray, fitted: slice) -> tuple[RealArray, RealArray]:
    """Return what a model simulates from the inputs, (N, l), with first state and offset fitted to some samples; and the state (n,)."""
    with np.errstate(all="ignore"):
        driven = driven_outputs(model, u)
        if not np.all(np.isfinite(driven)):
            return np.full_like(y, np.inf), np.zeros(model.order)
    l, n = model.C.shape
    rows = np.arange(len(y))[fitted][:_MAX_ROWS]
    free = np.empty((len(y), l, n))
    power = np.array(model.C)
    for row in free:
        row[:] = power
        power = power @ model.A
    columns = np.concatenate([free, np.broadcast_to(np.eye(l), (len(y), l, l))], axis=2)
    theta = np.linalg.lstsq(columns[rows].reshape(-1, n + l), (y - driven)[rows].ravel(), rcond=None)[0]
    return driven + columns @ theta, theta[:n]


def explained(y: Array, rebuilt: Array) -> RealArray:
    """Return 100 (1 - var(y - y^) / var(y)) of every output, (l,); -inf for what is not finite."""
    power = np.var(y, axis=0)
    with np.errstate(all="ignore"):
        share = 100 * (1 - np.var(y - rebuilt, axis=0) / np.where(power > 0, power, np.inf))
    return np.where(np.isfinite(share), share, -np.inf)


def validated(model: StateSpace, records: Records, held_out: tuple[slice, ...]) -> tuple[RealArray, RealArray, float]:
    """Return the variance explained of held-out samples by free run and one step ahead, (l,) each, and how coloured the errors are."""
    measured, free, ahead = [], [], []
    for run, (y, u), held in zip(records.runs, _runs(records), held_out, strict=True):
        if not len(y[held]):
            continue
        fitted = slice(0, held.start) if held.start else slice(None)
        simulated, first = free_run(model, y, u, fitted)
        measured.append(y[held])
        free.append(simulated[held])
        if model.gain is not None:
            offset = np.mean(y[fitted], axis=0) - np.mean(simulated[fitted], axis=0)
            one = Signals(outputs=y - offset, inputs=u, sampling_rate=run.sampling_rate)
            ahead.append(model.predict(one, first)[held] + offset)
    y = np.concatenate(measured)
    by_free = explained(y, np.concatenate(free))
    if not ahead:
        return by_free, np.full(y.shape[1], np.nan), np.nan
    error = y - np.concatenate(ahead)
    return by_free, explained(y, y - error), _colour(error)


def simulated(model: StateSpace, record: Any) -> ModelValidation:
    """Return how well a sampled model simulates a whole record and predicts it one sample ahead.

    Raises `DataError`: a continuous model, or a record without its inputs and outputs at its rate.
    """
    check_kind("the record of a model", record, (Signals, Records))
    records = as_records(record) if isinstance(record, Signals) else record
    (l, m), rate = model.D.shape, np.nan if model.dt is None else 1 / model.dt
    have = len(records.output_dofs), len(records.input_dofs)
    if have != (l, m) or not np.isclose(records.sampling_rate, rate):
        found = f"the record has {have[0]} outputs and {have[1]} inputs at {records.sampling_rate:g} Hz"
        asked = f"a record of {l} outputs and {m} inputs at {rate:g} Hz was asked"
        change = "Select the model's channels and resample to its rate; of a continuous model take to_discrete(dt)."
        raise DataError(asked, found, change)
    free, one, colour = validated(model, records, tuple(slice(0, None) for _ in records.runs))
    return ModelValidation(
        free_run=free, one_step=one, whiteness=colour, order=model.order, method="the model", held_out="the record"
    )


def _colour(error: RealArray) -> float:
    """Return the largest correlation at lags 1 to 10 over two deviations of that of white noise, 2 / sqrt(N)."""
    e = error - error.mean(axis=0)
    power = np.sum(e**2, axis=0)
    lags = [np.abs(np.sum(e[k:] * e[:-k], axis=0)) / np.where(power > 0, power, 1) for k in range(1, min(11, len(e)))]
    return float(np.max(lags) * np.sqrt(len(e)) / 2) if lags else np.nan


def with_innovations(model: StateSpace, records: Records) -> StateSpace:
    """Return a model with the gain and the covariance of its innovations on records."""
    runs = list(_runs(records))
    level = [np.sqrt(np.mean(np.concatenate([run[side] for run in runs]) ** 2, axis=0)) for side in (0, 1)]
    of_outputs, of_inputs = (np.where(one > 0, one, 1.0) for one in level)
    scaled = StateSpace(
        A=model.A,
        B=model.B * of_inputs,
        C=model.C / of_outputs[:, None],
        D=model.D * of_inputs / of_outputs[:, None],
        dt=model.dt,
    )
    noise = innovations(scaled, ((y / of_outputs, u / of_inputs) for y, u in runs))
    if noise is None:
        return model
    gain, covariance = noise
    return replace(model, gain=gain / of_outputs, innovation_covariance=covariance * np.outer(of_outputs, of_outputs))


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


def _sampled(model: StateSpace, rate: float) -> StateSpace:
    return model if model.dt is not None else model.to_discrete(1 / rate)


class _Tried(NamedTuple):
    candidate: Candidate
    way: dict[str, Any]
    model: StateSpace | None


def _tried(
    name: str,
    way: dict[str, Any],
    records: Records,
    parts: _Parts,
    orders: list[int],
    options: dict[str, Any],
    stable: bool,
) -> Iterator[_Tried]:
    """Yield a candidate an order by one row, fitted to its part and simulated on the rest; to lower orders where short records ask it."""
    try:
        cuts = sweep(parts.fitted, orders=orders, deviations=False, **{**options, **way})
        response = cuts.pipeline.response
        for cut in cuts:
            model = deterministic(cuts.pipeline.matrix, cut.triple, cut.modal)
            mirrored = 0
            if stable:
                model, mirrored, _ = stabilized(model, response)
            model = _sampled(model, records.sampling_rate)
            free = float(np.mean(validated(model, records, parts.held_out)[0]))
            yield _Tried(Candidate(name, cut.order, free, mirrored=mirrored), way, model)
    except (DataError, ValueError, ArithmeticError) as error:
        fewer = orders[: len(orders) // 2]
        if fewer:
            yield from _tried(name, way, records, parts, fewer, options, stable)
            return
        yield _Tried(Candidate(name, 0, failure=" ".join(str(error).split())), way, None)


def _of_records(
    records: Records,
    order: int | None,
    choice: dict[str, Any],
    notes: tuple[Note, ...],
    *,
    stable: bool,
    holdout: float,
) -> RealizedModel:
    parts = _parts(records, holdout)
    options = {k: v for k, v in choice.items() if k not in ("method", "route", "domain") and v is not None}
    orders = [order] if order else [*range(2, _FINE_ORDERS + 1, 2), *range(_FINE_ORDERS + 4, _MAX_ORDER + 1, 4)]
    tried = [
        one
        for name, way in _ways(records, choice).items()
        for one in _tried(name, way, records, parts, orders, options, stable)
    ]
    found = [t for t in tried if t.model is not None and np.isfinite(t.candidate.free_run)]
    if not found:  # nothing can be fitted to a part: what identify finds in all, or its error
        return _of_one(records, order, choice, stable=stable)
    best, validation = _best(found, tried, records, parts)
    model, said = _again(best, records, options, stable=stable)
    first = [free_run(model, y, u, slice(None))[1] for y, u in _runs(records)]
    warning = _warnings(validation, asked=choice.get("route"))
    return RealizedModel(
        **_fields(model), notes=(*notes, *said, *warning), validation=validation, initial_states=np.array(first)
    )


def _best(found: list[_Tried], tried: list[_Tried], records: Records, parts: _Parts) -> tuple[_Tried, ModelValidation]:
    """Return the candidate of the best one-step prediction among those whose free run is within half a per cent of the best."""
    top = max(t.candidate.free_run for t in found)
    near = [t for t in found if t.candidate.free_run >= top - _EQUAL]
    fewest = {
        name: min((t for t in near if t.candidate.how == name), key=lambda t: t.candidate.order)
        for name in {t.candidate.how for t in near}
    }
    judged = []
    for t in sorted(fewest.values(), key=lambda t: t.candidate.how):
        assert t.model is not None
        free, one, colour = validated(with_innovations(t.model, parts.fitted), records, parts.held_out)
        judged.append((t, free, one, colour))
    best = max(judged, key=lambda j: (np.nan_to_num(np.mean(j[2]), nan=-np.inf), -j[0].candidate.order))
    t, free, one, colour = best
    with_ahead = {id(j[0]): float(np.mean(j[2])) for j in judged}
    candidates = tuple(c.candidate._replace(one_step=with_ahead.get(id(c), np.nan)) for c in tried)
    validation = ModelValidation(
        free_run=free,
        one_step=one,
        whiteness=colour,
        order=t.candidate.order,
        method=t.candidate.how,
        candidates=candidates,
        held_out=parts.words,
    )
    return t, validation


def _again(
    best: _Tried, records: Records, options: dict[str, Any], *, stable: bool
) -> tuple[StateSpace, tuple[Note, ...]]:
    """Return the model of all records by the way that was best; that of the part where all together give a worse one."""
    try:
        found = identify(records, order=best.candidate.order, deviations=False, **{**options, **best.way})
        model, notes = found.state_space, found.notes
        if stable:
            model, _, said = stabilized(model, found.response)
            notes = (*notes, *said)
        model = with_innovations(_sampled(model, records.sampling_rate), records)
        whole = tuple(slice(0, None) for _ in records.runs)
        if best.model is not None:
            both = [float(np.mean(validated(m, records, whole)[0])) for m in (model, best.model)]
            if both[1] > both[0] + _EQUAL:
                text = f"fitted to a part alone, which explains {both[1]:.1f} % of all records; a fit to all explains {both[0]:.1f} %"
                return with_innovations(best.model, records), (*notes, Note("fitted part", {}, text))
        return model, notes
    except DataError as error:
        assert best.model is not None
        return with_innovations(best.model, records), (
            Note("fitted part", {}, f"fitted to a part alone: {error.found}"),
        )


def _warnings(validation: ModelValidation, asked: str | None) -> tuple[Note, ...]:
    """Return a note where the model explains little of what was held out; `asked`: the route that was."""
    free = float(np.mean(validation.free_run))
    if free >= _MIN_EXPLAINED:
        return ()
    text = f"WARNING: the model explains {free:.1f} % of {validation.held_out} by simulation"
    if asked == "frf":
        text += ". Frequency responses leak, or were not excited on all lines: omit route, and the record itself is fitted, too"
    return (Note("explains little", {"free run": free}, text),)
