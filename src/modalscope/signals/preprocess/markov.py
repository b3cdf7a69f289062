"""Estimate Markov parameters from records of any input by an observer (OKID).

Observer/Kalman filter identification (OKID): with an observer of gain G the state-space model reads

    y(k) = D u(k) + sum_i [ b_i u(k - i) + a_i y(k - i) ], i = 1 ... p,
    b_i = C (A - G C)^(i-1) (B - G D), a_i = C (A - G C)^(i-1) G:

a regression of finite length whatever the damping. The Markov parameters of the system follow from

    Y(k) = b_(k+1) + a_(k+1) D + sum_{i<=k} a_i Y(k - i)         (a_i = b_i = 0 beyond p)

For large p and long records G is the Kalman gain of the noise.
"""

from __future__ import annotations

from itertools import islice

import numpy as np

from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.numerics.arguments import COUNT, at_least, named
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread
from modalscope.signals.preprocess.excitation import driven_records
from modalscope.signals.preprocess.observer_regression import Regression, tried_orders

#: A response has decayed at this part of its largest value, 80 dB below.
_DECAYED_LEVEL = 1e-4

#: A response grows when the last quarter of a run exceeds the largest value of the first half by this factor (a free body: by two).
_GROWTH = 3.0

#: A response beyond this many times outputs over inputs is unstable.
_UNSTABLE_SIZE = 1e9

#: Maximum number of orders that are tried until one does not grow.
_MAX_ATTEMPTS = 6


def _level(records: RealArray) -> RealArray:
    """Return the root mean square of every channel, 1 for one that is zero."""
    size = np.sqrt(np.mean(records**2, axis=(0, 1)))
    return np.asarray(np.where(size > 0, size, 1.0))


def _coefficients(regression: Regression, p: int, rank: int) -> tuple[RealArray, RealArray, RealArray]:
    """Return D (l, m), b (p, l, m) and a (p, l, l)."""
    l, m = regression.outputs, regression.inputs
    solution = regression.fit(regression.unknowns(p), rank)[0]
    past = solution[m:].reshape(p, m + l, l).transpose(0, 2, 1)
    return solution[:m].T, past[:, :, :m], past[:, :, m:]


def _recursion(D: RealArray, b: RealArray, a: RealArray, asked: int | None, run: int) -> tuple[RealArray, str] | None:
    """Return Y(k), and the reason of its length; None when it grows over the length of a run."""
    p, l, m = b.shape
    direct = b + a @ D
    weights = a[::-1].transpose(1, 0, 2).reshape(l, p * l)  # a_p ... a_1, in the order of the past
    most = max(run, asked or 0)
    history, sizes = np.zeros(((most + p) * l, m)), np.zeros(most)
    largest, quiet, end = 0.0, 0, "as asked" if asked else "before it has decayed"
    for k in range(most):
        value = weights @ history[k * l : (k + p) * l]
        if k < p:
            value += direct[k]
        history[(k + p) * l : (k + p + 1) * l] = value
        sizes[k] = np.abs(value).max()
        if not sizes[k] < _UNSTABLE_SIZE:
            return None
        largest, quiet = max(largest, sizes[k]), quiet + 1 if sizes[k] <= _DECAYED_LEVEL * largest else 0
        if quiet >= 2 * p and k >= 4 * p and k + 1 >= (asked or 0):
            most, end = k + 1, end if asked else "decayed by 80 dB"
            break
    if quiet < 2 * p and sizes[3 * most // 4 :].max() > _GROWTH * sizes[: most // 2].max():
        return None
    return history[p * l : (p + (asked or most)) * l].reshape(-1, l, m), end


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


@named(signals=Signals, observer_order=COUNT, samples=at_least(2))
@one_thread
def estimate_markov(
    signals: Signals, *, observer_order: int | None = None, samples: int | None = None
) -> ImpulseResponse:
    """Estimate Markov parameters Y(k) = C A^k B and the direct term from records with measured inputs of any kind.

    The observer is the best in cross-validation: every quarter of the runs is predicted from the others, by orders up to 60, or what
    the record's samples and 600 regressors allow, and with more and more of the regressors' singular directions
    (`observer_regression`). This excludes directions that only noise excites, of redundant channels and of inputs without power in part of
    the band. Where a record is exact to rounding, the first order that fits it is taken. An order whose response grows is rejected for
    the next best.

    Parameters
    ----------
    signals : Signals
        Outputs and inputs; several runs are used together. Nothing is assumed about the state at the start.
    observer_order : int, optional
        Past samples in the observer; by default the best of all.
    samples : int, optional
        Length of the response. By default it goes on until it has decayed by 80 dB, up to the length of a run; `processing` says which.

    Returns
    -------
    ImpulseResponse
        Kind "pulse", with `feedthrough`.

    Raises
    ------
    DataError
        No inputs, too short a record, or a response that grows with every observer.

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
    outputs, inputs = driven_records(signals, "Markov parameters")
    output_scale, input_scale = _level(outputs), _level(inputs)
    tried = tried_orders(outputs / output_scale, inputs / input_scale, observer_order)
    for p, rank in islice(tried.best_first(), _MAX_ATTEMPTS):
        D, b, a = _coefficients(tried.regression, p, rank)
        response = _recursion(D, b, a, samples, outputs.shape[1])
        if response is not None:
            break
    else:
        orders = ", ".join(str(p) for p, _ in islice(tried.best_first(), _MAX_ATTEMPTS))
        have = f"with order {orders} it grows: noise hides the damping, or the structure is unstable"
        change = "Give another observer_order, exclude redundant or noisy channels, or measure longer."
        raise DataError("a response by an observer (OKID):", have, change)
    Y, end = response
    by_input = output_scale[:, None] / input_scale
    choice = f"{'chosen' if observer_order is None else 'given'}, {rank} of {tried.regression.unknowns(p)} directions"
    note = f"OKID with an observer of order {p} ({choice}), {len(Y)} samples, {end}"
    return _pulse_response(signals, Y * by_input, D * by_input, note)
