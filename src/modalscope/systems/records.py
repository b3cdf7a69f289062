"""Simulate records of a sampled model under given or white forces, with noise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.statespace import StateSpace
from modalscope.numerics.arguments import plainly
from modalscope.numerics.checks import Array, RealArray, check_count, check_number, real_array
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import check_fits

# Measurement noise: white, a fraction of each channel's RMS.

#: What makes random numbers repeatable; None draws new ones each time.
Seed = int | np.random.Generator | None

Noisy = TypeVar("Noisy", ImpulseResponse, FrequencyResponse, Signals)


def generator(seed: Seed) -> np.random.Generator:
    """Return the random numbers of a seed, or raise when it is not a whole number, a generator or None."""
    if seed is not None and not isinstance(seed, np.random.Generator):
        check_count("seed", seed, least=0)
    return np.random.default_rng(seed)


def white_noise(values: Array, fraction: float, rng: np.random.Generator, axis: int = 0) -> Array:
    """Return Gaussian noise of the RMS `fraction` times that of `values` along `axis`; circular when values are complex."""
    if not (isinstance(fraction, int | float | np.number) and 0 <= fraction < np.inf):
        asked = "noise needs a fraction of the channel's RMS, 0 or more"
        raise DataError(asked, f"it is {fraction!r}", "Give 0.01 for 40 dB.")
    scale = fraction * np.sqrt(np.mean(np.abs(values) ** 2, axis=axis, keepdims=True))
    if values.dtype.kind == "c":
        return np.asarray(
            scale / np.sqrt(2) * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
        )
    return np.asarray(scale * rng.standard_normal(values.shape))


@plainly
def add_noise(data: Noisy, fraction: float, seed: Seed = None) -> Noisy:
    """Return a response or record with white noise on every channel, as a fraction of the channel's RMS.

    Parameters
    ----------
    data : ImpulseResponse, FrequencyResponse or Signals
        Of a record, the outputs get noise.
    fraction : float
        Noise RMS over signal RMS of each channel: 10^(-SNR / 20), so 0.01 is 40 dB. Complex responses get it in equal
        parts on the real and the imaginary part.
    seed : int or numpy Generator, optional
        Makes the noise repeatable.

    Examples
    --------
    >>> clean = Signals(outputs=np.ones((1000, 1)), sampling_rate=1.0)
    >>> noisy = add_noise(clean, 0.1, seed=0)
    >>> round(float(np.std(noisy.outputs)), 1)
    0.1
    """
    rng = generator(seed)
    check_number("noise", fraction)
    note = f"white noise of {100 * fraction:g} % of each channel's RMS added"
    if isinstance(data, Signals):
        return replace(data, outputs=data.outputs + white_noise(data.outputs, fraction, rng, axis=-2)).processed(note)
    return replace(data, values=data.values + white_noise(data.values, fraction, rng)).processed(note)


#: "white", "ambient", or forces of shape (samples, inputs) or (runs, samples, inputs).
Inputs = str | ArrayLike


def simulate(
    model: StateSpace,
    *,
    inputs: Inputs,
    forces: int,
    samples: int | None,
    runs: int,
    start: str | None,
    noise: float,
    input_noise: float,
    process_noise: float,
    seed: Seed,
    quantity: str,
    labels: dict[str, Any],
) -> Signals:
    """Return the record of a sampled model whose first `forces` inputs are the forces and the others process noise.

    The parameters are those of `Structure.simulate`.
    """
    rng = generator(seed)
    ambient = isinstance(inputs, str) and inputs == "ambient"
    start = check_choice("start", start or ("stationary" if ambient else "rest"), ("rest", "stationary"))
    applied = _forces(inputs, forces, samples, check_count("runs", runs), rng)
    hidden = process_noise * rng.standard_normal((*applied.shape[:2], model.B.shape[1] - forces))
    driven = np.concatenate([applied, hidden], axis=2)
    scale = np.concatenate([np.ones(forces), np.full(hidden.shape[2], process_noise)])
    states = np.zeros((applied.shape[0], model.order))
    if start == "stationary":
        states = rng.standard_normal(states.shape) @ _stationary_root(model, scale).T
    outputs = np.stack([model.simulate(u, x) for u, x in zip(driven, states, strict=True)])
    outputs = outputs + white_noise(outputs, noise, rng, axis=1)
    measured = None if ambient else applied + white_noise(applied, input_noise, rng, axis=1)
    if outputs.shape[0] == 1:
        outputs, measured = outputs[0], None if measured is None else measured[0]
    rate = 1 / model.dt if model.dt is not None else np.nan
    return Signals(
        outputs=outputs, inputs=measured, sampling_rate=rate, quantities=(quantity,) * outputs.shape[-1], **labels
    )


def _forces(inputs: Inputs, count: int, samples: int | None, runs: int, rng: np.random.Generator) -> RealArray:
    """Return forces of shape (runs, samples, count)."""
    if isinstance(inputs, str):
        check_choice("inputs", inputs, ("white", "ambient"))
        if samples is None:
            raise DataError("a record needs a length", "none is given", "Give duration in seconds, or samples.")
        length = check_count("samples", samples, least=2)
        check_fits(f"a record of {length} samples", 8.0 * runs * length * count, "Give fewer samples or runs.")
        return rng.standard_normal((runs, length, count))
    given = real_array("inputs", inputs, "(samples, inputs) or (runs, samples, inputs)", (2, 3))
    given = given[None] if given.ndim == 2 else given
    if given.shape[2] != count:
        asked, have = f"forces on {count} degrees of freedom:", f"inputs has {given.shape[2]} columns"
        raise DataError(asked, have, "Give one column for each, or name them by `at`.")
    if samples not in (None, given.shape[1]) or runs not in (1, given.shape[0]):
        have = f"the forces have samples={given.shape[1]}, runs={given.shape[0]}"
        change = "Leave samples, duration and runs out: the forces give them."
        raise DataError(f"samples={samples}, runs={runs}:", have, change)
    return given


def _stationary_root(model: StateSpace, scale: RealArray) -> RealArray:
    """Return R with R R' = P, where P = A P A' + B diag(scale^2) B' is the state's covariance under white forces."""
    radius = float(np.abs(model.poles).max())
    if radius >= 1:
        have = f"the model has an unstable pole (modulus {radius:.6g} in the z-plane)"
        raise DataError("a stationary start:", have, 'Give damping and supports, or start="rest".')
    B = model.B * scale
    values, vectors = np.linalg.eigh(_stationary_covariance(model.A, B @ B.T))
    return np.asarray(vectors * np.sqrt(np.clip(values, 0, None)))


def _stationary_covariance(A: RealArray, Q: RealArray) -> RealArray:
    """Return P = sum_k A^k Q A'^k by doubling: P <- P + A P A', A <- A A takes in twice as many terms each time.

    No equation is solved: a pole within 1e-6 of the circle, as sampled thousandfold too fast, costs a few rounds and no digit.
    """
    P, step = Q, Q
    while np.abs(step).max() > np.finfo(float).eps * np.abs(P).max():
        step = A @ P @ A.T
        P, A = P + step, A @ A
    return np.asarray((P + P.T) / 2)
