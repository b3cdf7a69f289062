"""Hold state-space models x' = A x + B u, y = C x + D u, continuous or sampled (Eqs. 1-16), and convert them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.modal_form import ModalForm, PoleGroup, block_diagonal_basis, continuous, pole_groups, sampled
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.shown import Shown
from modalscope.functions.poles import to_continuous
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_count, check_positive, freeze, real_array
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.extras import optional_package
from modalscope.numerics.linear_systems import gramian, gramian_factor, krylov, markov_parameters, transfer

# ----------------------------------------------------------------------------------------------------------- quadruple
# The matrices A, B, C, D of a linear model, and what follows from them alone: poles, controllability, observability.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Quadruple(Shown):
    """Matrices of a model with n states, m inputs and l outputs, checked (see `StateSpace`).

    The parameters are those of `StateSpace`, which adds responses and other forms.
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray = None  # type: ignore[assignment]
    dt: float | None = None
    gain: RealArray | None = None
    innovation_covariance: RealArray | None = None

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
        noise = {
            name: self._beside(name, value, shape)
            for name, value, shape in (
                ("gain", self.gain, (n, C.shape[0])),
                ("innovation_covariance", self.innovation_covariance, (C.shape[0], C.shape[0])),
            )
        }
        freeze(self, A=A, B=B, C=C, D=D, dt=None if self.dt is None else check_positive("dt", self.dt), **noise)

    def _beside(self, name: str, value: RealArray | None, shape: tuple[int, int]) -> RealArray | None:
        """Return what belongs to the noise of a sampled model, checked; None where it is not known."""
        if value is None:
            return None
        array = real_array(name, value, "(states or outputs, outputs)", 2)
        if array.shape != shape or self.dt is None:
            raise DataError(
                f"{name} of shape {array.shape} was given",
                f"the model is {'continuous' if self.dt is None else f'sampled, and takes {shape}'}",
                "Give it for the sampled model, one column an output.",
            )
        return array

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

    def controllability_matrix(self, blocks: int | None = None) -> RealArray:
        """Return [B, A B, ..., A^(blocks-1) B], (n, m blocks).

        Parameters
        ----------
        blocks : int, optional
            As many as states by default.
        """
        return krylov(self.A, self.B, check_count("blocks", self.order if blocks is None else blocks))

    def observability_matrix(self, blocks: int | None = None) -> RealArray:
        """Return [C; C A; ...; C A^(blocks-1)], (l blocks, n).

        Parameters
        ----------
        blocks : int, optional
            As many as states by default.
        """
        return krylov(self.A.T, self.C.T, check_count("blocks", self.order if blocks is None else blocks)).T

    def controllability_gramian(self, horizon: float | None = None) -> RealArray:
        """Return sum_k A^k B B' A'^k (sampled), or the integral of exp(A t) B B' exp(A' t) (continuous), (n, n).

        Parameters
        ----------
        horizon : int or float, optional
            Number of samples, or seconds; all time by default, for a stable model.

        Raises
        ------
        DataError
            All time, but poles that do not decay.
        """
        return gramian(self.A, self.B, horizon, self.dt is not None)

    def observability_gramian(self, horizon: float | None = None) -> RealArray:
        """Return sum_k A'^k C' C A^k, or the integral of exp(A' t) C' C exp(A t), (n, n).

        Parameters
        ----------
        horizon : int or float, optional
            As in `controllability_gramian`.
        """
        return gramian(self.A.T, self.C.T, horizon, self.dt is not None)

    def _moved(self, T: Array, A: Array) -> Self:
        """Return the model of the states z, x = T z, given its A."""
        moved: dict[str, Any] = {"A": A, "B": np.linalg.solve(T, self.B), "C": self.C @ T}
        moved["gain"] = None if self.gain is None else np.linalg.solve(T, self.gain)
        return replace(self, **moved)

    def _need(self, asked: str, *, continuous: bool) -> None:
        """Raise where a model is continuous and a sampled one is asked, or the other way round."""
        if continuous is not (self.dt is None):
            have = "continuous" if self.dt is None else "sampled"
            other = "to_discrete(dt)" if self.dt is None else "to_continuous()"
            raise DataError(
                f"{asked}() of a {'continuous' if continuous else 'sampled'} model was asked",
                f"this one is {have}",
                f"Call {other} first.",
            )


# --------------------------------------------------------------------------------------------------------- interchange
# State-space models to and from scipy and python-control.


def to_scipy(model: StateSpace) -> Any:
    """Return the model as `scipy.signal.StateSpace`."""
    from scipy import signal

    sampling = {} if model.dt is None else {"dt": model.dt}
    return signal.StateSpace(model.A, model.B, model.C, model.D, **sampling)


def to_control(model: StateSpace) -> Any:
    """Return the model as python-control's `StateSpace`."""
    control = optional_package("to_control", "control", "control", "python-control")
    return control.ss(model.A, model.B, model.C, model.D, 0 if model.dt is None else model.dt)


def matrices_of(system: Any) -> dict[str, Any]:
    """Return A, B, C, D and dt of a state-space model of scipy or python-control."""
    missing = [name for name in "ABCD" if not hasattr(system, name)]
    if missing:
        raise DataError(
            "a state-space model was asked",
            f"{type(system).__name__} has no {', '.join(missing)}",
            "Convert it there first, for instance by to_ss() or control.ss().",
        )
    dt = getattr(system, "dt", None)
    if dt is True:
        raise DataError(
            "a sampled model needs its sampling interval",
            "it says only that it is sampled (dt=True)",
            "Give dt in seconds.",
        )
    # python-control writes 0 for continuous time
    return {name: getattr(system, name) for name in "ABCD"} | {"dt": dt or None}


# ------------------------------------------------------------------------------------------------------------- balance
# Balanced realizations and balanced truncation of state-space models.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Balanced:
    """A balanced model, whole or cut to its leading states.

    `state_space`: the model: both Gramians are diag(hankel_singular_values) when it is whole. `hankel_singular_values`: all of them,
    falling; those below rounding belong to states that are not seen or not driven. `T`, `inverse` (n, k): change of coordinates x = T z,
    and its left inverse. `error_bound`: 2 times the sum of the singular values that were cut: no frequency response of the cut model is
    further than this from the whole one, in the largest singular value over outputs and inputs, at any frequency.
    """

    state_space: StateSpace
    hankel_singular_values: RealArray
    T: RealArray
    inverse: RealArray
    error_bound: float


def balance(model: StateSpace, order: int | None, steady_state: bool) -> Balanced:
    """Return the balanced realization or its leading states (see `StateSpace.balanced`)."""
    sampled = model.dt is not None
    reach, sight = gramian_factor(model.A, model.B, sampled), gramian_factor(model.A.T, model.C.T, sampled)
    T, inverse, singular = _balancing(reach, sight)
    A, B, C, D = inverse @ model.A @ T, inverse @ model.B, model.C @ T, np.array(model.D)
    kept = len(A) if order is None else check_count("order", order)
    if kept > len(A):
        raise DataError(
            f"a balanced model of order {kept} was asked",
            f"{len(A)} states are both seen by the outputs and driven by the inputs",
            f"Lower the order to at most {len(A)}.",
        )
    if steady_state:
        A, B, C, D = _steady_state_cut(A, B, C, D, kept, sampled)
    return Balanced(
        state_space=replace(model, A=A[:kept, :kept], B=B[:kept], C=C[:, :kept], D=D),
        hankel_singular_values=singular,
        T=T[:, :kept],
        inverse=inverse[:kept],
        error_bound=float(2 * singular[kept:].sum()),
    )


def _balancing(reach: RealArray, sight: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return T (n, k), its left inverse (k, n) and the Hankel singular values of factors of both Gramians.

    From sight' reach = U S V': T = reach V S^-1/2 and T^-1 = S^-1/2 U' sight'. The k states above rounding, n eps of the
    first, are kept; no coordinates balance the others, which outputs do not see or inputs do not drive.
    """
    U, s, Vt = np.linalg.svd(sight.T @ reach)
    k = int(np.count_nonzero(s > s.size * np.finfo(float).eps * s[0])) if s.size and s[0] > 0 else 0
    root = np.sqrt(s[:k])
    return reach @ Vt[:k].T / root, (U[:, :k] / root).T @ sight.T, s


def _steady_state_cut(
    A: RealArray, B: RealArray, C: RealArray, D: RealArray, order: int, sampled: bool
) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Drop all but `order` states of a balanced model by putting them in their steady state: the gain at 0 Hz stays."""
    n = A.shape[0]
    rest = (np.eye(n - order) if sampled else 0) - A[order:, order:]
    fixed = np.linalg.solve(rest, np.hstack([A[order:, :order], B[order:]]))
    stateful, driven = fixed[:, :order], fixed[:, order:]
    return (
        A[:order, :order] + A[:order, order:] @ stateful,
        B[:order] + A[:order, order:] @ driven,
        C[:, :order] + C[:, order:] @ stateful,
        D + C[:, order:] @ driven,
    )


# ---------------------------------------------------------------------------------------------------------- statespace

#: Between samples the input is held (zero-order hold), or comes in sampled Dirac impulses (they differ, Eq. 8).
INPUTS = ("held", "dirac")


def simulated(model: Quadruple, inputs: ArrayLike, initial: ArrayLike | None) -> RealArray:
    """Return the outputs (N, l) for inputs (N, m) and a state to start from (see `StateSpace.simulate`)."""
    u = real_array("inputs", inputs, "(samples, inputs)", 2)
    if u.shape[1] != model.B.shape[1]:
        raise DataError(
            f"inputs of {model.B.shape[1]} channels were asked", f"there are {u.shape[1]}", "Give one column an input."
        )
    states = _states(model.A, u @ model.B.T, _initial(model, initial))
    return np.asarray(states @ model.C.T + u @ model.D.T)


def predicted(model: Quadruple, signals: Signals, initial: ArrayLike | None) -> RealArray:
    """Return one-step predictions of a record's outputs (see `StateSpace.predict`): x(k+1) = (A - K C) x + (B - K D) u + K y."""
    if model.gain is None:
        raise DataError(
            "one-step predictions were asked",
            "the model has no gain",
            "Identify it from records with method='n4sid', give gain=, or use simulate().",
        )
    _check_record(model, signals)
    outputs, inputs = signals.by_run()
    u = np.zeros((*outputs.shape[:2], 0)) if inputs is None else inputs
    A, B = model.A - model.gain @ model.C, model.B - model.gain @ model.D
    start = _initial(model, initial)
    runs = [
        _states(A, v @ B.T + y @ model.gain.T, start) @ model.C.T + v @ model.D.T
        for y, v in zip(outputs, u, strict=True)
    ]
    return np.asarray(np.stack(runs).reshape(signals.outputs.shape))


def _check_record(model: Quadruple, signals: Signals) -> None:
    l, m = model.D.shape
    rate = 1 / model.dt if model.dt else np.nan
    if (len(signals.output_dofs), len(signals.input_dofs)) != (l, m) or not np.isclose(signals.sampling_rate, rate):
        raise DataError(
            f"predictions of {l} outputs from {m} inputs at {rate:g} Hz were asked",
            f"the record has {len(signals.output_dofs)} outputs and {len(signals.input_dofs)} inputs at {signals.sampling_rate:g} Hz",
            "Select the model's channels, and resample to its rate.",
        )


def _initial(model: Quadruple, initial: ArrayLike | None) -> RealArray:
    x = np.zeros(model.order) if initial is None else np.array(real_array("initial", initial, "(states,)", 1))
    if x.shape != (model.order,):
        raise DataError(f"initial needs {model.order} entries", f"it has {x.size}", "Give one a state.")
    return x


def _states(A: RealArray, driven: RealArray, x: RealArray) -> RealArray:
    """Return x(k), (N, n), of x(k+1) = A x(k) + driven(k)."""
    states = np.empty((len(driven), A.shape[0]))
    for k, push in enumerate(driven):
        states[k] = x
        x = A @ x + push
    return states


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
