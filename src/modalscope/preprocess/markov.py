"""Markov parameters from records of any input: by an observer (OKID), or by plain least squares."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.data.sizes import check_size
from modalscope.data.statespace import StateSpace
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import IntArray, RealArray, check_count, check_kind
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import one_thread
from modalscope.numerics.sums import TriangleSum

__all__ = ["Observer", "estimate_markov", "estimate_observer", "regression"]


# ---------------------------------------------------------------------------------------------------------- regression
# The observer's regression: fitted to parts of the records, judged on the rest, without the directions that only noise excites.
#
# Outputs that follow from one another, inputs without power in part of the band and long pasts give regressors that hardly differ. What
# a least-squares fit finds there is noise, and an observer made of noise need not be stable. Of the regressors' singular directions the
# first `rank` are kept; the rank, as the observer's order, is the one that predicts best what it was not fitted to.

#: Directions of the regressors below this part of the largest carry rounding only; the shortest solution leaves them out.
RANK = 1e-13

#: Residuals below this part of the outputs are rounding: a longer observer would fit nothing more.
_EXACT = 1e-11

#: Parts that each run is cut into; every one is predicted from the others.
_PARTS = 4

#: Ranks that are tried, about evenly on a logarithmic scale.
_RANKS = 60

#: Rows of the regression that are factored at a time.
_AT_ONCE = 4096


class Fit(NamedTuple):
    """Coefficients (unknowns, l), how many directions they come from, and the residuals' sums of squares and products (l, l)."""

    solution: RealArray
    rank: int
    residual: RealArray


class Regression(NamedTuple):
    """Triangular factors of [u(k), u(k-1), y(k-1), ..., u(k-p), y(k-p), y(k)]: over all times k, over each part, and over all others.

    An order's regressors come before those of the next one, so that its own factor is a leading block.
    """

    whole: RealArray
    parts: list[RealArray]
    others: list[RealArray]
    outputs: int
    inputs: int
    rows: int

    def unknowns(self, order: int) -> int:
        """Coefficients of an output at an order.

        Parameters
        ----------
        order : int
        """
        return self.inputs + order * (self.inputs + self.outputs)

    def share(self, errors: RealArray) -> RealArray:
        """Return the mean logarithm over the outputs of the power's share in sums of squares (..., l); rounding counts as one size.

        Parameters
        ----------
        errors : array
        """
        power = np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        return np.asarray(np.mean(np.log(np.maximum(errors / np.where(power > 0, power, 1.0), _EXACT**2)), axis=-1))

    def fit(self, unknowns: int, rank: int | None = None) -> Fit:
        """Return the shortest least-squares solution in the first `rank` directions of the first regressors.

        Parameters
        ----------
        unknowns : int
        rank : int, optional
            All that stand out of rounding by default.
        """
        R, Y = self.whole[:, :unknowns], self.whole[:, -self.outputs :]
        steps, Vt = _directions(R, Y)
        kept = len(steps) if rank is None else min(rank, len(steps))
        solution = Vt[:kept].T @ steps[:kept]
        left = Y - R @ solution
        return Fit(solution, kept, left.T @ left)

    def is_exact(self, unknowns: int) -> bool:
        """Whether the first regressors give the outputs to rounding, with equations to spare: noise never does.

        Parameters
        ----------
        unknowns : int
        """
        limit = _EXACT**2 * np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        if not limit.any() or np.any(
            np.sum(self.whole[unknowns:, -self.outputs :] ** 2, axis=0) > limit
        ):  # the least that can be left
            return False
        found = self.fit(unknowns)
        return found.rank < self.rows and bool(np.all(np.diag(found.residual) <= limit))

    def held_out(self, unknowns: int) -> tuple[int, float]:
        """Return the rank that predicts the parts best, each from the others, and the mean logarithm of the errors' share of the power.

        Parameters
        ----------
        unknowns : int
        """
        ranks = np.unique(np.geomspace(1, unknowns, _RANKS).astype(int))
        errors = np.sum([self._errors(k, unknowns, ranks) for k in range(len(self.parts))], axis=0)
        criterion = self.share(errors)
        best = int(np.argmin(criterion))
        return int(ranks[best]), float(criterion[best])

    def _errors(self, k: int, unknowns: int, ranks: IntArray) -> RealArray:
        """Return the sums of squared errors (ranks, l) on part k."""
        R, part = self.others[k], self.parts[k]
        steps, Vt = _directions(R[:, :unknowns], R[:, -self.outputs :])
        turned, left = part[:, :unknowns] @ Vt.T, np.array(part[:, -self.outputs :])
        errors, last = np.empty((ranks.size, self.outputs)), 0
        for i, rank in enumerate(np.minimum(ranks, len(steps))):
            left -= turned[:, last:rank] @ steps[last:rank]
            errors[i], last = np.sum(left**2, axis=0), rank
        return errors


def _directions(R: RealArray, Y: RealArray) -> tuple[RealArray, RealArray]:
    """Return d^-1 U'Y and V' of R = U d V', without what is rounding."""
    U, d, Vt = sla.svd(R[: R.shape[1]], full_matrices=False, check_finite=False)
    above = int(np.count_nonzero(d > RANK * d[0]))
    return (U[:, :above].T @ Y[: R.shape[1]]) / d[:above, None], Vt[:above]


def regression(outputs: RealArray, inputs: RealArray, order: int) -> Regression:
    """Return the regression of outputs (R, N, l) on inputs (R, N, m) and outputs of `order` samples before.

    Parameters
    ----------
    outputs, inputs : array
    order : int
    """
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    columns = (m + l) * (order + 1)
    times = np.array_split(np.arange(order, samples), _PARTS)
    parts = []
    for chosen in times:
        total = TriangleSum(columns)
        for y, u in zip(outputs, inputs, strict=True):
            for first in range(0, chosen.size, _AT_ONCE):
                total.add(_rows(y, u, chosen[first : first + _AT_ONCE], order))
        parts.append(total.finish())
    others = [_joined(columns, parts[:k] + parts[k + 1 :]) for k in range(_PARTS)]
    return Regression(_joined(columns, [parts[0], others[0]]), parts, others, l, m, runs * (samples - order))


def _joined(columns: int, triangles: list[RealArray]) -> RealArray:
    total = TriangleSum(columns)
    for triangle in triangles:
        total.add(triangle)
    return total.finish()


def _rows(y: RealArray, u: RealArray, times: IntArray, order: int) -> RealArray:
    past = [part[times - i] for i in range(1, order + 1) for part in (u, y)]
    return np.concatenate([u[times], *past, y[times]], axis=1)


# ------------------------------------------------------------------------------------------------------ observer order
# Which order an observer has, and how many directions of its regressors: the first that is exact, or what predicts best.

#: Largest order tried by default, and regressors beyond which orders above `_ALWAYS` are left out: their factors take long.
_LONGEST, _REGRESSORS, _ALWAYS = 60, 600, 10

#: Orders up to this one are all tried, longer ones in steps of about a quarter.
_EVERY = 12


class Tried(NamedTuple):
    """Orders that were tried, the rank of each, and the criterion that the best one minimises."""

    regression: Regression
    orders: IntArray
    ranks: IntArray
    criterion: RealArray

    def best_first(self) -> Iterator[tuple[int, int]]:
        """Yield order and rank, the best first."""
        for i in np.argsort(self.criterion, kind="stable"):
            yield int(self.orders[i]), int(self.ranks[i])


def tried_orders(outputs: RealArray, inputs: RealArray, given: int | None, longest: int | None) -> Tried:
    """Try all orders, or the one that is given.

    Parameters
    ----------
    outputs, inputs : array, (R, N, l) and (R, N, m)
        Of about the same size in all channels.
    given, longest : int, optional
        As in `estimate_observer`.

    Raises
    ------
    DataError
        More unknowns than the record can tell, at every order.
    """
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    most = max(_REGRESSORS // (l + m), _ALWAYS) if longest is None else check_count("longest", longest)
    top = given or max(min(most, _LONGEST if longest is None else most, samples // 2), 1)
    enough = max(
        (runs * samples - m - l) // (l + m + runs), 0
    )  # orders that leave an equation to spare for every output
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
        raise _too_short(given or 1, l, m, runs * (samples - (given or 1)))
    orders = _ladder(determined, given)
    held_out = [noisy.held_out(noisy.unknowns(p)) for p in orders]
    return Tried(noisy, orders, np.array([rank for rank, _ in held_out]), np.array([error for _, error in held_out]))


def _ladder(largest: int, given: int | None) -> IntArray:
    """Return the orders to try, the largest among them."""
    if given is not None:
        return np.array([given])
    steps = np.geomspace(_EVERY, max(largest, _EVERY), max(1, round(4.5 * np.log(max(largest / _EVERY, 1)))) + 1)
    orders = np.unique([*range(1, _EVERY + 1), *steps.astype(int), largest])
    return np.asarray(orders[orders <= largest])


def _exact(found: Regression, orders: IntArray) -> Tried:
    """Return orders up to the first that fits to rounding, by what they leave."""
    fits = [found.fit(found.unknowns(p)) for p in orders]
    left = np.array([found.share(np.diag(fit.residual)) for fit in fits])
    left[-1] = min(left[-1], left.min())
    return Tried(found, orders[::-1], np.array([fit.rank for fit in fits])[::-1], left[::-1])


def _too_short(order: int, l: int, m: int, rows: int) -> DataError:
    return DataError(
        f"an observer of order {order} for {l} outputs and {m} inputs was asked",
        f"it has {m + order * (l + m)} unknowns an output, and the record gives {max(rows, 0)} equations",
        "Lower observer_order, or measure longer.",
    )


# ------------------------------------------------------------------------------------------------------------ observer
# Observer identification (OKID): a regression of finite length, and the response and the gain that follow from it.
#
# With an observer of gain G the state-space model reads y(k) = D u(k) + sum_i [ b_i u(k - i) + a_i y(k - i) ], i = 1 ... p,
# with b_i = C (A - G C)^(i-1) (B - G D) and a_i = C (A - G C)^(i-1) G: a regression of finite length whatever the damping. The
# system's own Markov parameters follow from
#
#     Y(k) = b_(k+1) + a_(k+1) D + sum_{i<=k} a_i Y(k - i)         (a_i = b_i = 0 beyond p)
#
# and C A^k G from the same recursion with a_(k+1) instead of the first two terms. When p is long enough and the record too, G is
# the Kalman gain of the noise in the record.

#: A response counts as decayed 80 dB below its largest value.
_DECAYED = 1e-4

#: It grows when the last quarter of a run sees this many times the largest value of the first half: a free body moves twice as far.
_GROWS = 3.0

#: Beyond this many times outputs over inputs nothing is left of a structure.
_HUGE = 1e9

#: Orders that are tried until one does not grow.
_ATTEMPTS = 6


class Observer(NamedTuple):
    """An observer found from a record, and the response that follows from it.

    Attributes
    ----------
    response : ImpulseResponse
        Y(k) = C A^k B with the direct term.
    gain_parameters : array, (N, l, l)
        C A^k G: what the gain is computed from (`gain_of`).
    order : int
        Observer order p: past samples in the regression.
    orders, criterion : array
        All observer orders that were tried, and the mean logarithm of the share of the outputs' power that each leaves of what it was
        not fitted to; the chosen one is the least of those whose response does not grow.
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

    The observer is the one that predicts best what it was not fitted to: every quarter of the runs is predicted from the others, by all
    orders up to `longest` and with more and more of the regressors' singular directions (`modalscope.preprocess.markov`). What only
    noise excites is left out so, of redundant channels and of inputs without power in part of the band alike. Where a record is exact
    to rounding, the first order that fits it is taken. An order whose response grows is passed over for the next best.

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
    outputs, inputs = driven_records(signals)
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
        raise _growing(tried, given)
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


def _growing(tried: Tried, given: int | None) -> DataError:
    orders = ", ".join(str(p) for p, _ in islice(tried.best_first(), _ATTEMPTS))
    return DataError(
        "the response of a structure by an observer (OKID) was asked",
        f"with {'order' if given else 'the best orders,'} {orders} it grows instead of decaying: "
        "the record does not tell damping from noise, or the structure is unstable",
        "Give another observer_order, leave out channels that follow from others or carry noise (exclude), or measure longer.",
    )


def driven_records(signals: Signals) -> tuple[RealArray, RealArray]:
    """Return outputs (R, N, l) and inputs (R, N, m) of records, or raise when nothing was driven."""
    check_size(signals)
    outputs, inputs = signals.by_run()
    if inputs is None:
        raise DataError(
            "Markov parameters were asked",
            "the record has no inputs",
            "Give the forces as inputs, or use estimate_correlation for a record of responses alone.",
        )
    return outputs, inputs


def _coefficients(found: Regression, p: int, rank: int) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Return D (l, m), b (p, l, m), a (p, l, l) and the covariance of what they leave (l, l)."""
    l, m = found.outputs, found.inputs
    solution, _, residual = found.fit(found.unknowns(p), rank)
    past = solution[m:].reshape(p, m + l, l).transpose(0, 2, 1)
    return solution[:m].T, past[:, :, :m], past[:, :, m:], residual / found.rows


def _recursion(
    D: RealArray, b: RealArray, a: RealArray, asked: int | None, run: int
) -> tuple[RealArray, RealArray, str] | None:
    """Return Y(k) and C A^k G, and why they end where they do; None when they grow, seen over the length of a run."""
    p, l, m = b.shape
    own = np.concatenate([b + a @ D, a], axis=2)  # Y and the gain parameters obey one recursion: (p, l, m + l)
    weights = a[::-1].transpose(1, 0, 2).reshape(l, p * l)  # a_p ... a_1, to meet the past in its own order
    most = max(run, asked or 0)
    history, sizes = np.zeros(((most + p) * l, m + l)), np.zeros(most)
    largest, quiet, end = 0.0, 0, "as asked" if asked else "where it had not decayed yet"
    for k in range(most):
        value = weights @ history[k * l : (k + p) * l]
        if k < p:
            value += own[k]
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
        Past samples in the observer ("okid"); chosen by itself by default.
    samples : int, optional
        Length of the response. By default, "okid" goes on until it has decayed by 80 dB, up to the length of a run, and says in
        `processing` which of the two it was; "least squares" takes what a quarter of the record determines.

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
    outputs, inputs = driven_records(signals)
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
