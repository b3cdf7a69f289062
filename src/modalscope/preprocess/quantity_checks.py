"""Whether the quantity of responses can be right: the slope of |H| below the first resonance."""

from __future__ import annotations

import numpy as np
import scipy

from modalscope.model.checks import RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.response import Response
from modalscope.preprocess.findings import Finding

__all__ = ["check_slope", "fits_slope", "level", "wrong_quantity"]

#: Slopes of log |H| over log f below the first resonance, for fixed and for free structures.
_SLOPES = {"displacement": (0.0, -2.0), "velocity": (1.0, -1.0), "acceleration": (2.0, 0.0)}

#: A slope contradicts a quantity when farther than this from both of its own, and points to one when nearer than that.
_FAR, _NEAR = 0.7, 0.4


def check_slope(response: FrequencyResponse) -> list[Finding]:
    """Return a finding when the slope below the first resonance contradicts the quantity and points to another."""
    slope = _low_slope(response)
    if response.quantity is None or slope is None:
        return []
    near = {q: min(abs(slope - s) for s in slopes) for q, slopes in _SLOPES.items()}
    best = min(near, key=lambda q: near[q])
    if near[response.quantity] < _FAR or near[best] > _NEAR:
        return []
    why = f"below the first resonance |H| goes with the power {slope:.1f} of the frequency"
    return [wrong_quantity(response.quantity, best, response.output_dofs, why)]


def fits_slope(response: Response, quantity: str) -> bool:
    """Whether the lines below the first resonance show the slope of a quantity."""
    slope = _low_slope(response) if isinstance(response, FrequencyResponse) else None
    return slope is not None and min(abs(slope - s) for s in _SLOPES[quantity]) < _NEAR


def wrong_quantity(given: str, better: str, dofs: tuple[str, ...], why: str) -> Finding:
    """Return the finding that a quantity looks like another one."""
    return Finding(
        "wrong quantity",
        dofs,
        f"called {given}, they look like {better}: {why}",
        f'Give quantity="{better}" if that is what was measured.',
    )


def level(response: FrequencyResponse) -> RealArray:
    """Return log |H| of all channels together, (F,), each channel scaled to its own mean square."""
    power = np.abs(response.values) ** 2
    mean = power.mean(axis=0, keepdims=True)
    scaled = np.divide(power, mean, out=np.zeros_like(power), where=mean > 0)
    return np.asarray(0.5 * np.log(np.maximum(scaled.mean(axis=(1, 2)), np.finfo(float).tiny)))


def _low_slope(response: FrequencyResponse) -> float | None:
    """Return the slope of log |H| over log f from a sixth to half of the first resonance, of what a spring or a mass alone does.

    None with fewer than six lines there, or where H is neither: a static response is real for an even slope, imaginary for
    an odd one, and what leaks from a resonance is not.
    """
    f, log_size = response.frequencies, level(response)
    peaks = scipy.signal.find_peaks(log_size, prominence=np.log(5))[0]
    if peaks.size == 0:
        return None
    first = f[peaks[0]]
    low = (f > first / 6) & (f < first / 2) & (f > 0)
    if int(low.sum()) < 6 or f[low][-1] < 1.5 * f[low][0]:
        return None
    x, y = np.log(f[low]), log_size[low] + np.log(1 - (f[low] / first) ** 2)  # without the resonance's own rise
    if response.variance is not None:
        scatter = response.variance[low].sum(axis=(1, 2)) / np.sum(np.abs(response.values[low]) ** 2, axis=(1, 2))
        if float(scatter.max()) > 0.1:
            return None  # the estimates' own scatter hides the slope
    slope, at = np.polyfit(x, y, 1)
    # noise and suspension modes are no straight line
    straight = float(np.std(y - slope * x - at)) < 0.1
    H = response.values[low]
    on_axis = float(np.sum((H.real if round(slope) % 2 == 0 else H.imag) ** 2)) > 0.9 * float(np.sum(np.abs(H) ** 2))
    return float(slope) if straight and on_axis else None
