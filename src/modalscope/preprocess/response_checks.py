"""Examination of responses: what their channels, coherence, signs, slopes and resolution say."""

from __future__ import annotations

import numpy as np
import scipy

from modalscope.model.checks import Array, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.response import Response
from modalscope.model.window import line_step
from modalscope.preprocess.findings import Finding, dead_channels, identical_channels, sides_of
from modalscope.preprocess.line_checks import conjugated, lone_lines, no_phase
from modalscope.preprocess.phase_checks import odd_phases
from modalscope.preprocess.polarity import check_polarity
from modalscope.preprocess.quantity_checks import check_slope, level

__all__ = ["bandwidths", "examine_response"]

#: Less than this part of an output's power explained by the inputs is little: short segments alone leave more.
_COHERENT = 0.6

#: A decay to one per cent within the record of one line spacing: half-power bandwidth of this many lines.
_RESOLVED = np.log(100) / np.pi


def examine_response(response: Response) -> list[Finding]:
    """Return what is wrong, or may be, with responses; coherence, slopes and resolution are those of lines."""
    found = [finding for _, flat, labels in sides_of(response) for finding in dead_channels(flat, labels)]
    _, flat, labels = sides_of(response)[0]
    found += identical_channels(flat, labels)
    found += check_polarity(response)
    if isinstance(response, FrequencyResponse):
        unlike = odd_phases(response) or no_phase(response)
        if unlike:  # the others would speak of what are no complex values
            return found + unlike
        found += conjugated(response)
        found += _coherence(response) + check_slope(response) + _resolution(response) + lone_lines(response)
    return found


def _coherence(response: FrequencyResponse) -> list[Finding]:
    if response.coherence is None:
        return []
    c = response.coherence if response.coherence.ndim == 2 else response.coherence.min(axis=2)
    power = np.sum(np.abs(response.values) ** 2, axis=2)
    found = []
    for i, dof in enumerate(response.output_dofs):
        total = float(power[:, i].sum())
        explained = float(c[:, i] @ power[:, i]) / total if total > 0 else 1.0
        if explained < _COHERENT:
            found.append(
                Finding(
                    "low coherence",
                    (dof,),
                    f"{explained:.2f} around its resonances: so much of its power follows from the inputs",
                    "Look for overloaded hits, forces that were not measured, noise, or too short segments.",
                )
            )
    return found


def bandwidths(response: FrequencyResponse) -> tuple[Array, RealArray]:
    """Return the lines of the peaks of all channels together, and their half-power bandwidths in Hz."""
    log_size = level(response)
    peaks = scipy.signal.find_peaks(log_size, prominence=np.log(5))[0]
    # half power is log sqrt(2) below the top
    widths = scipy.signal.peak_widths(np.exp(2 * log_size), peaks, rel_height=0.5)[0]
    step = np.gradient(response.frequencies) if response.lines > 1 else np.ones(1)
    return peaks, np.asarray(widths * step[peaks])


def _resolution(response: FrequencyResponse) -> list[Finding]:
    """Look for resonances narrower than the lines resolve; only in estimates, which exact responses are not."""
    if response.averages is None and response.coherence is None:
        return []
    peaks, widths = bandwidths(response)
    if response.lines < 3 or peaks.size == 0:
        return []
    step = line_step(response)
    narrow = widths < _RESOLVED * step
    if not np.any(narrow):
        return []
    where = ", ".join(f"{response.frequencies[k]:.4g}" for k in peaks[narrow][:5])
    return [
        Finding(
            "short record",
            response.output_dofs,
            f"the resonances at {where} Hz are narrower than {_RESOLVED:.1f} lines of {step:.3g} Hz: within one over the line "
            "spacing their vibration does not decay to one per cent",
            "Measure longer, use longer segments, or an exponential window for hits.",
            tuple(float(f) for f in response.frequencies[peaks[narrow]]),
        )
    ]
