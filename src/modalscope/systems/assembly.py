"""Mass, damping and stiffness matrices on named degrees of freedom (Eq. 1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.checks import DataError, RealArray, check_positive, freeze, real_array
from modalscope.model.geometry import Geometry
from modalscope.model.labels import DofLike, check_labels, indices_of
from modalscope.systems.modal import undamped_modes

__all__ = ["UNITS", "Assembly", "Dofs", "initial_state"]

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
            raise DataError(
                "mass needs a positive definite matrix",
                "it has an eigenvalue at or below zero",
                "Give every degree of freedom a mass.",
            )
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
            raise DataError(
                "a sampled response was asked",
                f"{self.name} has no sampling interval of its own",
                "Give sampling_rate.",
            )
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
                raise DataError(
                    f"{name} needs {degrees} entries, one a degree of freedom",
                    f"it has {array.size}",
                    "Give zeros where nothing moves.",
                )
            start[part] = array
    return start


def _symmetric(name: str, values: ArrayLike, size: int) -> RealArray:
    matrix = real_array(name, values, "(dofs, dofs)", 2)
    if matrix.shape != (size, size):
        raise DataError(
            f"{name} needs shape {(size, size)}", f"it has {matrix.shape}", "Give square matrices of one size."
        )
    if np.abs(matrix - matrix.T).max(initial=0) > 1e-9 * np.abs(matrix).max(initial=0):
        raise DataError(
            f"{name} needs a symmetric matrix", "it is not", "Give A, B, C, D of other systems to StateSpace."
        )
    return matrix
