"""Model structures M q'' + D q' + K q = f: assembly, modes, responses and records (Eqs. 1-8)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike

from modalscope.data.geometry import DofLike, Geometry, check_labels, indices_of
from modalscope.data.modes import ModalModel
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.statespace import INPUTS, StateSpace
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, RealArray, check_positive, freeze, real_array, stays_locked
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.systems.modal import modal_model, undamped_modes
from modalscope.systems.records import Inputs, Seed, add_noise, simulate

# From M, D, K to a state-space model and to frequency responses (Eqs. 1-4).


def state_model(
    M: RealArray, D: RealArray, K: RealArray, rows: list[int], columns: list[int], quantity: str
) -> StateSpace:
    """Return x' = [[0, I], [-M^-1 K, -M^-1 D]] x + [0; M^-1 B_f] u with outputs `rows` of the quantity (Eqs. 2-4)."""
    n = M.shape[0]
    moved = sla.cho_solve(sla.cho_factor(M), np.hstack([K, D, np.eye(n)[:, columns]]))
    lower, force = -moved[:, : 2 * n], moved[:, 2 * n :]
    C = {"displacement": np.eye(n, 2 * n), "velocity": np.eye(n, 2 * n, n), "acceleration": lower}[quantity][rows]
    direct = force[rows] if quantity == "acceleration" else np.zeros((len(rows), len(columns)))
    A = np.vstack([np.eye(n, 2 * n, n), lower])
    return StateSpace(A=A, B=np.vstack([np.zeros_like(force), force]), C=C, D=direct)


def dynamic_response(
    M: RealArray, D: RealArray, K: RealArray, rows: list[int], columns: list[int], quantity: str, lines: RealArray
) -> ComplexArray:
    """Return s^p (s^2 M + s D + K)^-1 at s = 2 pi j f as (lines, rows, columns), p = 0, 1, 2 by the quantity."""
    values = np.empty((lines.size, len(rows), len(columns)), dtype=complex)
    force = np.eye(M.shape[0])[:, columns]
    for k, s in enumerate(2j * np.pi * lines):
        try:
            motion = np.linalg.solve(K + s * (D + s * M), force)
        except np.linalg.LinAlgError:
            asked, change = (f"the frequency response at {lines[k]:g} Hz:", "Leave that line out, or give damping.")
            raise DataError(asked, "the structure has an undamped pole there", change) from None
        values[k] = s ** QUANTITIES[quantity] * motion[rows]
    return values


# Mass, damping and stiffness matrices on named degrees of freedom (Eq. 1).

#: A choice of degrees of freedom: labels, or indices counted from zero.
Dofs = Iterable[DofLike] | DofLike | None

UNITS = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Assembly:
    """Matrices of M q'' + D q' + K q = f, checked, and which degrees of freedom are measured and forced.

    The parameters are those of `Structure`, which adds what is measured on them.
    """

    mass: RealArray
    stiffness: RealArray
    damping: RealArray = None  # type: ignore[assignment]
    outputs: tuple[int, ...] = None  # type: ignore[assignment]
    inputs: tuple[int, ...] = None  # type: ignore[assignment]
    dofs: tuple[str, ...] = None  # type: ignore[assignment]
    dt: float | None = None
    geometry: Geometry | None = None
    name: str = "structure"

    def __post_init__(self) -> None:
        M = real_array("mass", self.mass, "(dofs, dofs)", 2)
        given = {
            "mass": M,
            "stiffness": self.stiffness,
            "damping": np.zeros(M.shape) if self.damping is None else self.damping,
        }
        matrices = {name: _symmetric(name, values, M.shape[0]) for name, values in given.items()}
        if np.linalg.eigvalsh(M)[0] <= 0:
            have, change = "it has an eigenvalue at or below zero", "Give every degree of freedom a mass."
            raise DataError("mass needs a positive definite matrix", have, change)
        labels = self.dofs if self.dofs is not None else tuple(f"{i + 1}:+X" for i in range(M.shape[0]))
        dofs = check_labels("dofs", labels, M.shape[0], "q")
        everything = tuple(range(len(dofs)))
        freeze(
            self,
            **matrices,
            dofs=dofs,
            outputs=everything if self.outputs is None else tuple(indices_of("output", self.outputs, dofs)),
            inputs=everything if self.inputs is None else tuple(indices_of("input", self.inputs, dofs)),
            dt=None if self.dt is None else check_positive("dt", self.dt),
        )

    @property
    def degrees(self) -> int:
        """Number of degrees of freedom, n."""
        return int(self.mass.shape[0])

    def undamped_modes(self) -> tuple[RealArray, RealArray]:
        """Return the undamped natural frequencies (rad/s, (n,)) and the shapes of unit modal mass ((n, n), as columns)."""
        return undamped_modes(self.mass, self.stiffness)

    def _positions(self, outputs: Dofs, inputs: Dofs) -> tuple[list[int], list[int]]:
        rows = list(self.outputs) if outputs is None else indices_of("output", outputs, self.dofs)
        columns = list(self.inputs) if inputs is None else indices_of("input", inputs, self.dofs)
        return rows, columns

    def _interval(self, sampling_rate: float | None) -> float:
        if sampling_rate is not None:
            return 1 / check_positive("sampling_rate", sampling_rate)
        if self.dt is None:
            raise DataError("a sampled response:", f"{self.name} has no sampling interval", "Give sampling_rate.")
        return self.dt

    def _labels(self, rows: list[int], columns: list[int], quantity: str) -> dict[str, Any]:
        return {
            "output_dofs": tuple(self.dofs[i] for i in rows),
            "input_dofs": tuple(self.dofs[i] for i in columns),
            "units": (UNITS[quantity], "N"),
            "geometry": self.geometry,
            "processing": (f"simulated: {self.name}",),
        }


def initial_state(degrees: int, displacement: ArrayLike | None, velocity: ArrayLike | None) -> RealArray:
    """Return [q; q'], (2 n,), of the displacements and velocities at the start; zero where none are given."""
    start = np.zeros(2 * degrees)
    for name, values, part in (
        ("displacement", displacement, slice(0, degrees)),
        ("velocity", velocity, slice(degrees, 2 * degrees)),
    ):
        if values is not None:
            array = real_array(name, values, "(dofs,)", 1)
            if array.size != degrees:
                asked = f"{name} needs {degrees} entries, one per degree of freedom"
                raise DataError(asked, f"it has {array.size}", "Give zeros where nothing moves.")
            start[part] = array
    return start


def _symmetric(name: str, values: ArrayLike, size: int) -> RealArray:
    matrix = real_array(name, values, "(dofs, dofs)", 2)
    if matrix.shape != (size, size):
        have, change = f"it has {matrix.shape}", "Give square matrices of one size."
        raise DataError(f"{name} needs shape {(size, size)}", have, change)
    if np.abs(matrix - matrix.T).max(initial=0) > 1e-9 * np.abs(matrix).max(initial=0):
        change = "For other systems use StateSpace(A=..., B=..., C=..., D=...)."
        raise DataError(f"{name} needs a symmetric matrix", "it is not", change)
    return matrix


@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Structure(Assembly):
    """A linear structure with n degrees of freedom, M q'' + D q' + K q = f (Eq. 1).

    Parameters
    ----------
    mass : array, (n, n)
        M, symmetric and positive definite, kg.
    stiffness : array, (n, n)
        K, symmetric, N/m.
    damping : array, (n, n), optional
        D, symmetric, N s/m; zero by default.
    outputs, inputs : sequence of int or labels, optional
        Degrees of freedom that are measured and forced unless a call says otherwise; all by default.
    dofs : sequence of labels, optional
        Names of all degrees of freedom; `1:+X`, `2:+X`, ... by default.
    dt : float, optional
        Sampling interval in seconds that suits the structure, used where a call gives none.
    geometry : Geometry, optional
        Where the degrees of freedom are.
    name : str
        What the structure is called.

    Raises
    ------
    DataError
        Matrices that do not fit, are not symmetric, or a mass matrix that is not positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> s = Structure(mass=[[2.0]], stiffness=[[200.0]], damping=[[0.8]])
    >>> modes = s.modes()
    >>> print(modes.frequencies[0] * 2 * np.pi, modes.damping_ratios[0])
    10.0 0.02
    """

    @named(quantity=tuple(QUANTITIES), input=INPUTS)
    def state_space(
        self,
        *,
        outputs: Dofs = None,
        inputs: Dofs = None,
        quantity: str = "displacement",
        dt: float | None = None,
        input: str = "held",
    ) -> StateSpace:
        """Return the model of state x = [q; q'] (Eqs. 2-4), continuous or exactly sampled (Eqs. 5-8).

        A = [[0, I], [-M^-1 K, -M^-1 D]], B = [0; M^-1 B_f]. Accelerations have C = C_a [-M^-1 K, -M^-1 D] and the direct
        term C_a M^-1 B_f.

        Parameters
        ----------
        outputs, inputs : labels or indices, optional
            Measured and forced degrees of freedom; the structure's own by default.
        quantity : {"displacement", "velocity", "acceleration"}
            What is measured.
        dt : float, optional
            Sampling interval in seconds; None for the continuous model.
        input : {"held", "dirac"}
            What the force does between samples (see `StateSpace.to_discrete`).
        """
        rows, columns = self._positions(outputs, inputs)
        model = state_model(self.mass, self.damping, self.stiffness, rows, columns, quantity)
        return model if dt is None else model.to_discrete(dt, input)

    @named(quantity=tuple(QUANTITIES))
    def modes(self, *, outputs: Dofs = None, inputs: Dofs = None, quantity: str = "displacement") -> ModalModel:
        """Return the exact modes: poles, shapes of unit modal mass, and participation for the quantity.

        The sum over the modes, with the direct term, is the exact frequency response; motions of the rigid body, whose
        double pole at zero has no modal sum, are its `lower_residual`.

        Parameters
        ----------
        outputs, inputs, quantity
            As in `state_space`.

        Raises
        ------
        DataError
            A critically damped mode, or another pole that lacks an eigenvector.
        """
        rows, columns = self._positions(outputs, inputs)
        return modal_model(
            self.mass, self.damping, self.stiffness, rows, columns, quantity, self._labels(rows, columns, quantity)
        )

    @named(quantity=tuple(QUANTITIES))
    def frequency_response(
        self,
        frequencies: ArrayLike,
        *,
        outputs: Dofs = None,
        inputs: Dofs = None,
        quantity: str = "displacement",
        noise: float | None = None,
        seed: Seed = None,
    ) -> FrequencyResponse:
        """Return (j w)^p (K - w^2 M + j w D)^-1 on lines in Hz, p = 0, 1, 2 for displacement, velocity, acceleration.

        Parameters
        ----------
        frequencies : array, (F,)
            Lines in Hz.
        outputs, inputs, quantity
            As in `state_space`.
        noise : float, optional
            White noise on every channel, as a fraction of the channel's RMS (0.01 is 40 dB).
        seed : int or numpy Generator, optional
            Makes the noise repeatable.
        """
        rows, columns = self._positions(outputs, inputs)
        lines = real_array("frequencies", frequencies, "(lines,)", 1)
        values = dynamic_response(self.mass, self.damping, self.stiffness, rows, columns, quantity, lines)
        response = FrequencyResponse(
            values=values, frequencies=lines, quantity=quantity, **self._labels(rows, columns, quantity)
        )
        return response if noise is None else add_noise(response, noise, seed)

    @named(quantity=tuple(QUANTITIES))
    def impulse_response(
        self,
        samples: int,
        *,
        sampling_rate: float | None = None,
        outputs: Dofs = None,
        inputs: Dofs = None,
        quantity: str = "displacement",
        input: str = "held",
        noise: float | None = None,
        seed: Seed = None,
    ) -> ImpulseResponse:
        """Return the Markov parameters of the exactly sampled structure.

        A Dirac impulse's direct term is not a number, so that of an acceleration is left out there.

        Parameters
        ----------
        samples : int
        sampling_rate : float, optional
            Samples per second; 1 / `dt` of the structure by default.
        outputs, inputs, quantity, input
            As in `state_space`.
        noise, seed
            As in `frequency_response`.
        """
        rows, columns = self._positions(outputs, inputs)
        dt = self._interval(sampling_rate)
        model = self.state_space(outputs=rows, inputs=columns, quantity=quantity, dt=dt, input=input)
        kind = "pulse" if input == "held" else "dirac"
        feedthrough = model.D if input == "held" else None
        labels = self._labels(rows, columns, quantity)
        response = model.impulse_response(samples, kind=kind, feedthrough=feedthrough, quantity=quantity, **labels)
        return response if noise is None else add_noise(response, noise, seed)

    @named(quantity=tuple(QUANTITIES))
    def free_decay(
        self,
        samples: int,
        *,
        displacement: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        sampling_rate: float | None = None,
        outputs: Dofs = None,
        quantity: str = "displacement",
    ) -> ImpulseResponse:
        """Return the decay from initial displacements and velocities, values[k] at t = k dt, as one input's response.

        Parameters
        ----------
        samples : int
        displacement, velocity : array, (n,), optional
            Of every degree of freedom at the start; zero by default.
        sampling_rate : float, optional
            Samples per second; 1 / `dt` of the structure by default.
        outputs, quantity
            As in `state_space`.
        """
        start = initial_state(self.degrees, displacement, velocity)
        rows, _ = self._positions(outputs, None)
        model = self.state_space(outputs=rows, inputs=[0], quantity=quantity, dt=self._interval(sampling_rate))
        decay = StateSpace(A=model.A, B=start[:, None], C=model.C, dt=model.dt)
        labels = {**self._labels(rows, [], quantity), "input_dofs": ("start",), "units": UNITS[quantity]}
        return decay.impulse_response(samples, kind="free decay", feedthrough=None, quantity=quantity, **labels)

    @named(quantity=tuple(QUANTITIES))
    def simulate(
        self,
        *,
        inputs: Inputs = "white",
        at: Dofs = None,
        duration: float | None = None,
        samples: int | None = None,
        sampling_rate: float | None = None,
        outputs: Dofs = None,
        quantity: str = "acceleration",
        runs: int = 1,
        start: str | None = None,
        noise: float = 0.0,
        input_noise: float = 0.0,
        process_noise: float = 0.0,
        seed: Seed = 0,
    ) -> Signals:
        """Return a record of the exactly sampled structure under held forces.

        Parameters
        ----------
        inputs : {"white", "ambient"} or array, (N, m) or (R, N, m)
            White forces of 1 N RMS that are recorded; the same, not recorded; or forces of your own, recorded.
        at : labels or indices, optional
            Where the forces act: the structure's inputs by default; every degree of freedom when ambient.
        duration, samples : float or int
            Length of a run, in seconds or samples; with forces of your own, theirs.
        sampling_rate : float, optional
            Samples per second; 1 / `dt` of the structure by default.
        outputs, quantity
            What is measured.
        runs : int
            Number of independent runs.
        start : {"rest", "stationary"}, optional
            State at the first sample: at rest, or drawn from the state's own distribution under the white forces
            (the default when ambient).
        noise, input_noise : float
            White noise on the outputs and the recorded inputs, as a fraction of each channel's RMS.
        process_noise : float
            White forces in N RMS on every degree of freedom that are never recorded.
        seed : int or numpy Generator, optional
            Makes the record repeatable; None draws a new one each time.

        Raises
        ------
        DataError
            No length, no sampling rate, forces that do not fit, or a stationary start of an unstable structure.
        """
        ambient = isinstance(inputs, str) and inputs == "ambient"
        rows, columns = self._positions(outputs, range(self.degrees) if ambient and at is None else at)
        dt = self._interval(sampling_rate)
        count = samples if duration is None else round(duration / dt)
        driven = columns + (list(range(self.degrees)) if process_noise else [])
        return simulate(
            self.state_space(outputs=rows, inputs=driven, quantity=quantity, dt=dt),
            inputs=inputs,
            forces=len(columns),
            samples=count,
            runs=runs,
            start=start,
            noise=noise,
            input_noise=input_noise,
            process_noise=process_noise,
            seed=seed,
            quantity=quantity,
            labels=self._labels(rows, [] if ambient else columns, quantity),
        )
