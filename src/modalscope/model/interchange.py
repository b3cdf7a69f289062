"""State-space models to and from scipy and python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from modalscope.model.checks import DataError
from modalscope.model.extras import optional_package

if TYPE_CHECKING:
    from modalscope.model.statespace import StateSpace

__all__ = ["matrices_of", "to_control", "to_scipy"]


def to_scipy(model: StateSpace) -> Any:
    """Return the model as `scipy.signal.StateSpace`."""
    from scipy import signal

    sampling = {} if model.dt is None else {"dt": model.dt}
    return signal.StateSpace(model.A, model.B, model.C, model.D, **sampling)


def to_control(model: StateSpace) -> Any:
    """Return the model as python-control's `StateSpace`."""
    control = optional_package("to_control", "control", "control", "python-control")
    return control.ss(model.A, model.B, model.C, model.D, 0 if model.dt is None else model.dt)


def matrices_of(system: Any) -> dict[str, Any]:
    """Return A, B, C, D and dt of a state-space model of scipy or python-control."""
    missing = [name for name in "ABCD" if not hasattr(system, name)]
    if missing:
        raise DataError(
            "a state-space model was asked",
            f"{type(system).__name__} has no {', '.join(missing)}",
            "Convert it there first, for instance by to_ss() or control.ss().",
        )
    dt = getattr(system, "dt", None)
    if dt is True:
        raise DataError(
            "a sampled model needs its sampling interval",
            "it says only that it is sampled (dt=True)",
            "Give dt in seconds.",
        )
    # python-control writes 0 for continuous time
    return {name: getattr(system, name) for name in "ABCD"} | {"dt": dt or None}
