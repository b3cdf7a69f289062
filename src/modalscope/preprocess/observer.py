"""Observer identification (OKID): a regression of finite length, and the response and the gain that follow from it.

With an observer of gain G the state-space model reads y(k) = D u(k) + sum_i [ b_i u(k - i) + a_i y(k - i) ], i = 1 ... p,
with b_i = C (A - G C)^(i-1) (B - G D) and a_i = C (A - G C)^(i-1) G: a regression of finite length whatever the damping. The
system's own Markov parameters follow from

    Y(k) = b_(k+1) + a_(k+1) D + sum_{i<=k} a_i Y(k - i)         (a_i = b_i = 0 beyond p)

and C A^k G from the same recursion with a_(k+1) instead of the first two terms. When p is long enough and the record too, G is
the Kalman gain of the noise in the record.
"""

from __future__ import annotations

from itertools import islice
from typing import NamedTuple

import numpy as np

from modalscope.blocks.threads import one_thread
from modalscope.model.checks import DataError, IntArray, RealArray, check_count
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.signals import Signals
from modalscope.model.sizes import check_size
from modalscope.model.statespace import StateSpace
from modalscope.preprocess.observer_order import Tried, tried_orders
from modalscope.preprocess.regression import Regression

__all__ = ["Observer", "driven_records", "estimate_observer", "pulse_response"]

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
    orders up to `longest` and with more and more of the regressors' singular directions (`modalscope.preprocess.regression`). What only
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
