"""Responses of modes: sums over poles, shapes and participation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.channels import derivatives_between
from modalscope.model.checks import ComplexArray, DataError, RealArray, check_count, check_positive
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import to_discrete

if TYPE_CHECKING:
    from modalscope.model.modes import ModalModel

__all__ = ["frequency_response", "impulse_response"]


def impulse_response(
    modes: ModalModel, samples: int, sampling_rate: float | None, first_sample: int
) -> ImpulseResponse:
    """Return sum_j phi_j exp(s_j (k + first_sample) dt) l_j' and conjugates (see `ModalModel.impulse_response`)."""
    part = modes.known_participation("an impulse response")
    rate = _rate(modes, sampling_rate)
    steps = np.arange(check_count("samples", samples)) + first_sample
    decay = np.exp(np.outer(steps / rate, modes.poles)) * _weights(modes)
    values = np.einsum("kj,aj,jb->kab", decay, modes.shapes, part).real
    return ImpulseResponse(
        values=values,
        sampling_rate=rate,
        feedthrough=modes.feedthrough,
        kind="pulse" if modes.held_input else "dirac",
        first_sample=first_sample,
        quantity=modes.quantity,
        **modes.labelled(),
    )


def frequency_response(modes: ModalModel, frequencies: ArrayLike, residuals: bool) -> FrequencyResponse:
    """Return the sum over the modes, the direct term and the residuals (see `ModalModel.frequency_response`)."""
    f = np.asarray(frequencies, dtype=float)
    values = _modal_sum(modes, f)
    if modes.feedthrough is not None:
        values = values + modes.feedthrough
    if residuals and (modes.lower_residual is not None or modes.upper_residual is not None):
        p = 0 if modes.quantity is None else -derivatives_between(modes.quantity, "displacement")
        s = (2j * np.pi * f)[:, None, None]
        for residual, power in ((modes.lower_residual, p - 2), (modes.upper_residual, p)):
            if residual is not None:
                values = values + residual * s**power
    rate = 1 / modes.dt if modes.dt is not None and modes.held_input else None
    return FrequencyResponse(
        values=values, frequencies=f, quantity=modes.quantity, sampling_rate=rate, **modes.labelled()
    )


def _rate(modes: ModalModel, sampling_rate: float | None) -> float:
    """Return the sampling rate that is asked, or that of the identified system; a held input allows no other."""
    known = None if modes.dt is None else 1 / modes.dt
    rate = known if sampling_rate is None else check_positive("sampling_rate", sampling_rate)
    if rate is None:
        raise DataError("an impulse response was asked", "the modes are of a continuous system", "Give sampling_rate.")
    if modes.held_input and known is not None and not np.isclose(rate, known, rtol=1e-9):
        raise DataError(
            f"a pulse response at {rate:g} Hz was asked",
            f"the participation is that of an input held at {known:g} Hz",
            "Leave sampling_rate out.",
        )
    return rate


def _modal_sum(modes: ModalModel, f: RealArray) -> ComplexArray:
    """Return sum_j phi_j l_j' / (x - p_j) and conjugates on lines in Hz, (F, l, m), in the plane of the model."""
    part = modes.known_participation("a frequency response")
    sampled = modes.dt is not None and modes.held_input
    x = np.exp(2j * np.pi * f * modes.dt) if sampled and modes.dt is not None else 2j * np.pi * f
    poles = to_discrete(modes.poles, modes.dt) if sampled and modes.dt is not None else modes.poles
    direct = 1 / (x[:, None] - poles)
    pair = np.where(_weights(modes) == 2, 1.0, 0.0) / (x[:, None] - poles.conj())
    first = np.einsum("fj,aj,jb->fab", direct, modes.shapes, part, optimize=True)
    return np.asarray(first + np.einsum("fj,aj,jb->fab", pair, modes.shapes.conj(), part.conj(), optimize=True))


def _weights(modes: ModalModel) -> RealArray:
    """2 for a pole that stands for a conjugate pair, 1 for one that stands alone."""
    alone = np.array([kind in ("real", "nyquist", "zero") for kind in modes.kinds], dtype=bool)
    return np.where(alone | (modes.poles.imag == 0), 1.0, 2.0)
