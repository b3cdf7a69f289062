"""State-space models x' = A x + B u, y = C x + D u, continuous or sampled (Eqs. 1-16)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.balance import Balanced, balance
from modalscope.model.checks import (
    ComplexArray,
    DataError,
    RealArray,
    check_choice,
    check_count,
    check_positive,
    real_array,
)
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.interchange import matrices_of, to_control, to_scipy
from modalscope.model.modal_form import ModalForm, PoleGroup, block_diagonal_basis, pole_groups
from modalscope.model.quadruple import Quadruple
from modalscope.model.recursion import markov_parameters, predicted, simulated
from modalscope.model.resolvent import transfer
from modalscope.model.sampling import continuous, sampled
from modalscope.model.signals import Signals

__all__ = ["INPUTS", "StateSpace"]

#: Between samples the input is held (zero-order hold), or comes in sampled Dirac impulses (they differ, Eq. 8).
INPUTS = ("held", "dirac")


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class StateSpace(Quadruple):
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
    gain : array, (n, l), optional
        K of a sampled model's innovations form, x(k+1) = A x + B u + K e, y = C x + D u + e.
    innovation_covariance : array, (l, l), optional
        Covariance of e, the errors of one-step predictions.

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

    def to_discrete(self, dt: float, input: str = "held") -> StateSpace:
        """Return the exact sampled model: A = exp(Ac dt), and B by Eq. 8.

        Parameters
        ----------
        dt : float
            Sampling interval, seconds.
        input : {"held", "dirac"}
            Held between samples, B = integral of exp(Ac t) Bc over one step; or a Dirac impulse at each sample, B = Bc (then
            Y(k) = C A^k B is the impulse response at t = k dt, from t = 0+; its direct term is not a number).
        """
        self._need("to_discrete", continuous=True)
        check_positive("dt", dt)
        check_choice("input", input, INPUTS)
        A, B = sampled(self.A, self.B, dt, held=input == "held")
        return StateSpace(A=A, B=B, C=self.C, D=self.D, dt=dt)

    def to_continuous(self, input: str = "held") -> StateSpace:
        """Return the continuous model whose exact sampling this is; the inverse of `to_discrete`.

        The logarithm is taken of the eigenvalues, never of the matrix. Frequencies above half the rate cannot be told from aliases.

        Parameters
        ----------
        input : {"held", "dirac"}
            What the sampled model's input does between samples (see `to_discrete`).

        Raises
        ------
        DataError
            A real pole at or below zero has no real logarithm.
        """
        self._need("to_continuous", continuous=False)
        check_choice("input", input, INPUTS)
        A, B = continuous(self.A, self.B, self.dt or 1.0, held=input == "held")
        return StateSpace(A=A, B=B, C=self.C, D=self.D)

    def markov_parameters(self, samples: int) -> RealArray:
        """Return Y(k) = C A^k B, k = 0 ... samples - 1, of a sampled model as (samples, l, m) (Eq. 11).

        Parameters
        ----------
        samples : int

        Raises
        ------
        DataError
            A continuous model.
        """
        self._need("markov_parameters", continuous=False)
        return markov_parameters(self.A, self.B, self.C, check_count("samples", samples))

    def impulse_response(self, samples: int, **channels: Any) -> ImpulseResponse:
        """Return the Markov parameters of a sampled model as a pulse response, with its direct term.

        Parameters
        ----------
        samples : int
        **channels
            Fields of `ImpulseResponse` (labels, units, kind ...).
        """
        values = self.markov_parameters(samples)
        assert self.dt is not None
        return ImpulseResponse(
            **{"values": values, "sampling_rate": 1 / self.dt, "feedthrough": self.D, "kind": "pulse", **channels}
        )

    def transfer(self, points: ArrayLike) -> ComplexArray:
        """Return D + C (x I - A)^-1 B, (points, l, m) (Eq. 75).

        Parameters
        ----------
        points : array of complex, (points,)
            x, in rad/s for a continuous model and on the z-plane for a sampled one.

        Raises
        ------
        DataError
            A point that is a pole.
        """
        return transfer(self.A, self.B, self.C, self.D, np.atleast_1d(np.asarray(points, dtype=np.complex128)))

    def frequency_response(self, frequencies: ArrayLike, **channels: Any) -> FrequencyResponse:
        """Return the frequency response on lines in Hz: at j 2 pi f, or at exp(j 2 pi f dt) for a sampled model.

        Parameters
        ----------
        frequencies : array, (F,)
            Lines in Hz.
        **channels
            Fields of `FrequencyResponse` (labels, units, quantity ...).
        """
        f = real_array("frequencies", frequencies, "(lines,)", (0, 1)).reshape(-1)
        points = 2j * np.pi * f if self.dt is None else np.exp(2j * np.pi * f * self.dt)
        rate = None if self.dt is None else 1 / self.dt
        return FrequencyResponse(
            **{"values": self.transfer(points), "frequencies": f, "sampling_rate": rate, **channels}
        )

    def simulate(self, inputs: ArrayLike, initial: ArrayLike | None = None) -> RealArray:
        """Return the outputs (N, l) of a sampled model: x(k+1) = A x(k) + B u(k), y = C x + D u (Eq. 5).

        Parameters
        ----------
        inputs : array, (N, m)
        initial : array, (n,), optional
            x(0); zero by default.

        Raises
        ------
        DataError
            A continuous model, or inputs or a state of another size.
        """
        self._need("simulate", continuous=False)
        return simulated(self, inputs, initial)

    def predict(self, signals: Signals, initial: ArrayLike | None = None) -> RealArray:
        """Return what the model expects of every sample of a record from those before it, in the shape of the record's outputs.

        y^ = C x + D u, x(k+1) = A x + B u + K (y - y^); the errors y - y^ are the innovations.

        Parameters
        ----------
        signals : Signals
            With the model's inputs and outputs, at its sampling rate.
        initial : array, (n,), optional
            x(0) of every run; zero by default.

        Raises
        ------
        DataError
            A continuous model or one without a gain, a record of another rate or with other channels.

        Examples
        --------
        >>> model = StateSpace(A=[[0.5]], B=[[1.0]], C=[[1.0]], dt=1.0, gain=[[0.5]])
        >>> model.predict(
        ...     Signals(outputs=[[1.0], [1.0], [1.0]], inputs=[[0.0], [0.0], [0.0]], sampling_rate=1.0)
        ... ).ravel()
        array([0. , 0.5, 0.5])
        """
        self._need("predict", continuous=False)
        return predicted(self, signals, initial)

    def transformed(self, T: ArrayLike) -> StateSpace:
        """Return the model in new coordinates x = T z: (T^-1 A T, T^-1 B, C T, D) (Eqs. 12-14).

        Parameters
        ----------
        T : array, (n, n)
            Regular.
        """
        matrix = real_array("T", T, "(states, states)", 2)
        if matrix.shape != self.A.shape or np.linalg.cond(matrix) > 1 / np.finfo(float).eps:
            raise DataError(
                f"a regular {self.A.shape} change of coordinates was asked",
                f"T has shape {matrix.shape} or is singular",
                "Give a regular square matrix.",
            )
        return self._moved(matrix, np.linalg.solve(matrix, self.A @ matrix))

    def balanced(self, order: int | None = None, *, steady_state: bool = False) -> Balanced:
        """Return the balanced realization, both Gramians diag(Hankel singular values), or its leading `order` states.

        Parameters
        ----------
        order : int, optional
            States to keep (balanced truncation); by default all that are both seen and driven.
        steady_state : bool
            Keep the gain at 0 Hz instead of the response's first samples.

        Raises
        ------
        DataError
            A pole that does not decay, or an order above the number of states that are seen and driven.

        Examples
        --------
        >>> ss = StateSpace(A=[[-1, 0], [0, -2]], B=[[1], [0.001]], C=[[1, 1]])
        >>> cut = ss.balanced(1)
        >>> cut.state_space.order, bool(cut.error_bound < 0.001)
        (1, True)
        """
        return balance(self, order, steady_state)

    def modal_form(self) -> ModalForm:
        """Return the model in real modal coordinates: A of blocks [[s, w], [-w, s]] and real poles (Eqs. 15-16).

        Repeated poles with eigenvectors of their own stand in own blocks; those that (nearly) lack them share one, in real Schur form.
        """
        T, M, blocks, condition = block_diagonal_basis(self.A, np.abs(self.continuous_poles))
        return ModalForm(state_space=self._moved(T, M), T=T, blocks=blocks, condition=condition)

    def pole_groups(self, tolerance: float = 1e-6) -> tuple[PoleGroup, ...]:
        """Return the poles, coinciding ones together, with how many of each the outputs see and the inputs drive.

        Data of l outputs and m inputs show at most min(l, m) coinciding poles: `identifiable` says how many.

        Parameters
        ----------
        tolerance : float
            Poles within this fraction of the largest modulus coincide; couplings below it count as none.
        """
        return pole_groups(self, check_positive("tolerance", tolerance))

    def to_scipy(self) -> Any:
        """Return the model as `scipy.signal.StateSpace`."""
        return to_scipy(self)

    def to_control(self) -> Any:
        """Return the model as python-control's `StateSpace` (the extra `control`)."""
        return to_control(self)

    @classmethod
    def from_other(cls, system: Any) -> StateSpace:
        """Take over a state-space model of scipy or python-control.

        Parameters
        ----------
        system : object
            Anything with A, B, C, D and dt (None or 0 when it is continuous).

        Raises
        ------
        DataError
            One of these is missing, or a sampled model does not say its interval.
        """
        return cls(**matrices_of(system))
