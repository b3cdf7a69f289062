"""Simulate a sine dwell on a structure whose springs harden: what a shaker test at several levels records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.records import Records, Signals
from modalscope.numerics.checks import RealArray

#: Steps of the integration between two samples.
_STEPS = 2


#: Where forces act and motion is measured.
_PLACES = ("1:+X", "2:+X")


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class HardeningRig:
    """Two equal masses on springs k x + k3 x^3 and dampers to the ground, joined by a spring, and a shaker at each.

    In phase both masses move as one: m x'' + c x' + k x + k3 x^3 = F.

    `mass`, `damping`, `stiffness`: m, c and k of each mass: kg, N s/m, N/m. `cubic`: k3, N/m^3; 0 for a linear rig. `coupling`: of the
    spring between the masses, N/m.
    """

    mass: float = 1.0
    damping: float = 0.6
    stiffness: float = 1000.0
    cubic: float = 1e6
    coupling: float = 800.0

    def backbone(self, amplitude: ArrayLike) -> RealArray:
        """Return the resonance of the mode in phase, Hz, at amplitudes in m: sqrt((k + 3/4 k3 a^2) / m) / 2 pi, by harmonic balance."""
        a = np.asarray(amplitude, float)
        return np.asarray(np.sqrt((self.stiffness + 0.75 * self.cubic * a**2) / self.mass) / (2 * np.pi))

    def dwell(
        self,
        forces: ArrayLike,
        frequencies: ArrayLike,
        *,
        duration: float = 40.0,
        sampling_rate: float = 100.0,
        noise: float = 0.0,
        seed: int = 0,
    ) -> Records:
        """Return a run for every dwell: both shakers in phase at one frequency, from rest; displacements and forces.

        `forces`, `frequencies` (R,): amplitude of each shaker (N) and frequency (Hz) of each dwell. `duration`, `sampling_rate`: of
        each run, s and Hz. `noise`: of each displacement, relative to its root mean square. `seed`: of the noise.
        """
        F, f = np.asarray(forces, float), np.asarray(frequencies, float)
        rng, h = np.random.default_rng(seed), 1 / sampling_rate / _STEPS
        state, found = np.zeros((2, f.size, 2)), np.empty((round(duration * sampling_rate), f.size, 2))
        for k in range(len(found)):
            found[k] = state[0]
            for i in range(_STEPS):
                state = self._stepped(state, (k * _STEPS + i) * h, h, F, f)
        times = np.arange(len(found)) / sampling_rate
        runs = []
        for r in range(f.size):
            y = found[:, r] + noise * found[:, r].std(axis=0) * rng.standard_normal((len(found), 2))
            u = np.repeat(F[r] * np.sin(2 * np.pi * f[r] * times)[:, None], 2, axis=1)
            run = Signals(
                outputs=y,
                inputs=u,
                sampling_rate=sampling_rate,
                output_dofs=_PLACES,
                input_dofs=_PLACES,
                quantities=("displacement", "displacement"),
            )
            runs.append(run)
        return Records(runs=tuple(runs))

    def _stepped(self, state: RealArray, time: float, h: float, F: RealArray, f: RealArray) -> RealArray:
        """Return displacements and velocities (2, R, 2) a step later, by Runge and Kutta's rule of fourth order."""

        def slope(z: RealArray, t: float) -> RealArray:
            x, v = z
            force = (F * np.sin(2 * np.pi * f * t))[:, None] - self.coupling * (x - x[:, ::-1])
            return np.stack([v, (force - self.damping * v - self.stiffness * x - self.cubic * x**3) / self.mass])

        a = slope(state, time)
        b = slope(state + h / 2 * a, time + h / 2)
        c = slope(state + h / 2 * b, time + h / 2)
        d = slope(state + h * c, time + h)
        return np.asarray(state + h / 6 * (a + 2 * b + 2 * c + d))
