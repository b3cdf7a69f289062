"""Responses rebuilt from modes, and how much of the measured ones they leave unexplained."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from modalscope.modal.basis import (
    basis_of_lines,
    basis_of_samples,
    fit_error,
    fit_participation,
    residual_powers,
    scaled_terms,
)
from modalscope.model.checks import Array, DataError
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.modes import ModalModel
from modalscope.model.response import Response, window_damping

__all__ = ["fit_of", "fitted_terms", "rebuilt", "window_damping"]


def rebuilt(response: Response, modes: ModalModel) -> Array:
    """Return the responses that the modes give on the lines or samples of the data, in the shape of its values.

    Raises
    ------
    DataError
        Modes with other channels than the data, or without participation.
    """
    added = window_damping(response)
    model = replace(modes, poles=modes.poles - added) if added else modes
    if isinstance(response, FrequencyResponse):
        values: Array = model.frequency_response(response.frequencies).values
    else:
        samples, rate, first = response.samples, response.sampling_rate, response.first_sample
        values = model.impulse_response(samples, rate, first_sample=first).values
    if values.shape != response.values.shape:
        (_, l, m), (_, outputs, inputs) = response.values.shape, values.shape
        raise DataError(
            "measured against rebuilt responses were asked",
            f"the data have {l} outputs and {m} inputs, the modes {outputs} and {inputs}",
            "Give the data that the modes were identified from, or select the same channels in both.",
        )
    return values


def fit_of(modes: ModalModel, response: Response) -> float:
    """Return norm(measured - rebuilt from the modes) / norm(measured) over all channels."""
    return fit_error(response.values, rebuilt(response, modes))[0]


def fitted_terms(response: Response, poles: Array, shapes: Array) -> dict[str, Any]:
    """Fit participation and, on lines, the residuals of the modes outside the band: fields of a `ModalModel`.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
    poles : array of complex, (n,)
        rad/s, as the modes have them.
    shapes : array of complex, (l, n)
    """
    poles = poles - window_damping(response)
    if isinstance(response, ImpulseResponse):
        participation, _ = fit_participation(basis_of_samples(response, poles), shapes)
        return {"participation": participation, "feedthrough": response.feedthrough}
    # a line at 0 Hz cannot carry the negative powers of the lower residual
    residuals = response.sampling_rate is None and response.frequencies[0] > 0 and response.lines > 8
    powers = residual_powers(response.quantity, residuals)
    participation, terms = fit_participation(basis_of_lines(response, poles, powers), shapes)
    if len(powers) == 1:
        return {"participation": participation, "feedthrough": terms[0]}
    lower, upper = scaled_terms(terms, powers, response.frequencies)
    return {"participation": participation, "lower_residual": lower, "upper_residual": upper}
