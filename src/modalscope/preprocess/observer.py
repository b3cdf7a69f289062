"""Observer identification (OKID): a regression of finite length, and the response and the gain that follow from it.

With an observer of gain G the state-space model reads y(k) = D u(k) + sum_i [ b_i u(k - i) + a_i y(k - i) ], i = 1 ... p,
with b_i = C (A - G C)^(i-1) (B - G D) and a_i = C (A - G C)^(i-1) G: a regression of finite length whatever the damping. The
system's own Markov parameters follow from

    Y(k) = b_(k+1) + a_(k+1) D + sum_{i<=k} a_i Y(k - i)         (a_i = b_i = 0 beyond p)

and C A^k G from the same recursion with a_(k+1) instead of the first two terms. When p is long enough and the record too, G is
the Kalman gain of the noise in the record.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.threads import one_thread
from modalscope.model.checks import DataError, RealArray, check_count
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.signals import Signals
from modalscope.model.statespace import StateSpace

__all__ = ["RANK", "Observer", "driven_records", "estimate_observer", "pulse_response"]

#: Rows of the regression that are factored at a time.
_AT_ONCE = 4096

#: Directions of the regressors below this part of the largest carry rounding only; the shortest solution leaves them out.
RANK = 1e-13

#: A response counts as decayed 80 dB below its largest value.
_DECAYED = 1e-4

#: Residuals below this part of the outputs are rounding: a longer observer would fit nothing more.
_EXACT = 1e-11


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
        All observer orders that were tried, and the value of the criterion that the chosen one minimises.
    residual_covariance : array, (l, l)
        Covariance of the one-step prediction errors.
    """

    response: ImpulseResponse
    gain_parameters: RealArray
    order: int
    orders: RealArray
    criterion: RealArray
    residual_covariance: RealArray

    def gain_of(self, model: StateSpace) -> RealArray:
        """Return the gain G (n, l) of x(k+1) = A x + B u + G (y - C x - D u) in the coordinates of a realization of the response.

        Least squares on C A^k G = gain_parameters[k], as many samples as the observer's order or the states need.

        Parameters
        ----------
        model : StateSpace
            Sampled, a realization of this observer's response.

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

    One triangular factorization serves all observer orders. The chosen order minimises Akaike's criterion
    N log det(residual covariance) + 2 (number of parameters), over orders up to `longest`; when the residual vanishes to
    rounding, the first such order is taken.

    Parameters
    ----------
    signals : Signals
    observer_order : int, optional
        Past samples p; p l must be at least the number of states.
    samples : int, optional
        Length of the response (see `estimate_markov`).
    longest : int, optional
        Largest order tried; by default 60, or what a fifth of the record's samples determines.

    Raises
    ------
    DataError
        No inputs, or too short a record.
    """
    outputs, inputs = driven_records(signals)
    l, m = outputs.shape[2], inputs.shape[2]
    room = (outputs.shape[0] * outputs.shape[1] // 5 - m) // (l + m)
    most = min(60, room, outputs.shape[1] // 4) if longest is None else check_count("longest", longest)
    top = max(most, 1) if observer_order is None else check_count("observer_order", observer_order)
    rows = outputs.shape[0] * (outputs.shape[1] - top)
    unknowns = m + top * (l + m)
    if outputs.shape[1] <= top or rows < unknowns + l:
        raise DataError(
            f"an observer of order {top} for {l} outputs and {m} inputs was asked",
            f"it has {unknowns} unknowns an output, and the record gives {max(rows, 0)} equations",
            "Lower observer_order, or measure longer.",
        )
    R = _triangle(outputs, inputs, top)
    orders = np.arange(1, top + 1) if observer_order is None else np.array([top])
    residuals = [_residual(R, m + p * (l + m), l) / rows for p in orders]
    power = np.diag(R[:, -l:].T @ R[:, -l:]) / rows
    criterion = np.array([_akaike(S, p, rows, m, power) for p, S in zip(orders, residuals, strict=True)])
    best = int(np.argmin(criterion))
    p = int(orders[best])
    D, b, a = _coefficients(R, p, l, m)
    Y, gain, decayed = _recursion(
        D, b, a, outputs.shape[1] if samples is None else check_count("samples", samples, least=2), samples is None
    )
    end = (
        "until it had decayed by 80 dB"
        if decayed
        else "where it had not decayed yet"
        if samples is None
        else "as asked"
    )
    note = f"OKID with an observer of order {p} ({'chosen' if observer_order is None else 'given'}), {Y.shape[0]} samples, {end}"
    return Observer(pulse_response(signals, Y, D, note), gain, p, orders, criterion, residuals[best])


def driven_records(signals: Signals) -> tuple[RealArray, RealArray]:
    """Return outputs (R, N, l) and inputs (R, N, m) of records, or raise when nothing was driven."""
    outputs, inputs = signals.by_run()
    if inputs is None:
        raise DataError(
            "Markov parameters were asked",
            "the record has no inputs",
            "Give the forces as inputs, or use estimate_correlation for a record of responses alone.",
        )
    return outputs, inputs


def _triangle(outputs: RealArray, inputs: RealArray, order: int) -> RealArray:
    """Return the triangular factor of [u(k), u(k-1), y(k-1), ..., u(k-p), y(k-p), y(k)] over all k of all runs.

    An order's regressors come before those of the next one, so that its own factor is a leading block.
    """
    R = np.zeros((0, inputs.shape[2] * (order + 1) + outputs.shape[2] * (order + 1)))
    for y, u in zip(outputs, inputs, strict=True):
        for first in range(order, y.shape[0], _AT_ONCE):
            last = min(first + _AT_ONCE, y.shape[0])
            past = [part[first - i : last - i] for i in range(1, order + 1) for part in (u, y)]
            block = np.concatenate([u[first:last], *past, y[first:last]], axis=1)
            R = sla.qr(np.concatenate([R, block]), mode="r", overwrite_a=True, check_finite=False)[0]
            R = R[: R.shape[1]]
    return R


def _residual(R: RealArray, unknowns: int, l: int) -> RealArray:
    """Return the sums of squared residuals (l, l) of the regression on the first columns."""
    left = R[unknowns:, -l:]
    return np.asarray(left.T @ left)


def _akaike(S: RealArray, p: int, rows: int, m: int, power: RealArray) -> float:
    """Return N log det S + 2 parameters, S scaled by the outputs' powers; residuals of rounding size count as that size."""
    l = power.size
    scale = np.sqrt(np.where(power > 0, power, 1.0))
    values = np.linalg.eigvalsh(S / np.outer(scale, scale))
    return float(rows * np.sum(np.log(np.maximum(values, _EXACT**2))) + 2 * l * (m + p * (l + m)))


def _coefficients(R: RealArray, p: int, l: int, m: int) -> tuple[RealArray, RealArray, RealArray]:
    """Return D (l, m), b (p, l, m) and a (p, l, l): the shortest least-squares solution."""
    unknowns = m + p * (l + m)
    solution = np.asarray(sla.lstsq(R[:unknowns, :unknowns], R[:unknowns, -l:], cond=RANK, check_finite=False)[0])
    past = solution[m:].reshape(p, m + l, l).transpose(0, 2, 1)
    return solution[:m].T, past[:, :, :m], past[:, :, m:]


def _recursion(
    D: RealArray, b: RealArray, a: RealArray, samples: int, until_decayed: bool
) -> tuple[RealArray, RealArray, bool]:
    """Return Y(k) and C A^k G, and whether they end because Y has decayed."""
    p, l, m = b.shape
    own = np.concatenate([b + a @ D, a], axis=2)  # Y and the gain parameters obey one recursion: (p, l, m + l)
    weights = a[::-1].transpose(1, 0, 2).reshape(l, p * l)  # a_p ... a_1, to meet the past in its own order
    history = np.zeros(((samples + p) * l, m + l))
    largest, quiet = 0.0, 0
    for k in range(samples):
        value = weights @ history[k * l : (k + p) * l]
        if k < p:
            value += own[k]
        history[(k + p) * l : (k + p + 1) * l] = value
        size = float(np.abs(value[:, :m]).max())
        largest, quiet = max(largest, size), quiet + 1 if size <= _DECAYED * largest else 0
        if until_decayed and quiet >= 2 * p and k >= 4 * p:
            samples = k + 1
            break
    values = history[p * l : (p + samples) * l].reshape(samples, l, m + l)
    return np.ascontiguousarray(values[:, :, :m]), np.ascontiguousarray(values[:, :, m:]), quiet >= 2 * p


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
