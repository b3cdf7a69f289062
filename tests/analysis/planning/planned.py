"""Random structures along a line, whose places differ in noise: tests of them, and what is known of their modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import modalscope as ms
from modalscope.numerics.checks import Array, RealArray

PLACES, MODES = 12, 5


@dataclass(frozen=True)
class Structure:
    """Poles (n,), real shapes (l, n) of unit modal mass, and the noise of each place (l,)."""

    poles: Array
    shapes: RealArray
    noise: RealArray

    @property
    def frequencies(self) -> RealArray:
        """Lines, Hz."""
        return np.linspace(0.5, np.abs(self.poles).max() / (2 * np.pi) + 3, 500)

    def modes(self, forces: list[int] | None = None) -> ms.ModalModel:
        """Return the modes, driven at some places; of a model where these are not given."""
        drive = None if forces is None else self.shapes[forces].T / (2j * self.poles.imag[:, None])
        return ms.ModalModel(
            poles=self.poles,
            shapes=self.shapes.astype(complex),
            participation=drive,
            output_dofs=labels(range(len(self.shapes))),
            input_dofs=() if forces is None else labels(forces),
            quantity="displacement",
        )

    def response(self, sensors: list[int], forces: list[int], times: Array | float, seed: int) -> ms.FrequencyResponse:
        """Return measured responses; `times` (sensors, forces): how often each was measured."""
        rng, s = np.random.default_rng([seed, 1]), 2j * np.pi * self.frequencies
        R = np.einsum("ok,ik->oik", self.shapes[sensors], self.shapes[forces]) / (2j * self.poles.imag)
        H = sum(
            np.einsum("oik,fk->foi", r, 1 / (s[:, None] - p))
            for r, p in ((R, self.poles), (R.conj(), self.poles.conj()))
        )
        level = self.noise[sensors, None] / np.sqrt(np.broadcast_to(times, (len(sensors), len(forces))))
        noise = level * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
        return ms.FrequencyResponse(
            values=H + noise,
            frequencies=self.frequencies,
            quantity="displacement",
            output_dofs=labels(sensors),
            input_dofs=labels(forces),
        )


def labels(places: object) -> tuple[str, ...]:
    """Return the labels of places."""
    return tuple(f"{k + 1}:+Z" for k in places)  # type: ignore[attr-defined]


def structure(seed: int, noise: float = 0.004) -> Structure:
    """Return a random structure of five modes at twelve places."""
    rng = np.random.default_rng(seed)
    w = 2 * np.pi * np.sort(np.cumsum(rng.uniform(1.2, 4, MODES)) + 2)
    zeta, x = rng.uniform(0.004, 0.02, MODES), np.arange(1, PLACES + 1) / PLACES
    waves = [np.sin((k + 0.5) * np.pi * x + rng.uniform(-0.3, 0.3)) for k in range(MODES)]
    shapes = np.array(waves).T + 0.15 * rng.standard_normal((PLACES, MODES))
    peak = np.max(np.abs(shapes[:, None] * shapes / (2 * zeta * w**2)))
    return Structure(
        w * (-zeta + 1j * np.sqrt(1 - zeta**2)), shapes, noise * peak * 10 ** rng.uniform(-0.5, 0.5, PLACES)
    )
