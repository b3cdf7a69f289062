"""The recursion x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k) of a sampled model (Eqs. 5, 11)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.checks import DataError, RealArray, real_array

if TYPE_CHECKING:
    from modalscope.model.quadruple import Quadruple

__all__ = ["markov_parameters", "simulated"]


def markov_parameters(A: RealArray, B: RealArray, C: RealArray, samples: int) -> RealArray:
    """Return Y(k) = C A^k B, k = 0 ... samples - 1, (samples, l, m)."""
    values, state = np.empty((samples, C.shape[0], B.shape[1])), np.array(B)
    for k in range(samples):
        values[k] = C @ state
        state = A @ state
    return values


def simulated(model: Quadruple, inputs: ArrayLike, initial_state: ArrayLike | None) -> RealArray:
    """Return the outputs (N, l) for inputs (N, m) and a state to start from (see `StateSpace.simulate`)."""
    u = real_array("inputs", inputs, "(samples, inputs)", 2)
    if u.shape[1] != model.B.shape[1]:
        raise DataError(
            f"inputs of {model.B.shape[1]} channels were asked",
            f"there are {u.shape[1]}",
            "Give one column an input.",
        )
    x = (
        np.zeros(model.order)
        if initial_state is None
        else np.array(real_array("initial_state", initial_state, "(states,)", 1))
    )
    if x.shape != (model.order,):
        raise DataError(f"initial_state needs {model.order} entries", f"it has {x.size}", "Give one a state.")
    driven = u @ model.B.T
    states = np.empty((u.shape[0], model.order))
    for k, push in enumerate(driven):
        states[k] = x
        x = model.A @ x + push
    return np.asarray(states @ model.C.T + u @ model.D.T)
