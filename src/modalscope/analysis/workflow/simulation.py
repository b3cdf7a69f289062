"""Simulate and predict records by a model, and say what of them it explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sla
from scipy.signal import lfilter
from scipy.special import ndtri

from modalscope.data.records import Records, Signals, as_records
from modalscope.data.shown import Shown, cells_of, summary_of, text_table
from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.driven import runs_of, with_innovations
from modalscope.numerics.checks import Array, RealArray, check_kind
from modalscope.numerics.errors import DataError

#: Numbers of a run to which first state and offset are fitted at most.
_MAX_NUMBERS = 20_000

#: Samples of the past in an autoregression at most, numbers in them, and their share of the samples: prediction by chance.
_MAX_PAST, _MAX_PAST_ROWS, _MAX_PAST_SHARE = 30, 400, 0.1

#: What simulations leave below this fraction of an output is rounding, and not whitened.
_ROUNDING = 1e-10

#: Condition of eigenvectors beyond which a model is simulated sample by sample.
_MAX_CONDITION = 1e8


class Candidate(NamedTuple):
    """A model that was tried: how, its order, and the variance explained of the held-out part, in per cent, mean over the outputs.

    First states are fitted to that part, and count as `FreeRun.squares` says. `mirrored`: poles that were unstable. `failure`: why there
    is no model.
    """

    how: str
    order: int
    free_run: float = np.nan
    mirrored: int = 0
    failure: str = ""


#: Lags at which errors are correlated with themselves, and the share of white records that are called coloured.
_LAGS, _FALSE = 10, 0.05


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
    outputs: tuple[str, ...] = ()

    @property
    def white(self) -> bool:
        """Whether the errors of prediction are no more correlated than nineteen of twenty records of white noise (Bonferroni)."""
        limit = -ndtri(_FALSE / (2 * _LAGS * self.free_run.size)) / 2
        return bool(self.whiteness <= limit)

    def table_of_outputs(self) -> str:
        """Return one line an output: variance explained by simulation, and one sample ahead, in per cent."""
        names = self.outputs or tuple(map(str, range(1, self.free_run.size + 1)))
        rows = [("output", "free run %", "one step %")]
        rows += [
            (name, f"{free:.1f}", f"{one:.1f}")
            for name, free, one in zip(names, self.free_run, self.one_step, strict=True)
        ]
        return text_table(rows, left=(0,))

    def rows(self) -> list[tuple[str, ...]]:
        """Return a head, and the cells of every candidate, the best first."""
        ranked = sorted(self.candidates, key=lambda c: (np.isnan(c.free_run), -c.free_run))
        cells = [(c.how, str(c.order), f"{c.free_run:.1f}", str(c.mirrored), c.failure) for c in ranked]
        return [("model", "order", "free run %", "mirrored poles", ""), *cells]

    def table(self) -> str:
        """Return one line a candidate, the best first."""
        return text_table(self.rows(), left=(0, 4))


@summary_of.register
def _(found: ModelValidation) -> str:
    free, one = np.mean(found.free_run), np.mean(found.one_step)
    said = f"{found.method} at order {found.order} explains {free:.1f} % of {found.held_out} by simulation"
    if not np.isfinite(one):
        return f"{said}; it has no gain to predict with"
    errors = "white" if found.white else f"coloured ({found.whiteness:.1f} times two deviations of white noise)"
    return f"{said}, {one:.1f} % one sample ahead; errors of prediction {errors}"


@cells_of.register
def _(found: ModelValidation) -> list[list[str]]:
    return [[f"{free:.1f}", f"{one:.1f}"] for free, one in zip(found.free_run, found.one_step, strict=True)]


def driven_outputs(model: StateSpace, u: RealArray) -> RealArray:
    """Return the outputs (N, l) of a sampled model at rest, pole by pole where its eigenvectors allow it."""
    values, V = np.linalg.eig(model.A)
    if np.linalg.cond(V) > _MAX_CONDITION:
        return model.simulate(u)
    pushed = u @ np.linalg.solve(V, model.B.astype(complex)).T
    states = np.stack([lfilter([0, 1], [1, -z], x) for z, x in zip(values, pushed.T, strict=True)], axis=1)
    return np.asarray((states @ (model.C @ V).T).real + u @ model.D.T)


class Whitener(NamedTuple):
    """Filters (p + 1, l, l) that whiten the errors of a simulation; `level`: of its innovations, see `whitener`."""

    filters: RealArray
    level: float

    def __call__(self, v: RealArray) -> RealArray:
        """Return e(t) = sum_k F_k v(t - k), (N - p, l, ...), of the errors, (N, l, ...)."""
        p, out = len(self.filters) - 1, np.zeros((len(v) - len(self.filters) + 1, *v.shape[1:]))
        for k, F in enumerate(self.filters):
            out += np.moveaxis(np.tensordot(v[p - k : len(v) - k], F, (1, 1)), -1, 1)
        return out


def whitener(left: Sequence[RealArray]) -> Whitener | None:
    """Fit an autoregression to the simulation errors of runs, (N, l) each, of the order of least AIC; None for rounding or too few samples.

    `level`: log det of the covariance of its innovations, and 2 p l^2 / N for what it was fitted: the likelihood, two a sample.

    References
    ----------
    Akaike, "A new look at the statistical model identification", IEEE Trans. Automatic Control 19 (1974), 716-723.
    """
    l, samples = left[0].shape[1], sum(map(len, left))
    most = min(_MAX_PAST, _MAX_PAST_ROWS // l, int(_MAX_PAST_SHARE * samples / l), min(map(len, left)) // 2)
    rows = [np.hstack([v[most - k : len(v) - k] for k in (*range(1, most + 1), 0)]) for v in left]
    both = np.concatenate(rows)
    if most < 1 or len(both) <= both.shape[1]:
        return None
    R = np.asarray(sla.qr(both, mode="r", check_finite=False)[0][: both.shape[1]])
    beyond = [R[l * p :, l * most :] for p in range(most + 1)]
    signs, levels = np.linalg.slogdet(np.array([part.T @ part / len(both) for part in beyond]))
    if np.any(signs <= 0):
        return None
    criterion = levels + 2 * l**2 * np.arange(most + 1) / len(both)
    p = int(np.argmin(criterion))
    past = sla.solve_triangular(R[: l * p, : l * p], R[: l * p, l * most :]) if p else np.zeros((0, l))
    filters = np.concatenate([np.eye(l)[None], -past.reshape(p, l, l).transpose(0, 2, 1)])
    root = np.asarray(sla.qr(beyond[p], mode="r")[0][:l].T) / np.sqrt(len(both))
    size = np.abs(np.diag(root))
    # innovations that follow from each other are rounding
    return (
        Whitener(np.linalg.solve(root, filters), float(criterion[p])) if size.min() > _ROUNDING * size.max() else None
    )


class FreeRun(NamedTuple):
    """What a model simulates from the inputs, (N, l), with the first state (n,) and the offset (l,) that fit best."""

    outputs: RealArray
    first: RealArray
    offset: RealArray

    def whitener(self, y: RealArray) -> Whitener | None:
        """Return the filter that whitens the errors; None for rounding."""
        left = y - self.outputs
        return whitener([left]) if np.all(left.std(axis=0) > _ROUNDING * y.std(axis=0)) else None

    @property
    def fitted_numbers(self) -> int:
        """Numbers that are fitted to the run itself: first state and offset."""
        return self.first.size + self.offset.size

    def squares(self, y: RealArray, power: RealArray) -> RealArray:
        """Return the squared error of each sample, (N,): |y - y^|^2 over the power (l,) of each output, mean over these.

        First state and offset, p = n + l numbers, are fitted to the run: generalized cross-validation says what errors they would have on
        samples that they were not fitted to, |y - y^|^2 / (1 - p / (N l))^2. Golub, Heath and Wahba, Technometrics 21 (1979), 215-223.
        """
        free = 1 - self.fitted_numbers / y.size
        left = np.mean((y - self.outputs) ** 2 / np.where(power > 0, power, np.inf), axis=1)
        return np.maximum(left / free**2, _ROUNDING**2) if free > 0 else np.full(len(y), np.inf)

    def likelihood(self, y: RealArray) -> RealArray:
        """Return -2 log of the likelihood of every sample (N,), but a constant; inf of a model that grows.

        First state and offset count as the autoregression does, by AIC.
        """
        left, l = y - self.outputs, y.shape[1]
        if not np.all(np.isfinite(left)):
            return np.full(len(y), np.inf)
        fitted = 2 * self.fitted_numbers / len(y) - l
        white = self.whitener(y)
        if white is None:
            power = np.maximum(np.mean(left**2, axis=0), (_ROUNDING * y.std(axis=0)) ** 2 + np.finfo(float).tiny)
            return np.asarray(np.log(power).sum() + np.sum(left**2 / power, axis=1) + fitted)
        errors = np.sum(white(left) ** 2, axis=1)
        # samples that have not all of their past count as the mean of the others
        whole = np.concatenate([np.full(len(y) - len(errors), errors.mean()), errors])
        return np.asarray(whole + white.level + fitted)


def free_run(model: StateSpace, y: RealArray, u: RealArray) -> FreeRun:
    """Simulate a run from its inputs alone; first state and offset are weighted least squares over the first samples, the offset over all.

    The weights are those of an autoregression of the errors: plain least squares fit to the first state what forces that were not
    measured do to modes of little damping, and the more so the more states there are.
    """
    l, n = model.C.shape
    with np.errstate(all="ignore"):
        driven = driven_outputs(model, u)
    rows = max(min(len(y), _MAX_NUMBERS // l), 1)
    free = np.empty((rows, l, n))
    power = np.array(model.C)
    with np.errstate(all="ignore"):
        for row in free:
            row[:] = power
            power = power @ model.A
    if not (np.all(np.isfinite(driven)) and np.all(np.isfinite(free))):
        return FreeRun(np.full_like(y, np.inf), np.zeros(n), np.zeros(l))
    columns = np.concatenate([free, np.broadcast_to(np.eye(l), (rows, l, l))], axis=2)

    def of(columns: RealArray, left: RealArray) -> FreeRun:
        R = sla.qr(np.column_stack([columns.reshape(-1, n + l), left.ravel()]), mode="r", check_finite=False)[0]
        first = np.asarray(np.linalg.lstsq(R[: n + l, :-1], R[: n + l, -1], rcond=None)[0][:n, None], dtype=float)
        # a first state is a pulse at the first sample
        start = StateSpace(A=model.A, B=model.A @ first, C=model.C, D=model.C @ first, dt=model.dt)
        outputs = driven + driven_outputs(start, np.eye(len(y), 1))
        offset = np.mean(y - outputs, axis=0)
        return FreeRun(outputs + offset, np.asarray(first.ravel()), np.asarray(offset))

    found = of(columns, (y - driven)[:rows])
    white = found.whitener(y)
    if white is None or rows - len(white.filters) < n + l:
        return found
    left, past = (y - driven)[:rows], len(white.filters) - 1
    # the first samples have no past to be predicted from, and tell most of the first state: they count by the error of each output
    size = np.std(y - found.outputs, axis=0)
    whole = [
        np.concatenate([each[:past] / size[:, *[None] * (each.ndim - 2)], white(each)]) for each in (columns, left)
    ]
    return of(*whole)


def explained(y: Array, rebuilt: Array) -> RealArray:
    """Return 100 (1 - var(y - y^) / var(y)) of every output, (l,); -inf for what is not finite."""
    power = np.var(y, axis=0)
    with np.errstate(all="ignore"):
        share = 100 * (1 - np.var(y - rebuilt, axis=0) / np.where(power > 0, power, np.inf))
    return np.where(np.isfinite(share), share, -np.inf)


def validated(model: StateSpace, records: Records) -> tuple[RealArray, RealArray, float]:
    """Return the variance explained of records by free run and one step ahead, (l,) each, and how coloured the errors are."""
    y, free, ahead = rebuilt(model, records)
    error = y - ahead
    white = colour(error) if np.all(np.isfinite(error)) else np.nan
    return explained(y, free), explained(y, ahead) if model.gain is not None else np.full(y.shape[1], np.nan), white


def rebuilt(model: StateSpace, records: Records) -> tuple[RealArray, RealArray, RealArray]:
    """Return all outputs of records without the mean of each run, their simulation, and predictions one step ahead (NaN without a gain)."""
    measured, free, ahead = [], [], []
    for run, (y, u) in zip(records.runs, runs_of(records), strict=True):
        simulated, mean = free_run(model, y, u), np.mean(y, axis=0)
        measured.append(y - mean)
        free.append(simulated.outputs - mean)
        if model.gain is None or not np.all(np.isfinite(simulated.outputs)):
            ahead.append(np.full_like(y, np.nan))
            continue
        one = Signals(outputs=y - simulated.offset, inputs=u, sampling_rate=run.sampling_rate)
        with np.errstate(all="ignore"):
            ahead.append(model.predict(one, simulated.first) + simulated.offset - mean)
    return np.concatenate(measured), np.concatenate(free), np.concatenate(ahead)


def sampled(model: StateSpace, records: Records) -> StateSpace:
    """Return a continuous model sampled at the rate of records, its inputs held; a sampled one as it is."""
    return model if model.dt is not None else model.to_discrete(1 / records.sampling_rate)


def simulated(model: StateSpace, record: Any) -> ModelValidation:
    """Return how well a model simulates a whole record and predicts it one sample ahead.

    Raises `DataError`: a record without its inputs and outputs at its rate.
    """
    check_kind("the record of a model", record, (Signals, Records))
    records = as_records(record) if isinstance(record, Signals) else record
    model = sampled(model, records)
    (l, m), rate = model.D.shape, np.nan if model.dt is None else 1 / model.dt
    have = len(records.output_dofs), len(records.input_dofs)
    if have != (l, m) or not np.isclose(records.sampling_rate, rate):
        found = f"the record has {have[0]} outputs and {have[1]} inputs at {records.sampling_rate:g} Hz"
        asked = f"a record of {l} outputs and {m} inputs at {rate:g} Hz:"
        change = "Select the model's channels and resample to its rate."
        raise DataError(asked, found, change)
    free, one, white = validated(model, records)
    return ModelValidation(
        free_run=free,
        one_step=one,
        whiteness=white,
        order=model.order,
        method="the model",
        held_out="the record",
        outputs=records.output_dofs,
    )


def colour(error: RealArray) -> float:
    """Return the largest correlation at lags 1 to 10 over two deviations of that of white noise, 2 / sqrt(N)."""
    e = error - error.mean(axis=0)
    power = np.sum(e**2, axis=0)
    lags = [
        np.abs(np.sum(e[k:] * e[:-k], axis=0)) / np.where(power > 0, power, 1) for k in range(1, min(_LAGS + 1, len(e)))
    ]
    return float(np.max(lags) * np.sqrt(len(e)) / 2) if lags else np.nan


def with_noise(model: StateSpace, records: Records) -> StateSpace:
    """Return a model with the gain and the covariance of its innovations on records."""
    runs = list(runs_of(records))
    level = [np.sqrt(np.mean(np.concatenate([run[side] for run in runs]) ** 2, axis=0)) for side in (0, 1)]
    return with_innovations(model, runs, *(np.where(one > 0, one, 1.0) for one in level))
