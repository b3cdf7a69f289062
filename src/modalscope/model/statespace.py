"""State-space models x' = A x + B u, y = C x + D u, continuous or sampled (Eqs. 1-16)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike

from modalscope.model.checks import (
    Array,
    ComplexArray,
    DataError,
    RealArray,
    check_choice,
    check_count,
    check_positive,
    freeze,
    real_array,
)
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import to_continuous

__all__ = ["INPUTS", "StateSpace"]

#: What the input does between samples: it is held (zero-order hold), or comes in sampled Dirac impulses (they differ, Eq. 8).
INPUTS = ("held", "dirac")


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class StateSpace:
    """A linear model with n states, m inputs and l outputs.

    Parameters
    ----------
    A : array, (n, n)
    B : array, (n, m)
    C : array, (l, n)
    D : array, (l, m), optional
        Direct term; zero by default.
    dt : float, optional
        Sampling interval in seconds; None for a continuous model.

    Raises
    ------
    DataError
        Matrices whose shapes do not fit, NaN or infinite entries.

    Examples
    --------
    >>> ss = StateSpace(A=[[0, 1], [-4, -0.2]], B=[[0], [1]], C=[[1, 0]])
    >>> ss.poles.round(4)
    array([-0.1+1.9975j, -0.1-1.9975j])
    >>> ss.to_discrete(0.1).to_continuous().A.round(10)
    array([[ 0. ,  1. ],
           [-4. , -0.2]])
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray = None  # type: ignore[assignment]
    dt: float | None = None

    def __post_init__(self) -> None:
        A = real_array("A", self.A, "(states, states)", 2)
        B = real_array("B", self.B, "(states, inputs)", 2)
        C = real_array("C", self.C, "(outputs, states)", 2)
        D = real_array("D", np.zeros((C.shape[0], B.shape[1])) if self.D is None else self.D, "(outputs, inputs)", 2)
        n = A.shape[0]
        if A.shape != (n, n) or B.shape[0] != n or C.shape[1] != n or D.shape != (C.shape[0], B.shape[1]):
            raise DataError(
                "a state-space model needs A (n, n), B (n, m), C (l, n) and D (l, m)",
                f"the shapes are A {A.shape}, B {B.shape}, C {C.shape}, D {D.shape}",
                "Correct the matrix that does not fit.",
            )
        freeze(self, A=A, B=B, C=C, D=D, dt=None if self.dt is None else check_positive("dt", self.dt))

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    @property
    def poles(self) -> ComplexArray:
        """Eigenvalues of A: rad/s for a continuous model, on the z-plane for a sampled one."""
        return np.asarray(np.linalg.eigvals(self.A), dtype=np.complex128)

    @property
    def continuous_poles(self) -> ComplexArray:
        """The poles in rad/s, whatever the model."""
        return self.poles if self.dt is None else to_continuous(self.poles, self.dt)

    def to_discrete(self, dt: float, input: str = "held") -> StateSpace:
        """Return the exact sampled model: A = exp(Ac dt), and B by Eq. 8.

        Parameters
        ----------
        dt : float
            Sampling interval, seconds.
        input : {"held", "dirac"}
            Held between samples, B = integral of exp(Ac t) Bc over one step; or a Dirac impulse at each sample, B = Bc
            (then Y(k) = C A^k B is the impulse response at t = k dt, from t = 0+; its direct term is not a number).
        """
        self._need("to_discrete", continuous=True)
        check_positive("dt", dt)
        check_choice("input", input, INPUTS)
        if input == "dirac":
            return StateSpace(A=sla.expm(self.A * dt), B=self.B, C=self.C, D=self.D, dt=dt)
        n, m = self.B.shape
        # exp([[A, B], [0, 0]] dt) = [[exp(A dt), integral exp(A t) B], [0, I]] holds for singular A too
        block = sla.expm(np.block([[self.A, self.B], [np.zeros((m, n + m))]]) * dt)
        return StateSpace(A=block[:n, :n], B=block[:n, n:], C=self.C, D=self.D, dt=dt)

    def to_continuous(self, input: str = "held") -> StateSpace:
        """Return the continuous model whose exact sampling this is; the inverse of `to_discrete`.

        The logarithm is taken of the eigenvalues, never of the matrix. Frequencies above half the sampling rate cannot
        be told from their aliases below it.

        Raises
        ------
        DataError
            A real pole at or below zero has no real logarithm.
        """
        self._need("to_continuous", continuous=False)
        assert self.dt is not None
        check_choice("input", input, INPUTS)
        z, vectors = np.linalg.eig(self.A)
        bad = (np.abs(z.imag) <= 1e-13 * np.abs(z)) & (z.real <= 0)
        if bad.any():
            raise DataError(
                "a real continuous model was asked",
                f"{int(bad.sum())} poles of the sampled one lie on the real axis at or below zero ({', '.join(f'{v:.3g}' for v in z[bad].real[:4])})",
                "Lower the order, or remove those states first; their poles are at the Nyquist frequency and carry no mode.",
            )
        s = to_continuous(z, self.dt)
        A = _similar(vectors, s)
        if input == "dirac":
            return StateSpace(A=A, B=self.B, C=self.C, D=self.D)
        # held: B = integral exp(s t) dt Bc = (z - 1) / s Bc, with the limit dt at s = 0
        gain = np.divide(s, z - 1, out=np.full_like(s, 1 / self.dt), where=np.abs(z - 1) > 1e-15)
        return StateSpace(A=A, B=_similar(vectors, gain) @ self.B, C=self.C, D=self.D)

    def markov_parameters(self, samples: int) -> RealArray:
        """Return Y(k) = C A^k B, k = 0 ... samples - 1, as (samples, l, m) (Eq. 11)."""
        self._need("markov_parameters", continuous=False)
        values = np.empty((check_count("samples", samples), self.C.shape[0], self.B.shape[1]))
        state = np.array(self.B)
        for k in range(samples):
            values[k] = self.C @ state
            state = self.A @ state
        return values

    def impulse_response(self, samples: int, **channels: Any) -> ImpulseResponse:
        """Return the Markov parameters of a sampled model as a pulse response, with its direct term.

        Keyword arguments are those of `ImpulseResponse` (labels, units, kind ...).
        """
        values = self.markov_parameters(samples)
        assert self.dt is not None
        return ImpulseResponse(
            **{"values": values, "sampling_rate": 1 / self.dt, "feedthrough": self.D, "kind": "pulse", **channels}
        )

    def transfer(self, points: ArrayLike) -> ComplexArray:
        """Return D + C (x I - A)^-1 B at complex points x (rad/s, or on the z-plane), as (points, l, m) (Eq. 75)."""
        x = np.atleast_1d(np.asarray(points, dtype=complex))
        # the Hessenberg form would serve many points; n is small and the points are solved in one batch
        resolvent = x[:, None, None] * np.eye(self.order) - self.A
        try:
            return np.asarray(
                self.C @ np.linalg.solve(resolvent, np.broadcast_to(self.B, (x.size, *self.B.shape))) + self.D
            )
        except np.linalg.LinAlgError:
            raise DataError(
                "a transfer function was asked at a pole of the model",
                "it is infinite there",
                "Leave that frequency out.",
            ) from None

    def frequency_response(self, frequencies: ArrayLike, **channels: Any) -> FrequencyResponse:
        """Return the frequency response on lines in Hz: at j 2 pi f, or at exp(j 2 pi f dt) for a sampled model.

        Keyword arguments are those of `FrequencyResponse` (labels, units, quantity ...).
        """
        f = np.asarray(frequencies, dtype=float)
        points = 2j * np.pi * f if self.dt is None else np.exp(2j * np.pi * f * self.dt)
        rate = None if self.dt is None else 1 / self.dt
        return FrequencyResponse(
            **{"values": self.transfer(points), "frequencies": f, "sampling_rate": rate, **channels}
        )

    def simulate(self, inputs: ArrayLike, initial_state: ArrayLike | None = None) -> RealArray:
        """Return the outputs (N, l) of a sampled model for inputs (N, m): x(k+1) = A x(k) + B u(k), y = C x + D u (Eq. 5)."""
        self._need("simulate", continuous=False)
        u = real_array("inputs", inputs, "(samples, inputs)", 2)
        if u.shape[1] != self.B.shape[1]:
            raise DataError(
                f"inputs of {self.B.shape[1]} channels were asked",
                f"there are {u.shape[1]}",
                "Give one column an input.",
            )
        x = (
            np.zeros(self.order)
            if initial_state is None
            else np.array(real_array("initial_state", initial_state, "(states,)", 1))
        )
        if x.shape != (self.order,):
            raise DataError(f"initial_state needs {self.order} entries", f"it has {x.size}", "Give one a state.")
        driven = u @ self.B.T
        states = np.empty((u.shape[0], self.order))
        for k, push in enumerate(driven):
            states[k] = x
            x = self.A @ x + push
        return np.asarray(states @ self.C.T + u @ self.D.T)

    def transformed(self, T: ArrayLike) -> StateSpace:
        """Return the model in new coordinates x = T z: (T^-1 A T, T^-1 B, C T, D) (Eqs. 12-14)."""
        matrix = real_array("T", T, "(states, states)", 2)
        if matrix.shape != self.A.shape or np.linalg.cond(matrix) > 1 / np.finfo(float).eps:
            raise DataError(
                f"a regular {self.A.shape} change of coordinates was asked",
                f"T has shape {matrix.shape} or is singular",
                "Give a regular square matrix.",
            )
        inverse: Array = np.linalg.inv(matrix)
        return StateSpace(A=inverse @ self.A @ matrix, B=inverse @ self.B, C=self.C @ matrix, D=self.D, dt=self.dt)

    def to_scipy(self) -> Any:
        """Return the model as `scipy.signal.StateSpace`."""
        from scipy import signal

        return signal.StateSpace(self.A, self.B, self.C, self.D, **({} if self.dt is None else {"dt": self.dt}))

    def to_control(self) -> Any:
        """Return the model as python-control's `StateSpace` (the extra `control`)."""
        try:
            import control
        except ImportError:
            raise DataError(
                "to_control was asked", "python-control is not installed", "Run: pip install 'modalscope[control]'"
            ) from None
        return control.ss(self.A, self.B, self.C, self.D, 0 if self.dt is None else self.dt)

    @classmethod
    def from_other(cls, system: Any) -> StateSpace:
        """Take over a state-space model of scipy or python-control: anything with A, B, C, D and dt."""
        dt = getattr(system, "dt", None)
        if dt is True:
            raise DataError(
                "a sampled model needs its sampling interval",
                "it says only that it is sampled (dt=True)",
                "Give dt in seconds.",
            )
        return cls(A=system.A, B=system.B, C=system.C, D=system.D, dt=dt or None)

    def _need(self, asked: str, *, continuous: bool) -> None:
        if continuous is not (self.dt is None):
            have = "continuous" if self.dt is None else "sampled"
            other = "to_discrete(dt)" if self.dt is None else "to_continuous()"
            raise DataError(
                f"{asked}() of a {'continuous' if continuous else 'sampled'} model was asked",
                f"this one is {have}",
                f"Call {other} first.",
            )


def _similar(vectors: Array, values: Array) -> RealArray:
    """Return the real matrix X diag(values) X^-1."""
    return np.ascontiguousarray(np.linalg.solve(vectors.T, (vectors * values).T).T.real)
