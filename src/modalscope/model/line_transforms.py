"""Frequency responses in another quantity, and as samples."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from modalscope.model.channels import derivatives_between
from modalscope.model.checks import ComplexArray, DataError
from modalscope.model.impulse import ImpulseResponse

if TYPE_CHECKING:
    from modalscope.model.frequency import FrequencyResponse

__all__ = ["in_quantity", "inverse_transform"]


def in_quantity(response: FrequencyResponse, wanted: str) -> FrequencyResponse:
    """Return a response in another quantity (see `FrequencyResponse.as_quantity`)."""
    power = derivatives_between(response.quantity, wanted)
    if power < 0 and response.frequencies[0] == 0:
        raise DataError(
            f"the {response.quantity} as {wanted} was asked",
            "its first line lies at 0 Hz, where that divides by zero",
            "Leave that line out with band().",
        )
    factor = (2j * np.pi * response.frequencies) ** power
    variance = None if response.variance is None else response.variance * np.abs(factor[:, None, None]) ** 2
    note = f"{response.quantity} turned into {wanted} in the frequency domain"
    units = response.units if power == 0 else (("",) * len(response.output_dofs), response.units[1])
    return replace(
        response,
        values=response.values * factor[:, None, None],
        variance=variance,
        quantity=wanted,
        units=units,
        processing=(*response.processing, note),
    )


def inverse_transform(response: FrequencyResponse) -> ImpulseResponse:
    """Return the inverse Fourier transform of the lines (see `FrequencyResponse.to_impulse_response`)."""
    spectrum, step = _from_zero(response)
    held = response.sampling_rate is not None
    length = 2 * (spectrum.shape[0] - 1)
    rate = length * step
    if response.sampling_rate is not None:
        rate = response.sampling_rate
        length = round(rate / step)
        if abs(rate / step - length) > 1e-3:
            raise DataError(
                "the inverse transform of a sampled response needs lines that divide the sampling rate",
                f"{rate:g} Hz holds {rate / step:.6g} steps of {step:g} Hz",
                "Use a frequency-domain method (domain='z'), which takes any lines.",
            )
    samples = np.fft.irfft(spectrum, n=length, axis=0)
    note = (
        f"inverse transform of {response.lines} lines, {response.frequencies[0]:g} to {response.frequencies[-1]:g} Hz"
    )
    return ImpulseResponse(
        values=samples[1:] if held else samples[1:] * rate,
        feedthrough=samples[0],
        sampling_rate=rate,
        kind="pulse" if held else "dirac",
        first_sample=0 if held else 1,
        quantity=response.quantity,
        added_damping=response.added_damping,
        groups=response.groups,
        **response.labelled(),
    ).processed(note)


def _from_zero(response: FrequencyResponse) -> tuple[ComplexArray, float]:
    """Return values on all multiples of the lines' spacing from 0 Hz, zero below the band, and that spacing in Hz."""
    if response.lines < 2:
        raise DataError("an inverse transform needs a band of lines", "there is one line", "Measure more lines.")
    step = (response.frequencies[-1] - response.frequencies[0]) / (response.lines - 1)
    bins = response.frequencies / step
    whole = np.rint(bins).astype(int)
    if np.max(np.abs(bins - whole)) > 1e-3 or np.any(np.diff(whole) != 1):
        steps = np.diff(response.frequencies)
        raise DataError(
            "an inverse transform needs equally spaced lines on multiples of their spacing",
            f"they start at {response.frequencies[0]:g} Hz with steps from {steps.min():g} to {steps.max():g} Hz",
            "Use a frequency-domain method (domain='s' or 'z'), which takes any lines.",
        )
    spectrum = np.zeros((whole[-1] + 1, *response.values.shape[1:]), dtype=complex)
    spectrum[whole] = response.values
    return spectrum, float(step)
