"""The matrices A, B, C, D of a linear model, and what follows from them alone: poles, controllability, observability."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from modalscope.model.checks import (
    Array,
    ComplexArray,
    DataError,
    RealArray,
    check_count,
    check_positive,
    freeze,
    real_array,
)
from modalscope.model.gramians import gramian, krylov
from modalscope.model.poles import to_continuous

__all__ = ["Quadruple"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Quadruple:
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
