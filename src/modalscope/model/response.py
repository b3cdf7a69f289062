"""What an identification asks of a response, whichever of the two kinds it is."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse

__all__ = ["Response", "is_held", "output_scale", "window_damping"]

Response = ImpulseResponse | FrequencyResponse


def output_scale(response: Response) -> RealArray:
    """Return the root mean square of every output, (l,), by which quiet outputs are brought level with loud ones."""
    return np.asarray(np.sqrt(np.mean(np.abs(response.values) ** 2, axis=(0, 2))))


def window_damping(response: Response) -> float:
    """Return the decay rate (1/s) that an exponential window added: it is in the data, but not in the modes."""
    return response.added_damping


def is_held(response: Response) -> bool:
    """Whether the response is that of a sampled system under a held input, H(z) = D + sum phi l' / (z - exp(s dt))."""
    return response.sampling_rate is not None if isinstance(response, FrequencyResponse) else response.kind == "pulse"
