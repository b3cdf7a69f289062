"""Hold the matrices A, B, C, D of a linear model and compute what follows from them alone (Eqs. 1-16, 75)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.shown import Shown
from modalscope.numerics.checks import (
    Array,
    ComplexArray,
    RealArray,
    check_count,
    check_positive,
    freeze,
    optional_array,
    real_array,
)
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import to_continuous
from modalscope.numerics.linear_systems import markov_parameters, transfer
from modalscope.numerics.resources import check_fits


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
    output_dofs: tuple[str, ...] = ()
    input_dofs: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()

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
        if self.dt is None and not (self.gain is self.innovation_covariance is None):
            raise DataError(
                "a gain or covariance was given", "the model is continuous", "Give it for the sampled model."
            )
        l = len(C)
        names = {}
        for name, count in (("output", l), ("input", B.shape[1])):
            for what in (f"{name}_dofs", f"{name}_units"):
                names[what] = tuple("" if each is None else str(each) for each in getattr(self, what))
                if names[what] and len(names[what]) != count:
                    fault = f"{len(names[what])} are given"
                    raise DataError(f"{what} needs one text for each of {count}", fault, "Give one each, or none.")
        freeze(
            self,
            A=A,
            B=B,
            C=C,
            D=D,
            dt=None if self.dt is None else check_positive("dt", self.dt),
            gain=optional_array("gain", self.gain, "(states, outputs)", (n, l)),
            innovation_covariance=optional_array(
                "innovation_covariance", self.innovation_covariance, "(outputs, outputs)", (l, l)
            ),
            **names,
        )

    @property
    def names(self) -> dict[str, Any]:
        """Labels and units of outputs and inputs, by field; empty where they are not known."""
        fields = ("output_dofs", "input_dofs", "output_units", "input_units")
        return {field: getattr(self, field) for field in fields}

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
        count = check_count("samples", samples)
        size = 8.0 * count * self.C.shape[0] * self.B.shape[1]
        check_fits(f"a response of {count} samples", size, "Give fewer samples.")
        return markov_parameters(self.A, self.B, self.C, count)

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
                f"{asked}() needs a {'continuous' if continuous else 'sampled'} model",
                f"this one is {have}",
                f"Call {other} first.",
            )
