"""Estimate Markov parameters from records of any input: by an observer (OKID), or by least squares."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.data.statespace import StateSpace
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import IntArray, RealArray, check_count, check_kind
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import one_thread
from modalscope.numerics.sums import TriangleSum
from modalscope.preprocess.excitation import driven_records

# ---------------------------------------------------------------------------------------------------------- regression
# The regression of an observer. Dependent outputs, inputs without power in part of the band and long pasts make regressors nearly
# dependent, and an observer fitted to noise need not be stable. The first `rank` singular directions of the regressors are kept; rank and
# order are those that predict best the parts of the records to which they were not fitted.

#: Directions of the regressors below this part of the largest are rounding; the minimum-norm solution excludes them.
RANK = 1e-13

#: Residuals below this part of the outputs are rounding.
_EXACT = 1e-11

#: Parts of each run; every one is predicted from the others (cross-validation).
_PARTS = 4

#: Ranks that are tried, about evenly on a logarithmic scale.
_RANKS = 60

#: Rows of the regression that are factored at a time.
_AT_ONCE = 4096


class Regression(NamedTuple):
    """Triangular factors of [u(k), u(k-1), y(k-1), ..., u(k-p), y(k-p), y(k)]: over all times k, over each part, and over all others.

    The regressors of an order come before those of the next, so that its factor is a leading block.
    """

    whole: RealArray
    parts: list[RealArray]
    others: list[RealArray]
    outputs: int
    inputs: int
    rows: int

    def unknowns(self, order: int) -> int:
        """Return the coefficients of an output at an order."""
        return self.inputs + order * (self.inputs + self.outputs)

    def share(self, errors: RealArray) -> RealArray:
        """Return the mean over the outputs of log(errors / power), errors (..., l) being sums of squares, no smaller than rounding."""
        power = np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        return np.asarray(np.mean(np.log(np.maximum(errors / np.where(power > 0, power, 1.0), _EXACT**2)), axis=-1))

    def fit(self, unknowns: int, rank: int | None = None) -> tuple[RealArray, int, RealArray]:
        """Return the minimum-norm solution (unknowns, l) in the first `rank` directions, the rank, and the residuals' Gram matrix (l, l).

        By default all directions above rounding are taken.
        """
        R, Y = self.whole[:, :unknowns], self.whole[:, -self.outputs :]
        steps, Vt = _directions(R, Y)
        kept = len(steps) if rank is None else min(rank, len(steps))
        solution = Vt[:kept].T @ steps[:kept]
        residual = Y - R @ solution
        return solution, kept, residual.T @ residual

    def is_exact(self, unknowns: int) -> bool:
        """Return whether the first regressors fit the outputs to rounding, with more equations than directions: noise never does."""
        limit = _EXACT**2 * np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        least = np.sum(self.whole[unknowns:, -self.outputs :] ** 2, axis=0)  # residual of the unrestricted fit
        if not limit.any() or np.any(least > limit):
            return False
        _, rank, residual = self.fit(unknowns)
        return rank < self.rows and bool(np.all(np.diag(residual) <= limit))

    def errors(self, unknowns: int, ranks: IntArray) -> RealArray:
        """Return the sums of squared errors (ranks, l) of predicting each part from the others."""
        errors = np.zeros((ranks.size, self.outputs))
        for part, R in zip(self.parts, self.others, strict=True):
            steps, Vt = _directions(R[:, :unknowns], R[:, -self.outputs :])
            turned, residual, last = part[:, :unknowns] @ Vt.T, np.array(part[:, -self.outputs :]), 0
            for i, rank in enumerate(np.minimum(ranks, len(steps))):
                residual -= turned[:, last:rank] @ steps[last:rank]
                errors[i] += np.sum(residual**2, axis=0)
                last = rank
        return errors

    def cross_validated(self, unknowns: int) -> tuple[int, float]:
        """Return the rank that predicts the parts best, each from the others, and the mean log share of the errors in the power."""
        ranks = np.unique(np.geomspace(1, unknowns, _RANKS).astype(int))
        criterion = self.share(self.errors(unknowns, ranks))
        best = int(np.argmin(criterion))
        return int(ranks[best]), float(criterion[best])


def _directions(R: RealArray, Y: RealArray) -> tuple[RealArray, RealArray]:
    """Return d^-1 U'Y and V' of R = U d V', without the directions that are rounding."""
    U, d, Vt = sla.svd(R[: R.shape[1]], full_matrices=False, check_finite=False)
    above = int(np.count_nonzero(d > RANK * d[0]))
    return (U[:, :above].T @ Y[: R.shape[1]]) / d[:above, None], Vt[:above]


def regression(outputs: RealArray, inputs: RealArray, order: int) -> Regression:
    """Return the regression of outputs (R, N, l) on inputs (R, N, m) and the `order` samples of both before."""
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    columns = (m + l) * (order + 1)
    times = np.array_split(np.arange(order, samples), _PARTS)
    parts = []
    for chosen in times:
        total = TriangleSum(columns)
        for y, u in zip(outputs, inputs, strict=True):
            for first in range(0, chosen.size, _AT_ONCE):
                k = chosen[first : first + _AT_ONCE]
                past = [side[k - i] for i in range(1, order + 1) for side in (u, y)]
                total.add(np.concatenate([u[k], *past, y[k]], axis=1))
        parts.append(total.finish())
    others = [_joined(columns, parts[:k] + parts[k + 1 :]) for k in range(_PARTS)]
    return Regression(_joined(columns, [parts[0], others[0]]), parts, others, l, m, runs * (samples - order))


def _joined(columns: int, triangles: list[RealArray]) -> RealArray:
    total = TriangleSum(columns)
    for triangle in triangles:
        total.add(triangle)
    return total.finish()


# ------------------------------------------------------------------------------------------------------ observer order
# Order and rank of the observer: the first that is exact, or those of the least error in cross-validation.

#: Largest order tried by default, and regressors beyond which orders above `_ALWAYS` are not tried.
_LONGEST, _REGRESSORS, _ALWAYS = 60, 600, 10

#: Orders up to this one are all tried, longer ones in steps of about a quarter.
_EVERY = 12


class Tried(NamedTuple):
    """Orders that were tried, the rank of each, and the criterion that the best order minimizes."""

    regression: Regression
    orders: IntArray
    ranks: IntArray
    criterion: RealArray

    def best_first(self) -> Iterator[tuple[int, int]]:
        """Yield order and rank, the best first."""
        for i in np.argsort(self.criterion, kind="stable"):
            yield int(self.orders[i]), int(self.ranks[i])


def tried_orders(outputs: RealArray, inputs: RealArray, given: int | None, longest: int | None) -> Tried:
    """Try all orders up to `longest`, or the given one, on outputs (R, N, l) and inputs (R, N, m) of unit scale.

    Raises DataError when every order has more unknowns than equations.
    """
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    most = max(_REGRESSORS // (l + m), _ALWAYS) if longest is None else check_count("longest", longest)
    top = given or max(min(most, _LONGEST if longest is None else most, samples // 2), 1)
    enough = max((runs * samples - m - l) // (l + m + runs), 0)  # orders with more equations than unknowns
    determined = min(top, enough) if given is None or given <= enough else 0
    noisy = None
    for largest in sorted({determined, top} - {0}):
        if largest >= samples:
            break
        found = regression(outputs, inputs, largest)
        orders = _ladder(largest, given)
        for i, p in enumerate(orders):
            if found.is_exact(found.unknowns(p)):
                return _exact(found, orders[: i + 1])
        noisy = noisy or found
    if not determined or noisy is None:
        order = given or 1
        raise DataError(
            f"an observer of order {order} for {l} outputs and {m} inputs was asked",
            f"it has {m + order * (l + m)} unknowns an output, and the record gives {max(runs * (samples - order), 0)} equations",
            "Lower observer_order, or measure longer.",
        )
    orders = _ladder(determined, given)
    ranks, errors = zip(*(noisy.cross_validated(noisy.unknowns(p)) for p in orders), strict=True)
    return Tried(noisy, orders, np.array(ranks), np.array(errors))


def _ladder(largest: int, given: int | None) -> IntArray:
    """Return the orders to try up to the largest one, or the given one."""
    if given is not None:
        return np.array([given])
    steps = np.geomspace(_EVERY, max(largest, _EVERY), max(1, round(4.5 * np.log(max(largest / _EVERY, 1)))) + 1)
    orders = np.unique([*range(1, _EVERY + 1), *steps.astype(int), largest])
    return np.asarray(orders[orders <= largest])


def _exact(found: Regression, orders: IntArray) -> Tried:
    """Return the orders up to the first that fits to rounding, which is the best, by their residuals."""
    _, ranks, residuals = zip(*(found.fit(found.unknowns(p)) for p in orders), strict=True)
    criterion = np.array([found.share(np.diag(residual)) for residual in residuals])
    criterion[-1] = criterion.min()
    return Tried(found, orders[::-1], np.array(ranks)[::-1], criterion[::-1])


# ------------------------------------------------------------------------------------------------------------ observer
# Observer/Kalman filter identification (OKID). With an observer of gain G the state-space model reads
#
#     y(k) = D u(k) + sum_i [ b_i u(k - i) + a_i y(k - i) ], i = 1 ... p,
#     b_i = C (A - G C)^(i-1) (B - G D), a_i = C (A - G C)^(i-1) G:
#
# a regression of finite length whatever the damping. The Markov parameters of the system follow from
#
#     Y(k) = b_(k+1) + a_(k+1) D + sum_{i<=k} a_i Y(k - i)         (a_i = b_i = 0 beyond p)
#
# and C A^k G from the same recursion with a_(k+1) instead of the first two terms. For large p and long records G is
# the Kalman gain of the noise.

#: A response counts as decayed 80 dB below its largest value.
_DECAYED = 1e-4

#: It grows when the last quarter of a run exceeds the largest value of the first half by this factor: a free body moves twice as far.
_GROWS = 3.0

#: A response beyond this many times outputs over inputs is unstable.
_HUGE = 1e9

#: Orders that are tried until one does not grow.
_ATTEMPTS = 6


class Observer(NamedTuple):
    """An observer identified from a record, and the response computed from it.

    Attributes
    ----------
    response : ImpulseResponse
        Y(k) = C A^k B with the direct term.
    gain_parameters : array, (N, l, l)
        C A^k G: what the gain is computed from (`gain_of`).
    order : int
        Observer order p: past samples in the regression.
    orders, criterion : array
        All observer orders that were tried, and the mean logarithm of their prediction errors' share of the outputs' power, in
        cross-validation; the chosen order is the best whose response does not grow.
    residual_covariance : array, (l, l)
        Covariance of the one-step prediction errors.
    """

    response: ImpulseResponse
    gain_parameters: RealArray
    order: int
    orders: IntArray
    criterion: RealArray
    residual_covariance: RealArray

    def gain_of(self, model: StateSpace) -> RealArray:
        """Return the gain G (n, l) of x(k+1) = A x + B u + G (y - C x - D u) in the coordinates of a realization of the response.

        Least squares on C A^k G = gain_parameters[k], as many samples as the observer's order or the states need.

        Parameters
        ----------
        model : StateSpace
            A realization of the response, sampled.

        Raises
        ------
        DataError
            A continuous model, or one with other outputs.
        """
        l = self.gain_parameters.shape[1]
        if model.dt is None or model.C.shape[0] != l:
            raise DataError(
                f"the gain of a sampled model with {l} outputs was asked",
                f"this one has {model.C.shape[0]}" + (" and is continuous" if model.dt is None else ""),
                "Give a realization of this observer's response.",
            )
        count = min(max(self.order, model.order), self.gain_parameters.shape[0])
        rows, power = [], np.array(model.C)
        for _ in range(count):
            rows.append(power)
            power = power @ model.A
        observability, wanted = np.concatenate(rows), self.gain_parameters[:count].reshape(-1, l)
        return np.asarray(np.linalg.lstsq(observability, wanted, rcond=None)[0])


@named()
@one_thread
def estimate_observer(
    signals: Signals, *, observer_order: int | None = None, samples: int | None = None, longest: int | None = None
) -> Observer:
    """Observer/Kalman filter identification (OKID): the response, the gain and the observer's order.

    The observer is the best in cross-validation: every quarter of the runs is predicted from the others, by all orders up to `longest`
    and with more and more of the regressors' singular directions (`modalscope.preprocess.markov`). This excludes directions that only
    noise excites, of redundant channels and of inputs without power in part of the band. Where a record is exact to rounding, the first
    order that fits it is taken. An order whose response grows is rejected for the next best.

    Parameters
    ----------
    signals : Signals
    observer_order : int, optional
        Past samples p; p l must be at least the number of states.
    samples : int, optional
        Length of the response (see `estimate_markov`).
    longest : int, optional
        Largest order tried; by default 60, or what the record's samples and 600 regressors allow.

    Raises
    ------
    DataError
        No inputs, too short a record, or a response that grows with every observer.
    """
    outputs, inputs = driven_records(signals, "Markov parameters")
    given = None if observer_order is None else check_count("observer_order", observer_order)
    asked = None if samples is None else check_count("samples", samples, least=2)
    scales = _level(outputs), _level(inputs)
    tried = tried_orders(outputs / scales[0], inputs / scales[1], given, longest)
    for p, rank in islice(tried.best_first(), _ATTEMPTS):
        D, b, a, S = _coefficients(tried.regression, p, rank)
        response = _recursion(D, b, a, asked, outputs.shape[1])
        if response is not None:
            break
    else:
        orders = ", ".join(str(p) for p, _ in islice(tried.best_first(), _ATTEMPTS))
        raise DataError(
            "the response of a structure by an observer (OKID) was asked",
            f"with {'order' if given else 'the best orders,'} {orders} it grows instead of decaying: "
            "the record does not tell damping from noise, or the structure is unstable",
            "Give another observer_order, leave out channels that follow from others or carry noise (exclude), or measure longer.",
        )
    Y, gain, end = response
    by_input, by_output = scales[0][:, None] / scales[1], scales[0][:, None] / scales[0]
    how = f"{'chosen' if given is None else 'given'}, {rank} of {tried.regression.unknowns(p)} directions"
    note = f"OKID with an observer of order {p} ({how}), {len(Y)} samples, {end}"
    return Observer(
        response=pulse_response(signals, Y * by_input, D * by_input, note),
        gain_parameters=gain * by_output,
        order=p,
        orders=tried.orders,
        criterion=tried.criterion,
        residual_covariance=S * np.outer(scales[0], scales[0]),
    )


def _level(records: RealArray) -> RealArray:
    """Return the root mean square of every channel, 1 for one that is zero."""
    size = np.sqrt(np.mean(records**2, axis=(0, 1)))
    return np.asarray(np.where(size > 0, size, 1.0))


def _coefficients(found: Regression, p: int, rank: int) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Return D (l, m), b (p, l, m), a (p, l, l) and the covariance of the residuals (l, l)."""
    l, m = found.outputs, found.inputs
    solution, _, residual = found.fit(found.unknowns(p), rank)
    past = solution[m:].reshape(p, m + l, l).transpose(0, 2, 1)
    return solution[:m].T, past[:, :, :m], past[:, :, m:], residual / found.rows


def _recursion(
    D: RealArray, b: RealArray, a: RealArray, asked: int | None, run: int
) -> tuple[RealArray, RealArray, str] | None:
    """Return Y(k) and C A^k G, and the reason of their length; None when they grow over the length of a run."""
    p, l, m = b.shape
    direct = np.concatenate([b + a @ D, a], axis=2)  # Y and the gain parameters obey one recursion: (p, l, m + l)
    weights = a[::-1].transpose(1, 0, 2).reshape(l, p * l)  # a_p ... a_1, in the order of the past
    most = max(run, asked or 0)
    history, sizes = np.zeros(((most + p) * l, m + l)), np.zeros(most)
    largest, quiet, end = 0.0, 0, "as asked" if asked else "where it had not decayed yet"
    for k in range(most):
        value = weights @ history[k * l : (k + p) * l]
        if k < p:
            value += direct[k]
        history[(k + p) * l : (k + p + 1) * l] = value
        sizes[k] = np.abs(value[:, :m]).max()
        if not sizes[k] < _HUGE:
            return None
        largest, quiet = max(largest, sizes[k]), quiet + 1 if sizes[k] <= _DECAYED * largest else 0
        if quiet >= 2 * p and k >= 4 * p and k + 1 >= (asked or 0):
            most, end = k + 1, end if asked else "until it had decayed by 80 dB"
            break
    if quiet < 2 * p and sizes[3 * most // 4 :].max() > _GROWS * sizes[: most // 2].max():
        return None
    values = history[p * l : (p + (asked or most)) * l].reshape(-1, l, m + l)
    return values[:, :, :m], values[:, :, m:], end


def pulse_response(signals: Signals, Y: RealArray, D: RealArray, note: str) -> ImpulseResponse:
    """Return Y(k) and the direct term D as the response of the records' channels."""
    return ImpulseResponse(
        values=Y,
        feedthrough=D,
        sampling_rate=signals.sampling_rate,
        kind="pulse",
        quantity=signals.quantity,
        **signals.labelled(),
    ).processed(note)


# -------------------------------------------------------------------------------------------------------------- markov


@named()
@one_thread
def estimate_markov(
    signals: Signals, *, method: str = "okid", observer_order: int | None = None, samples: int | None = None
) -> ImpulseResponse:
    """Turn records with measured inputs of any kind into impulse responses: Markov parameters Y(k) = C A^k B and the direct term.

    Parameters
    ----------
    signals : Signals
        Outputs and inputs; several runs are used together. Nothing is assumed about the state at the start.
    method : {"okid", "least squares"}
        "okid" goes through an observer (`estimate_observer`) and takes lightly damped structures; "least squares" fits
        y(k) = D u(k) + sum Y(i) u(k - 1 - i) with `samples` terms directly, for responses that decay within them.
    observer_order : int, optional
        Past samples in the observer ("okid"); by default the best of all.
    samples : int, optional
        Length of the response. By default, "okid" continues until it has decayed by 80 dB, up to the length of a run, and notes in
        `processing` which; "least squares" takes what a quarter of the record determines.

    Returns
    -------
    ImpulseResponse
        Kind "pulse", with `feedthrough`.

    Raises
    ------
    DataError
        No inputs, or too short a record.

    References
    ----------
    Juang, Phan, Horta and Longman, "Identification of observer/Kalman filter Markov parameters", J. Guidance 16(2), 1993.

    Examples
    --------
    >>> from modalscope.data import StateSpace
    >>> model = StateSpace(A=[[0.9, 0.4], [-0.4, 0.9]], B=[[1], [0]], C=[[1, 1]], D=[[0.5]], dt=1.0)
    >>> u = np.random.default_rng(0).standard_normal((400, 1))
    >>> Y = estimate_markov(Signals(outputs=model.simulate(u), inputs=u, sampling_rate=1.0), samples=50)
    >>> bool(np.allclose(Y.values, model.markov_parameters(50))), Y.feedthrough.round(10)
    (True, array([[0.5]]))
    """
    check_kind("estimate_markov", signals, Signals)
    check_choice("method", method, ("okid", "least squares"))
    if method == "okid":
        return estimate_observer(signals, observer_order=observer_order, samples=samples).response
    if observer_order is not None:
        raise DataError(
            f"observer_order={observer_order} was asked", 'method="least squares" has no observer', "Leave it out."
        )
    return _least_squares(signals, samples)


def _least_squares(signals: Signals, samples: int | None) -> ImpulseResponse:
    outputs, inputs = driven_records(signals, "Markov parameters")
    m, length = inputs.shape[2], outputs.shape[1]
    count = max(2, outputs.shape[0] * length // (4 * m) - 1) if samples is None else check_count("samples", samples, 2)
    count = min(count, length // 2) if samples is None else count
    rows = outputs.shape[0] * (length - count)
    if length <= count or rows < m * (count + 1):
        raise DataError(
            f"{count} samples of a response to {m} inputs by least squares were asked",
            f"they have {m * (count + 1)} unknowns an output, and the record gives {max(rows, 0)} equations",
            'Lower samples, measure longer, or use method="okid".',
        )
    blocks = []
    for y, u in zip(outputs, inputs, strict=True):
        past = [u[count - i : length - i] for i in range(count + 1)]
        blocks.append(np.concatenate([*past, y[count:]], axis=1))
    joined = np.concatenate(blocks)
    solution = np.asarray(sla.lstsq(joined[:, : m * (count + 1)], joined[:, m * (count + 1) :], cond=RANK)[0])
    steps = solution.reshape(count + 1, m, -1).transpose(0, 2, 1)
    return pulse_response(signals, steps[1:], steps[0], f"least squares for {count} samples of the response")
