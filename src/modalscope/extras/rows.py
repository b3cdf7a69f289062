"""Rows of the table that this package adds by its own entry points, as any other package adds its own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from modalscope.extras.common_poles import CommonPoles, aaa, vector_fitting, zeros
from modalscope.extras.point_orders import INTERPOLANTS, POLES
from modalscope.extras.predictor_fit import predictor_fit
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices_beyond import of_points
from modalscope.identification.method import Built, Problem
from modalscope.identification.method_names import rows_of


def interpolant(problem: Problem, order: int) -> Built:
    """Return barycentric interpolants; the order counts lines."""
    return of_points(aaa, problem, order)


def moving_poles(problem: Problem, order: int) -> Built:
    """Return vector fits; the order counts poles."""
    return of_points(vector_fitting, problem, order)


def factors_of(matrix: CommonPoles, order: int, route: str) -> Factors:
    """Return the singular values of the linearized problem of common poles."""
    return matrix.factors


#: Fields of the rows with one denominator of all channels; the others are those of Loewner matrices.
_COMMON_POLES: dict[str, Any] = {"section": "not in the report", "factor": factors_of, "realize": zeros}

AAA = tuple(
    replace(
        row,
        name="aaa",
        realization="null space, arrow pencil",
        common="AAA",
        known_as=("set-valued AAA, adaptive barycentric interpolation",),
        aliases=("set-valued aaa", "barycentric interpolation"),
        matrix=interpolant,
        orders=INTERPOLANTS,
        **_COMMON_POLES,
    )
    for row in rows_of("loewner")
)

VECTOR_FITTING = tuple(
    replace(
        row,
        name="vector-fitting",
        realization="common-denominator fraction, zeros",
        common="Vector fitting",
        known_as=("vector fitting, relaxed, fast", "Sanathanan-Koerner iteration in partial fractions"),
        aliases=("vf", "frvf", "relaxed vector fitting"),
        matrix=moving_poles,
        orders=POLES,
        **_COMMON_POLES,
    )
    for row in rows_of("loewner")
)

WNSF = tuple(
    replace(
        row,
        name="wnsf",
        realization="weighted null space",
        section="not in the report",
        common="WNSF",
        known_as=("weighted null-space fitting", "high-order ARX reduced with the weight of its own errors"),
        aliases=("weighted null-space fitting", "predictor fit"),
        realize=predictor_fit,
        votes=False,
    )
    for row in rows_of("n4sid")
)
