"""Hold state-space models x' = A x + B u, y = C x + D u, continuous or sampled (Eqs. 1-16), and convert them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.modal_form import Block, block_diagonal_basis, continuous
from modalscope.data.quadruple import Quadruple
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.numerics.arguments import POSITIVE, named
from modalscope.numerics.checks import RealArray, real_array, stays_locked
from modalscope.numerics.errors import DataError, optional_package
from modalscope.numerics.linear_systems import sampled

#: Between samples the input is held (zero-order hold), or comes in sampled Dirac impulses (they differ, Eq. 8).
INPUTS = ("held", "dirac")


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ModalForm:
    """A model in modal coordinates q, x = T q: A is block diagonal, [[s, w], [-w, s]] for the pair s +- j w.

    `state_space`: the model in these coordinates. `T` (n, n): real change of coordinates; columns of length one in well scaled states.
    `blocks`: by rising frequency. `condition`: condition number of T in well scaled states: digits lost by the change are its decimal
    logarithm.
    """

    state_space: StateSpace
    T: RealArray
    blocks: tuple[Block, ...]
    condition: float


@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
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
    output_dofs, input_dofs, output_units, input_units : tuple of str, optional
        Names of the channels and their units, as `realize` sets them; empty where they are not known.

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

    @named(dt=POSITIVE, input=INPUTS)
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
        A, B = sampled(self.A, self.B, dt, held=input == "held")
        return StateSpace(A=A, B=B, C=self.C, D=self.D, dt=dt, **self.names)

    @named(input=INPUTS)
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
        A, B = continuous(self.A, self.B, self.dt or 1.0, held=input == "held")
        return StateSpace(A=A, B=B, C=self.C, D=self.D, **self.names)

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
        u = real_array("inputs", inputs, "(samples, inputs)", 2)
        if u.shape[1] != self.B.shape[1]:
            raise DataError(
                f"the model has {self.B.shape[1]} inputs", f"there are {u.shape[1]}", "Give one column per input."
            )
        return self._states(self.A, u @ self.B.T, initial) @ self.C.T + u @ self.D.T

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
        if self.gain is None:
            raise DataError(
                "one-step predictions need the gain of the innovations",
                "the model has none",
                "Identify it from records with method='n4sid', give gain=, or use simulate().",
            )
        (l, m), rate = self.D.shape, 1 / self.dt if self.dt else np.nan
        if (len(signals.output_dofs), len(signals.input_dofs)) != (l, m) or not np.isclose(signals.sampling_rate, rate):
            raise DataError(
                f"predictions of {l} outputs from {m} inputs at {rate:g} Hz:",
                f"the record has {len(signals.output_dofs)} outputs and {len(signals.input_dofs)} inputs at {signals.sampling_rate:g} Hz",
                "Select the model's channels, and resample to its rate.",
            )
        outputs, inputs = signals.by_run()
        A, B, K = self.A - self.gain @ self.C, self.B - self.gain @ self.D, self.gain
        runs = [
            self._states(A, u @ B.T + y @ K.T, initial) @ self.C.T + u @ self.D.T
            for y, u in zip(outputs, np.zeros((*outputs.shape[:2], 0)) if inputs is None else inputs, strict=True)
        ]
        return np.stack(runs).reshape(signals.outputs.shape)

    def _states(self, A: RealArray, driven: RealArray, initial: ArrayLike | None) -> RealArray:
        """Return x(k), (N, n), of x(k+1) = A x(k) + driven(k)."""
        x = np.zeros(self.order) if initial is None else np.array(real_array("initial", initial, "(states,)", 1))
        if x.shape != (self.order,):
            raise DataError(f"initial needs {self.order} entries", f"it has {x.size}", "Give one per state.")
        states = np.empty((len(driven), self.order))
        for k, push in enumerate(driven):
            states[k] = x
            x = A @ x + push
        return states

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
                f"T must be an invertible {self.A.shape} matrix",
                f"its shape is {matrix.shape} or it is singular",
                "Change T.",
            )
        return self._moved(matrix, np.linalg.solve(matrix, self.A @ matrix))

    def modal_form(self) -> ModalForm:
        """Return the model in real modal coordinates: A of blocks [[s, w], [-w, s]] and real poles (Eqs. 15-16).

        Repeated poles with eigenvectors of their own stand in own blocks; those that (nearly) lack them share one, in real Schur form.
        """
        T, M, blocks, condition = block_diagonal_basis(self.A, np.abs(self.continuous_poles))
        return ModalForm(state_space=self._moved(T, M), T=T, blocks=blocks, condition=condition)

    def to_scipy(self) -> Any:
        """Return the model as `scipy.signal.StateSpace`."""
        from scipy import signal

        sampling = {} if self.dt is None else {"dt": self.dt}
        return signal.StateSpace(self.A, self.B, self.C, self.D, **sampling)

    def to_control(self) -> Any:
        """Return the model as python-control's `StateSpace` (the extra `control`), its signals named after the channels."""
        control = optional_package("to_control", "control", "control", "python-control")
        sides = {"outputs": self.output_dofs, "inputs": self.input_dofs}
        # python-control takes names for what joins systems: each once, without points
        names = {side: [name.replace(".", "_") for name in each] for side, each in sides.items()}
        given = {side: each for side, each in names.items() if each and len(set(each)) == len(each)}
        return control.ss(self.A, self.B, self.C, self.D, 0 if self.dt is None else self.dt, **given)
