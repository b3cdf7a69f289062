"""Transform models to the coordinates of the sensors: M^-1 K and M^-1 D (Eq. 107), first-order form (Eqs. 108-109).

Equations are those of Juang, NASA TM 87720 (1986). M, D and K are mass, damping and stiffness matrix, l the number of outputs, n that of
states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.data.statespace import StateSpace
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.orthonormal import most_real

#: Maximum condition of [C; C A] at which the sensors separate the states: errors of the model are multiplied by it, and with 1e8 half of
#: the digits of double precision remain.
_MAX_CONDITION = 1e8


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class EquationsOfMotion:
    """y'' + (M^-1 D) y' + (M^-1 K) y = 0 in the coordinates of the sensors.

    Parameters
    ----------
    stiffness, damping : array, (l, l)
        M^-1 K in 1/s^2 and M^-1 D in 1/s. With outputs C_d q of the coordinates q of the structure, they are C_d M^-1 K C_d# and
        C_d M^-1 D C_d#, where # is the pseudo-inverse.
    frequencies : array, (n / 2,)
        Undamped natural frequencies, Hz: the square roots of the eigenvalues of M^-1 K alone, over 2 pi.
    shapes : array, (l, n / 2)
        Its real modes, of length one.
    condition : float
        Condition of [C; C A / w], by which errors of the model are multiplied; w is the largest |pole|.
    """

    stiffness: RealArray
    damping: RealArray
    frequencies: RealArray
    shapes: RealArray
    condition: float


@named(model=StateSpace)
def equations_of_motion(model: StateSpace) -> EquationsOfMotion:
    """Return M^-1 K and M^-1 D from C A^2 + (M^-1 D) C A + (M^-1 K) C = 0 (Eqs. 104-107).

    Parameters
    ----------
    model : StateSpace
        Continuous, identified from displacements, velocities or accelerations: all obey the same homogeneous equation.

    Raises
    ------
    DataError
        A sampled model; fewer sensors than degrees of freedom (n / 2), or sensors that do not separate them; rigid-body motions measured
        as velocities or accelerations, which do not depend on the position.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> s = chain5()
    >>> e = equations_of_motion(s.state_space(outputs=range(5)))
    >>> bool(abs(e.stiffness - s.stiffness).max() < 1e-9)  # unit masses
    True
    """
    _check_continuous(model)
    n, l = model.order, model.C.shape[0]
    if 2 * l < n:
        raise DataError(
            f"M^-1 K of {n} states:",
            f"{l} sensors give {2 * l} rows of [C; CA], at least {n} are needed",
            f"Measure at least {-(-n // 2)} degrees of freedom, or identify {2 * l} states: order={2 * l}; with "
            "method='polyreference' also block_rows=2.",
        )
    w = float(np.abs(model.poles).max()) or 1.0  # displacements and velocities of one size
    V = np.vstack([model.C, model.C @ model.A / w])
    condition = _condition(V, n)
    if condition > _MAX_CONDITION:
        raise DataError(
            f"M^-1 K of {n} states:",
            f"[C; CA] has condition {condition:.1e}: the sensors do not separate the degrees of freedom",
            "Measure more of them, or lower the order to the modes that the sensors see.",
        )
    X = np.asarray(-np.linalg.lstsq(V.T, (model.C @ model.A @ model.A).T, rcond=None)[0].T, dtype=float)
    stiffness, damping = X[:, :l], X[:, l:] / w
    values, vectors = np.linalg.eig(stiffness)
    # more sensors than degrees of freedom add eigenvalues of zero
    largest = np.argsort(-np.abs(values), kind="stable")[: n // 2]
    order = largest[np.argsort(np.abs(values[largest]), kind="stable")]
    real = most_real(vectors[:, order]).real
    return EquationsOfMotion(
        stiffness=stiffness,
        damping=damping,
        frequencies=np.sqrt(np.abs(values[order])) / (2 * np.pi),
        shapes=real / np.linalg.norm(real, axis=0),
        condition=condition,
    )


@named(model=StateSpace)
def first_order_form(model: StateSpace) -> StateSpace:
    """Return the model of order l whose states are the outputs, y' = (C A C#) y + C B u (Eqs. 108-109).

    Parameters
    ----------
    model : StateSpace
        Continuous, with at least as many outputs as states.

    Raises
    ------
    DataError
        A sampled model, or C without full column rank. Displacements alone, or velocities alone, reach half of the states, whatever
        their number: both are needed.
    """
    _check_continuous(model)
    n, l = model.order, model.C.shape[0]
    condition = _condition(model.C / np.maximum(np.linalg.norm(model.C, axis=1, keepdims=True), 1e-300), n)
    if l < n or condition > _MAX_CONDITION:
        rank = np.linalg.matrix_rank(model.C, tol=np.linalg.norm(model.C) / _MAX_CONDITION)
        raise DataError(
            f"the first-order form of {n} states:",
            f"the {l} outputs reach {rank} of them",
            f"Measure at least {n} outputs, displacements and velocities both, or use the second-order form.",
        )
    return StateSpace(A=model.C @ model.A @ np.linalg.pinv(model.C), B=model.C @ model.B, C=np.eye(l), D=model.D)


def _check_continuous(model: StateSpace) -> None:
    if model.dt is not None:
        raise DataError(
            "a continuous model:", f"it is sampled every {model.dt:g} s", "Use domain='s' or to_continuous()."
        )


def _condition(matrix: RealArray, n: int) -> float:
    """Return the largest singular value over the n-th one; infinite below rank n."""
    d = np.linalg.svd(matrix, compute_uv=False)
    return float(d[0] / d[n - 1]) if d.size >= n and d[n - 1] > 0 else np.inf
