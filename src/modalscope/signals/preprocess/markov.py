"""Estimate Markov parameters from records of any input: by an observer (OKID), or by least squares.

Observer/Kalman filter identification (OKID): with an observer of gain G the state-space model reads

    y(k) = D u(k) + sum_i [ b_i u(k - i) + a_i y(k - i) ], i = 1 ... p,
    b_i = C (A - G C)^(i-1) (B - G D), a_i = C (A - G C)^(i-1) G:

a regression of finite length whatever the damping. The Markov parameters of the system follow from

    Y(k) = b_(k+1) + a_(k+1) D + sum_{i<=k} a_i Y(k - i)         (a_i = b_i = 0 beyond p)

and C A^k G from the same recursion with a_(k+1) instead of the first two terms. For large p and long records G is the Kalman gain of the
noise.
"""

from __future__ import annotations

from itertools import islice
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.data.statespace import StateSpace
from modalscope.numerics.arguments import COUNT, at_least, named, plain_methods
from modalscope.numerics.checks import IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread
from modalscope.signals.preprocess.excitation import driven_records
from modalscope.signals.preprocess.observer_regression import RANK, Regression, tried_orders

#: A response has decayed at this part of its largest value, 80 dB below.
_DECAYED_LEVEL = 1e-4

#: A response grows when the last quarter of a run exceeds the largest value of the first half by this factor (a free body: by two).
_GROWTH = 3.0

#: A response beyond this many times outputs over inputs is unstable.
_UNSTABLE_SIZE = 1e9

#: Maximum number of orders that are tried until one does not grow.
_MAX_ATTEMPTS = 6


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
            have = f"this one has {model.C.shape[0]}" + (" and is continuous" if model.dt is None else "")
            asked = f"the gain of a sampled model with {l} outputs was asked"
            raise DataError(asked, have, "Give a realization of this observer's response.")
        count = min(max(self.order, model.order), self.gain_parameters.shape[0])
        rows, power = [], np.array(model.C)
        for _ in range(count):
            rows.append(power)
            power = power @ model.A
        gain = np.linalg.lstsq(np.concatenate(rows), self.gain_parameters[:count].reshape(-1, l), rcond=None)[0]
        return np.asarray(gain)


@named(observer_order=COUNT, samples=at_least(2), longest=COUNT)
@one_thread
def estimate_observer(
    signals: Signals, *, observer_order: int | None = None, samples: int | None = None, longest: int | None = None
) -> Observer:
    """Identify an observer (OKID): the response, the gain and the observer's order.

    The observer is the best in cross-validation: every quarter of the runs is predicted from the others, by all orders up to `longest`
    and with more and more of the regressors' singular directions (`observer_regression`). This excludes directions that only
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
    output_scale, input_scale = _level(outputs), _level(inputs)
    tried = tried_orders(outputs / output_scale, inputs / input_scale, observer_order, longest)
    for p, rank in islice(tried.best_first(), _MAX_ATTEMPTS):
        D, b, a, S = _coefficients(tried.regression, p, rank)
        response = _recursion(D, b, a, samples, outputs.shape[1])
        if response is not None:
            break
    else:
        orders = ", ".join(str(p) for p, _ in islice(tried.best_first(), _MAX_ATTEMPTS))
        have = f"with order {orders} it grows: noise hides the damping, or the structure is unstable"
        change = "Give another observer_order, exclude redundant or noisy channels, or measure longer."
        raise DataError("a response by an observer (OKID) was asked", have, change)
    Y, gain, end = response
    by_input, by_output = output_scale[:, None] / input_scale, output_scale[:, None] / output_scale
    choice = f"{'chosen' if observer_order is None else 'given'}, {rank} of {tried.regression.unknowns(p)} directions"
    note = f"OKID with an observer of order {p} ({choice}), {len(Y)} samples, {end}"
    return Observer(
        response=_pulse_response(signals, Y * by_input, D * by_input, note),
        gain_parameters=gain * by_output,
        order=p,
        orders=tried.orders,
        criterion=tried.criterion,
        residual_covariance=S * np.outer(output_scale, output_scale),
    )


def _level(records: RealArray) -> RealArray:
    """Return the root mean square of every channel, 1 for one that is zero."""
    size = np.sqrt(np.mean(records**2, axis=(0, 1)))
    return np.asarray(np.where(size > 0, size, 1.0))


def _coefficients(regression: Regression, p: int, rank: int) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Return D (l, m), b (p, l, m), a (p, l, l) and the covariance of the residuals (l, l)."""
    l, m = regression.outputs, regression.inputs
    solution, _, residual = regression.fit(regression.unknowns(p), rank)
    past = solution[m:].reshape(p, m + l, l).transpose(0, 2, 1)
    return solution[:m].T, past[:, :, :m], past[:, :, m:], residual / regression.rows


def _recursion(
    D: RealArray, b: RealArray, a: RealArray, asked: int | None, run: int
) -> tuple[RealArray, RealArray, str] | None:
    """Return Y(k) and C A^k G, and the reason of their length; None when they grow over the length of a run."""
    p, l, m = b.shape
    direct = np.concatenate([b + a @ D, a], axis=2)  # Y and the gain parameters obey one recursion: (p, l, m + l)
    weights = a[::-1].transpose(1, 0, 2).reshape(l, p * l)  # a_p ... a_1, in the order of the past
    most = max(run, asked or 0)
    history, sizes = np.zeros(((most + p) * l, m + l)), np.zeros(most)
    largest, quiet, end = 0.0, 0, "as asked" if asked else "before it has decayed"
    for k in range(most):
        value = weights @ history[k * l : (k + p) * l]
        if k < p:
            value += direct[k]
        history[(k + p) * l : (k + p + 1) * l] = value
        sizes[k] = np.abs(value[:, :m]).max()
        if not sizes[k] < _UNSTABLE_SIZE:
            return None
        largest, quiet = max(largest, sizes[k]), quiet + 1 if sizes[k] <= _DECAYED_LEVEL * largest else 0
        if quiet >= 2 * p and k >= 4 * p and k + 1 >= (asked or 0):
            most, end = k + 1, end if asked else "decayed by 80 dB"
            break
    if quiet < 2 * p and sizes[3 * most // 4 :].max() > _GROWTH * sizes[: most // 2].max():
        return None
    values = history[p * l : (p + (asked or most)) * l].reshape(-1, l, m + l)
    return values[:, :, :m], values[:, :, m:], end


def _pulse_response(signals: Signals, Y: RealArray, D: RealArray, note: str) -> ImpulseResponse:
    """Return Y(k) and the direct term D as the response of the records' channels."""
    return ImpulseResponse(
        values=Y,
        feedthrough=D,
        sampling_rate=signals.sampling_rate,
        kind="pulse",
        quantity=signals.quantity,
        **signals.labelled(),
    ).processed(note)


@named(signals=Signals, method=("okid", "least squares"), observer_order=COUNT, samples=at_least(2))
@one_thread
def estimate_markov(
    signals: Signals, *, method: str = "okid", observer_order: int | None = None, samples: int | None = None
) -> ImpulseResponse:
    """Estimate Markov parameters Y(k) = C A^k B and the direct term from records with measured inputs of any kind.

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
    if method == "okid":
        return estimate_observer(signals, observer_order=observer_order, samples=samples).response
    if observer_order is not None:
        asked, have = f"observer_order={observer_order} was asked", 'method="least squares" has no observer'
        raise DataError(asked, have, "Leave it out.")
    return _least_squares(signals, samples)


def _least_squares(signals: Signals, samples: int | None) -> ImpulseResponse:
    outputs, inputs = driven_records(signals, "Markov parameters")
    (runs, length), m = outputs.shape[:2], inputs.shape[2]
    count = min(max(2, runs * length // (4 * m) - 1), length // 2) if samples is None else samples
    rows, unknowns = runs * (length - count), m * (count + 1)
    if length <= count or rows < unknowns:
        asked = f"{count} samples of a response to {m} inputs by least squares were asked"
        have = f"they have {unknowns} unknowns an output, and the record gives {max(rows, 0)} equations"
        raise DataError(asked, have, 'Lower samples, measure longer, or use method="okid".')
    blocks = []
    for y, u in zip(outputs, inputs, strict=True):
        past = [u[count - i : length - i] for i in range(count + 1)]
        blocks.append(np.concatenate([*past, y[count:]], axis=1))
    joined = np.concatenate(blocks)
    steps = (
        sla.lstsq(joined[:, :unknowns], joined[:, unknowns:], cond=RANK)[0].reshape(count + 1, m, -1).transpose(0, 2, 1)
    )
    return _pulse_response(signals, steps[1:], steps[0], f"least squares for {count} samples of the response")


plain_methods(Observer)
