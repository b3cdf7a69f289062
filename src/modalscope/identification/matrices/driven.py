"""Oblique projection of future outputs on past inputs and outputs, along future inputs, for records with inputs in time.

With X(t) the states, y(t + k) = C A^k X(t) + sum_(j <= k) (...) u(t + j) + what noise and unmeasured forces add from t on. The future
inputs are eliminated; the past, which knows nothing of what noise adds later, is the instrument: the remainder is V X, consistent
whatever the noise and the unmeasured forces are. A projection on the lines of records has no such instrument.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.linalg as sla
from numpy.lib.stride_tricks import sliding_window_view

from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.matrix import Eigen, ModalFit, Triple
from modalscope.identification.matrices.sampled_rows import MixedRows
from modalscope.numerics.checks import Array, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.sums import TriangleSum

#: Innovations below this fraction of the outputs are rounding.
_MIN_INNOVATION = 1e-11

#: Maximum number of samples of the past, of its rows, and of its share of the times: prediction by chance.
_MAX_PAST, _MAX_PAST_ROWS, _MAX_PAST_SHARE = 60, 400, 0.02

#: Samples of the future in excess of those that the states need.
_EXTRA_FUTURE = 10


def runs_of(records: Records) -> Iterator[tuple[RealArray, RealArray]]:
    """Yield outputs (N, l) and all inputs (N, m) of every run; zero where a run has not this input."""
    for r, run in enumerate(records.runs):
        u = np.zeros((run.samples, len(records.input_dofs)))
        assert run.inputs is not None
        u[:, list(records.inputs_of(r))] = run.inputs
        yield run.outputs, u


def innovations(model: StateSpace, runs: Iterable[tuple[RealArray, RealArray]]) -> tuple[RealArray, RealArray] | None:
    """Return the gain (n, l) and the covariance of the innovations (l, l) of a model, from records; None of one that grows.

    `model`: sampled; outputs and inputs of about the same size in all channels.
    """
    if np.abs(model.poles).max(initial=0.0) > 1:
        return None
    residuals = [_not_simulated(model, y, u) for y, u in runs]
    l, times = model.C.shape[0], sum(len(v) for v in residuals)
    future = -(-model.order // l) + _EXTRA_FUTURE
    past = max(min(_MAX_PAST, _MAX_PAST_ROWS // l, int(_MAX_PAST_SHARE * times / l)), 1)
    total, count, width = TriangleSum(l * (past + 1 + future)), 0, past + 1 + future
    for v in residuals:
        if len(v) >= width:
            windows = sliding_window_view(v, width, axis=0).transpose(0, 2, 1)
            count += len(windows)
            for start in range(0, len(windows), 4 * l * width):
                part = windows[start : start + 4 * l * width]
                total.add(part.reshape(len(part), -1))
    R, given = total.finish(), l * past
    if count <= R.shape[1]:
        return None
    R_innovations = R[given : given + l, given:] / np.sqrt(count - given)
    return kalman_gain(R_innovations, model.A, model.C)


def with_innovations(
    model: StateSpace, runs: Iterable[tuple[RealArray, RealArray]], of_outputs: RealArray, of_inputs: RealArray
) -> StateSpace:
    """Return a model with what `innovations` finds, of channels that are divided by their sizes first."""
    C, D = model.C / of_outputs[:, None], model.D * of_inputs / of_outputs[:, None]
    level = StateSpace(A=model.A, B=model.B * of_inputs, C=C, D=D, dt=model.dt)
    noise = innovations(level, ((y / of_outputs, u / of_inputs) for y, u in runs))
    if noise is None:
        return model
    gain, covariance = noise
    return replace(model, gain=gain / of_outputs, innovation_covariance=covariance * np.outer(of_outputs, of_outputs))


def _not_simulated(model: StateSpace, y: RealArray, u: RealArray) -> RealArray:
    """Return y less what the inputs, the first state that fits best and a constant give."""
    residual = y - model.simulate(u)
    l, n = model.C.shape
    free = np.empty((len(y), l, n))
    power = np.array(model.C)
    for row in free:
        row[:] = power
        power = power @ model.A
    constants = np.tile(np.eye(l), (len(y), 1))
    columns = np.hstack([free.reshape(-1, n), constants])
    R = np.asarray(
        sla.qr(np.column_stack([columns, residual.reshape(-1)]), mode="r", check_finite=False)[0][: n + l + 1]
    )
    first = np.linalg.lstsq(R[:, :-1], R[:, -1], rcond=None)[0]
    return np.asarray(residual - (columns @ first).reshape(residual.shape))


def kalman_gain(future: RealArray, A: RealArray, C: RealArray) -> tuple[RealArray, RealArray]:
    """Return the gain K (n, l) of x(k+1) = A x(k) + K e, v = C x + e, and the covariance of e (l, l).

    With E (l, l) the innovations in their own coordinates and F (l, l q) what follows from them, F = E [C K; C A K; ...]', so that
    K = [C; C A; ...]# (E^-1 F)'. A gain under which errors would not decay (A - K C) is replaced by that of the Riccati equation with
    the same covariances.

    `future` (l, l (q + 1)): [E, F], with E'E the covariance.
    """
    l, n = C.shape
    E, F = future[:, :l], future[:, l:]
    covariance = np.asarray(E.T @ E)
    if np.abs(E).max() < _MIN_INNOVATION:
        return np.zeros((n, l)), covariance
    rows, power = [], np.array(C)
    for _ in range(F.shape[1] // l):
        rows.append(power)
        power = power @ A
    follows = np.linalg.lstsq(E, F, rcond=_MIN_INNOVATION)[0]
    K = np.asarray(np.linalg.lstsq(np.concatenate(rows), follows.T, rcond=None)[0])
    if np.abs(np.linalg.eigvals(A - K @ C)).max() < 1:
        return K, covariance
    return _by_riccati(A, C, K, covariance)


def _by_riccati(A: RealArray, C: RealArray, K: RealArray, R: RealArray) -> tuple[RealArray, RealArray]:
    """Return the gain that stabilizes A - K C under the noise of a gain that does not, with its covariance; zero where there is none."""
    S = K @ R
    try:
        P = sla.solve_discrete_are(A.T, C.T, S @ K.T, R, s=S)
    except (np.linalg.LinAlgError, ValueError):
        return np.zeros_like(K), R
    covariance = C @ P @ C.T + R
    return np.asarray(np.linalg.solve(covariance, (A @ P @ C.T + S).T).T), np.asarray(covariance)


#: Times of the triangular factorization processed at once, in multiples of the rows.
_CHUNK_TIMES = 4

#: Ratio of successive intervals of the past.
_INTERVAL_GROWTH = 1.5

#: Columns of an autoregression at most, and times for each.
_MAX_PREDICTOR, _TIMES_A_COLUMN = 800, 10

#: Noise below this fraction of the root mean square of the outputs is not whitened: noise-free records.
_MIN_NOISE = 1e-6


def driven_projection(
    records: Records,
    block_rows: int = 10,
    block_columns: int = 10,
    single: int = 10,
    spectra: RecordSpectra | None = None,
) -> DrivenProjection:
    """Project future outputs on past inputs and outputs, future inputs eliminated: what PO-MOESP and N4SID factor.

    With q = block_rows and p = block_columns, the columns for all times t of all runs are

        inputs  [1; u(t); ...; u(t + q)],  past  T [y(t - 1); u(t - 1); ...; y(t - p); u(t - p)],  future  [y(t); ...; y(t + q)],

    each channel divided by its root mean square, the whole by the root of the number of times. With [inputs; past; future] =
    [[L11, 0, 0], [L21, L22, 0], [L31, L32, L33]] Q the matrix is L^-1 L32, L L' = L33 L33': rows count by how well they are predicted
    beside what is not, which are the weights of canonical variates. Without them noise and unmeasured forces, which are loudest where the
    modes are, take states of their own before weak modes do. The constant, one per run, takes any offset away exactly. T keeps
    the latest samples one by one and sums those before over intervals that grow by a half (`intervals`): slow modes need a long past to
    be told from noise, and every row of the past predicts some noise by chance, which biases damping.

    `records`: runs of any length and any of the inputs. `block_rows`, `block_columns`: blocks of the future but one, and samples of the
    past. `single`: samples of the past that stay one by one. `spectra`: the same records on their lines: what participation is fitted to
    and a model is compared with.

    Raises `DataError`: records without inputs, or fewer times than rows: everything can then be predicted.

    Returns
    -------
    DrivenProjection

    References
    ----------
    Verhaegen, "Identification of the deterministic part of MIMO state space models given in innovations form from input-output data",
    Automatica 30 (1994), 61-74; Larimore, "Canonical variate analysis in identification, filtering, and adaptive control", 29th IEEE CDC
    (1990); Van Overschee and De Moor, "Subspace Identification for Linear Systems", 1996, chapter 4.

    Examples
    --------
    >>> from modalscope.data import Records, Signals
    >>> rng = np.random.default_rng(0)
    >>> run = Signals(outputs=rng.standard_normal((500, 2)), inputs=rng.standard_normal((500, 1)), sampling_rate=10.0)
    >>> driven_projection(Records(runs=(run,)), block_rows=3, block_columns=5).tall().shape
    (8, 15)
    """
    future, past = check_count("block_rows", block_rows), check_count("block_columns", block_columns)
    lines = record_spectra(records) if spectra is None else spectra
    made = DrivenProjection(records, lines, future, past, intervals(past, check_count("single", single)))
    if made.columns < made.rows:
        raise DataError(
            f"driven_projection(block_rows={future}, block_columns={past}) of {made.outputs} outputs and {made.inputs} inputs:",
            f"{len(records.runs)} x {max(records.samples)} samples give {made.columns} times for {made.rows} rows: "
            "the past predicts any record of that length",
            "Lower block_rows and block_columns, or measure longer.",
        )
    return made


def intervals(samples: int, single: int) -> RealArray:
    """Return T (b, p): the latest samples one by one, those before in sums over intervals that grow by a half, of length one each.

    `samples`: p.

    Examples
    --------
    >>> (intervals(7, 2) != 0).astype(int)
    array([[1, 0, 0, 0, 0, 0, 0],
           [0, 1, 0, 0, 0, 0, 0],
           [0, 0, 1, 1, 0, 0, 0],
           [0, 0, 0, 0, 1, 1, 0],
           [0, 0, 0, 0, 0, 0, 1]])
    """
    ends, length = list(range(min(single, samples) + 1)), 1.0
    while ends[-1] < samples:
        length *= _INTERVAL_GROWTH
        ends.append(min(ends[-1] + round(length), samples))
    T = np.zeros((len(ends) - 1, samples))
    for row, (first, last) in zip(T, pairwise(ends), strict=True):
        row[first:last] = 1 / np.sqrt(last - first)
    return T


@dataclass(frozen=True, eq=False)
class DrivenProjection(MixedRows):
    """Future outputs projected on past inputs and outputs, future inputs eliminated (made by `driven_projection`).

    `response`: the records on their lines. `future_blocks`, `past_blocks`: blocks of the future but one, and samples of the past. `sums`
    (b, p): t: what the rows of the past are of its samples, the latest first.
    """

    records: Records
    response: RecordSpectra
    future_blocks: int
    past_blocks: int
    sums: RealArray

    @property
    def block_rows(self) -> int:
        """Blocks of the future but one."""
        return self.future_blocks

    @property
    def outputs(self) -> int:
        """Outputs of the records."""
        return len(self.records.output_dofs)

    @property
    def inputs(self) -> int:
        """Inputs of all runs."""
        return len(self.records.input_dofs)

    @property
    def dt(self) -> float:
        """Sampling interval, seconds."""
        return 1 / self.records.sampling_rate

    @property
    def columns(self) -> int:
        """Times at which past and future lie within a run, over all runs."""
        return sum(max(samples - self.future_blocks - self.past_blocks, 0) for samples in self.records.samples)

    @property
    def offsets(self) -> int:
        """Rows of constants, one per run."""
        return len(self.records.runs)

    @property
    def known(self) -> int:
        """Rows that are eliminated: constants and future inputs."""
        return self.offsets + self.inputs * (self.block_rows + 1)

    @property
    def past(self) -> int:
        """Rows of the past, b (l + m)."""
        return len(self.sums) * (self.outputs + self.inputs)

    @property
    def rows(self) -> int:
        """Rows of all three."""
        return self.known + self.past + self.outputs * (self.block_rows + 1)

    @cached_property
    def scales(self) -> tuple[RealArray, RealArray]:
        """Root mean squares of the outputs (l,) and of the inputs (m,), over all runs; 1 for a channel that is zero."""
        total = sum(self.records.samples)
        squares = [np.hstack([np.sum(y**2, axis=0), np.sum(u**2, axis=0)]) for y, u in runs_of(self.records)]
        level = np.sqrt(np.sum(squares, axis=0) / total)
        level = np.where(level > 0, level, 1.0)
        return level[: self.outputs], level[self.outputs :]

    def _chunks(self) -> Iterator[RealArray]:
        """Yield columns of [inputs; past; future] as rows, some at a time."""
        p, of_outputs, of_inputs = self.past_blocks, *self.scales
        for r, (y, u) in enumerate(runs_of(self.records)):
            if len(y) <= p + self.block_rows:
                continue
            both = np.hstack([y / of_outputs, u / of_inputs])
            windows = sliding_window_view(both, p + self.block_rows + 1, axis=0).transpose(
                0, 2, 1
            )  # (times, blocks, l + m)
            for start in range(0, len(windows), _CHUNK_TIMES * self.rows):
                part = windows[start : start + _CHUNK_TIMES * self.rows]
                count = len(part)
                ones = np.zeros((count, self.offsets))
                ones[:, r] = 1.0
                after = part[:, p:]
                driving, future = after[:, :, self.outputs :], after[:, :, : self.outputs]
                before = np.einsum("bp,tpc->tbc", self.sums, part[:, p - 1 :: -1])
                yield np.hstack([each.reshape(count, -1) for each in (ones, driving, before, future)])

    @cached_property
    def factor(self) -> RealArray:
        """R (rows, rows), upper triangular: [inputs; past; future] in orthonormal coordinates, column by column."""
        total = TriangleSum(self.rows)
        for chunk in self._chunks():
            total.add(chunk)
        return np.asarray(total.finish() / np.sqrt(self.columns))

    def predictor_triangle(self) -> tuple[RealArray, int, int, int, int]:
        """Return the triangle of [1; u(t); u(t - 1); y(t - 1); ...; u(t - p); y(t - p); y(t)], as many p as the past and memory allow.

        With it the number of times, that of the first columns, l, and l + m; channels are level, and constants one per run.
        """
        of_outputs, of_inputs = self.scales
        l, m, times = self.outputs, self.inputs, sum(self.records.samples)
        p = max(min(self.past_blocks, _MAX_PREDICTOR // (l + m), times // (_TIMES_A_COLUMN * (l + m))), 1)
        first = self.offsets + m
        total, count = TriangleSum(first + p * (l + m) + l), 0
        for r, (y, u) in enumerate(runs_of(self.records)):
            y, u = y / of_outputs, u / of_inputs
            for start in range(p, len(y), _CHUNK_TIMES * self.rows):
                k = np.arange(start, min(start + _CHUNK_TIMES * self.rows, len(y)))
                ones = np.zeros((k.size, self.offsets))
                ones[:, r] = 1.0
                past = [side[k - i] for i in range(1, p + 1) for side in (u, y)]
                total.add(np.hstack([ones, u[k], *past, y[k]]))
                count += k.size
        # noise-free records determine no more columns than they have states
        total.add(_MIN_NOISE * np.sqrt(count) * np.eye(first + p * (l + m) + l))
        return total.finish(), count, first, l, l + m

    @cached_property
    def triangle(self) -> RealArray:
        """L32 (l (q + 1), b (l + m)): the projection times an orthonormal matrix, its exact stand-in."""
        first, last = self.known, self.known + self.past
        return np.ascontiguousarray(self.factor[first:last, last:].T)

    @cached_property
    def mixing(self) -> RealArray:
        """L (l (q + 1), l (q + 1)) of what past and inputs do not predict, L33 L33' and a floor: lower triangular."""
        beyond = self.factor[self.known + self.past :, self.known + self.past :]
        floor = _MIN_NOISE * np.eye(beyond.shape[1])
        R = np.asarray(sla.qr(np.vstack([beyond, floor]), mode="r", check_finite=False)[0])
        return np.ascontiguousarray(R[: R.shape[1]].T)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return the first block row of H(k), times X, in outputs: C = first_rows(Q d^-1/2)."""
        return np.asarray(super().first_rows(right, k) * self.scales[0][:, None])

    def row_blocks(self, P: Array) -> RealArray:
        """Return a left factor (rows, k) by block rows in outputs, (blocks, l, k)."""
        return np.asarray(super().row_blocks(P) * self.scales[0][:, None])

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X; participation of inputs and ends, and D, by least squares over the records' lines."""
        shapes = np.asarray(model.C @ eigen.vectors)
        basis = self.response.basis(self.to_s(eigen.values))
        participation, terms = basis.fit_participation(shapes, self.scales[0])
        return ModalFit(shapes, participation, terms, reach=basis.reach)

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> Iterator[tuple[Array, Array]]:
        """Yield the records' lines and what the modes give on them, from the first states that fit best."""
        values = self.response.evaluated(poles, fit.shapes, fit.participation, fit.terms)
        yield self.judged.values, values[:, :, None]

    def with_noise(self, model: StateSpace) -> StateSpace:
        """Return a model of these records with the gain of its innovations and their covariance."""
        return with_innovations(model, runs_of(self.records), *self.scales)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        return (
            f"{self.block_rows + 1} future blocks of {self.outputs} outputs projected on {len(self.sums)} sums of {self.past_blocks} past "
            f"samples of {self.outputs} outputs and {self.inputs} inputs, future inputs eliminated, whitened, over {self.columns} times"
        )
