"""The recursion x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k) of a sampled model (Eqs. 5, 11)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.checks import DataError, RealArray, real_array

if TYPE_CHECKING:
    from modalscope.model.quadruple import Quadruple
    from modalscope.model.signals import Signals

__all__ = ["markov_parameters", "predicted", "simulated"]


def markov_parameters(A: RealArray, B: RealArray, C: RealArray, samples: int) -> RealArray:
    """Return Y(k) = C A^k B, k = 0 ... samples - 1, (samples, l, m)."""
    states, state = np.empty((samples, B.shape[1], len(A))), np.array(B)
    for k in range(samples):
        states[k] = state.T
        state = A @ state
    # one product for all samples: outputs are many beside inputs
    values = states.reshape(-1, len(A)) @ C.T
    return np.ascontiguousarray(values.reshape(samples, B.shape[1], len(C)).transpose(0, 2, 1))


def simulated(model: Quadruple, inputs: ArrayLike, initial: ArrayLike | None) -> RealArray:
    """Return the outputs (N, l) for inputs (N, m) and a state to start from (see `StateSpace.simulate`)."""
    u = real_array("inputs", inputs, "(samples, inputs)", 2)
    if u.shape[1] != model.B.shape[1]:
        raise DataError(
            f"inputs of {model.B.shape[1]} channels were asked",
            f"there are {u.shape[1]}",
            "Give one column an input.",
        )
    states = _states(model.A, u @ model.B.T, _initial(model, initial))
    return np.asarray(states @ model.C.T + u @ model.D.T)


def predicted(model: Quadruple, signals: Signals, initial: ArrayLike | None) -> RealArray:
    """Return one-step predictions of a record's outputs (see `StateSpace.predict`): x(k+1) = (A - K C) x + (B - K D) u + K y."""
    if model.gain is None:
        raise DataError(
            "one-step predictions were asked",
            "the model has no gain",
            "Identify it from records with method='n4sid', give gain=, or use simulate().",
        )
    _check_record(model, signals)
    outputs, inputs = signals.by_run()
    u = np.zeros((*outputs.shape[:2], 0)) if inputs is None else inputs
    A, B = model.A - model.gain @ model.C, model.B - model.gain @ model.D
    start = _initial(model, initial)
    runs = [
        _states(A, v @ B.T + y @ model.gain.T, start) @ model.C.T + v @ model.D.T
        for y, v in zip(outputs, u, strict=True)
    ]
    return np.asarray(np.stack(runs).reshape(signals.outputs.shape))


def _check_record(model: Quadruple, signals: Signals) -> None:
    l, m = model.D.shape
    rate = 1 / model.dt if model.dt else np.nan
    if (len(signals.output_dofs), len(signals.input_dofs)) != (l, m) or not np.isclose(signals.sampling_rate, rate):
        raise DataError(
            f"predictions of {l} outputs from {m} inputs at {rate:g} Hz were asked",
            f"the record has {len(signals.output_dofs)} outputs and {len(signals.input_dofs)} inputs at {signals.sampling_rate:g} Hz",
            "Select the model's channels, and resample to its rate.",
        )


def _initial(model: Quadruple, initial: ArrayLike | None) -> RealArray:
    x = np.zeros(model.order) if initial is None else np.array(real_array("initial", initial, "(states,)", 1))
    if x.shape != (model.order,):
        raise DataError(f"initial needs {model.order} entries", f"it has {x.size}", "Give one a state.")
    return x


def _states(A: RealArray, driven: RealArray, x: RealArray) -> RealArray:
    """Return x(k), (N, n), of x(k+1) = A x(k) + driven(k)."""
    states = np.empty((len(driven), A.shape[0]))
    for k, push in enumerate(driven):
        states[k] = x
        x = A @ x + push
    return states
