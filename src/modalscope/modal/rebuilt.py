"""Responses rebuilt from modes, and how much of the measured ones they leave unexplained."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.blocks.matrix import DataMatrix
from modalscope.modal.eigenmodes import Eigenmodes
from modalscope.modal.heard import heard_lines
from modalscope.model.checks import Array, DataError, RealArray
from modalscope.model.modes import ModalModel
from modalscope.model.response import Response

__all__ = ["fit_error", "fit_error_heard", "fit_error_of", "fit_of", "modal_model", "rebuilt"]


def fit_error(measured: Array, rebuilt: Array) -> tuple[float, RealArray]:
    """Return norm(measured - rebuilt) / norm(measured), in all and per channel (l, m)."""
    return fit_error_of([(measured, rebuilt)])


def fit_error_of(pieces: Iterable[tuple[Array, Array]]) -> tuple[float, RealArray]:
    """Return the fit error of measured and rebuilt values that come some lines or samples after the other: sums of squares add up."""
    left: Array | float = 0.0
    all_: Array | float = 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for measured, rebuilt in pieces:
            left = left + _squares(measured - rebuilt)
            all_ = all_ + _squares(measured)
            del rebuilt  # before the next piece is made
        whole = np.sqrt(np.sum(left) / np.sum(all_))
        channel = np.sqrt(left / all_)
    return float(whole), np.asarray(channel)


def _squares(values: Array) -> RealArray:
    """Return the sum of the squares of every channel, without an array of the values' size."""
    parts = (values.real, values.imag) if np.iscomplexobj(values) else (values,)
    return np.asarray(sum(np.einsum("k...,k...->...", part, part) for part in parts))


def rebuilt(response: Response, modes: ModalModel) -> Array:
    """Return the responses that the modes give on the lines or samples of the data, in the shape of its values.

    Raises
    ------
    DataError
        Modes with other channels than the data, or without participation.
    """
    added = response.added_damping
    model = replace(modes, poles=modes.poles - added) if added else modes
    values: Array = response.of_modes(model).values
    if values.shape != response.values.shape:
        (_, l, m), (_, outputs, inputs) = response.values.shape, values.shape
        raise DataError(
            "measured against rebuilt responses were asked",
            f"the data have {l} outputs and {m} inputs, the modes {outputs} and {inputs}",
            "Give the data that the modes were identified from, or select the same channels in both.",
        )
    return values


def fit_of(modes: ModalModel, response: Response) -> float:
    """Return norm(measured - rebuilt from the modes) / norm(measured) over all channels; lines of noise alone count not (`heard_lines`)."""
    return fit_error_heard(response, rebuilt(response, modes))[0]


def fit_error_heard(response: Response, fitted: Array) -> tuple[float, RealArray]:
    """Return the fit error of rebuilt values, in all and per channel (l, m), over the lines that hold more than noise."""
    heard = heard_lines(response)
    if heard.all():
        return fit_error(response.values, fitted)
    return fit_error(response.values[heard], fitted[heard])


def modal_model(matrix: DataMatrix, modal: Eigenmodes, indicators: Mapping[str, Array]) -> ModalModel:
    """Wrap the modal form of one order, with the damping of an exponential window taken off the poles."""
    response = matrix.judged
    terms: dict[str, Any] = {"feedthrough": modal.direct, **response.named_terms(modal.fit.terms, modal.fit.powers)}
    return ModalModel(
        poles=modal.poles + response.added_damping,
        shapes=modal.shapes,
        participation=response.of_inputs(modal.participation),
        quantity=response.quantity,
        dt=matrix.dt,
        held_input=response.held_input,
        indicators=dict(indicators),
        **terms,
        **response.labelled(),
    )
