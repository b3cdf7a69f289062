"""Markov parameters from records of any input: by an observer (OKID), or by plain least squares."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.threads import one_thread
from modalscope.model.checks import DataError, check_choice, check_count, check_kind
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.signals import Signals
from modalscope.preprocess.observer import driven_records, estimate_observer, pulse_response
from modalscope.preprocess.regression import RANK

__all__ = ["estimate_markov"]


@named()
@one_thread
def estimate_markov(
    signals: Signals,
    *,
    method: str = "okid",
    observer_order: int | None = None,
    samples: int | None = None,
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
    >>> from modalscope.model import StateSpace
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
