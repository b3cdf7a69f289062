"""Check identities between methods on given data; they are valid with noise, too.

They relate different realizations of one data matrix. Each residual is computed from two separate routes; on any record it is
rounding, about 100 eps sigma_1 / sigma_n, and more is a fault of the program or the machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.analysis.comparing.reservations import exact_on, reservation
from modalscope.data.response import Response
from modalscope.identification.matrices.matrix import DataMatrix, Triple
from modalscope.identification.method_names import find_method
from modalscope.identification.pipeline import Factored, Pipeline, built, factored, realized
from modalscope.identification.prepare import prepare
from modalscope.identification.suits import refusal
from modalscope.identification.table_beyond import DOMAINS
from modalscope.numerics.checks import Array
from modalscope.numerics.errors import DataError
from modalscope.numerics.statistics import assign

#: Block rows, block columns and degree: identities are valid at any size, and dense second routes should be quick.
_BLOCK_ROWS, _BLOCK_COLUMNS, _DEGREE = 24, 60, 12


@dataclass(frozen=True)
class Identity:
    """One identity on given data.

    `name`: both sides. `source`: equations of the report. `order`: rank of the truncation. `residual`: relative; NaN when it could not be
    checked. `note`: why it could not be checked. `rows`: of the table, which the identity makes one estimator.
    """

    name: str
    domain: str
    source: str
    order: int
    residual: float
    note: str = ""
    rows: tuple[str, ...] = ()


def check_identities(response: Response, order: int) -> tuple[Identity, ...]:
    """Check every identity that the data allow.

    `order`: rank of the truncation; lowered where small data matrices carry less.
    """
    identities = []
    for row in (find_method("era", domain, domain) for domain in DOMAINS):
        # only data matrices without loss, where identities are valid to rounding
        if refusal(row, response, False) or reservation(row, response) or not exact_on(row, response):
            continue
        given = _Given(response, row.domain, max(order, 2), {}, {})
        for name, source, check in _CHECKS if len(row.forms) > 1 else _CHECKS[:2]:
            residual, note = np.nan, ""
            try:
                residual = check(given)
            except DataError as error:
                note = error.fault
            rows = _ONE_ESTIMATOR.get(check, ())
            identities.append(Identity(name, row.domain, source, max(order, 2), residual, note, rows))
    return tuple(identities)


class _Given(NamedTuple):
    """A response, a domain, the order, and the data matrices and factors that were made: rows of one kind share theirs."""

    response: Response
    domain: str
    order: int
    made: dict[Any, DataMatrix]
    factors: dict[Any, Factored]

    def built(self, method: str, **options: Any) -> Pipeline:
        """Return the models of a row; of the sizes of `_sizes` on the data matrix of the rows before."""
        sizes = _sizes(self.response)
        problem = prepare(self.response, method, self.domain, **(sizes | options))
        own = built(problem, self.order)
        if sizes.keys() & options.keys():  # sizes of its own
            return realized(problem, factored(problem, self.order, own))
        form = options.get("form") if len(problem.method.forms) > 1 else None
        matrix = self.made.setdefault((problem.method.matrix, form), own.matrix)
        shared = matrix, problem.method.factor
        if shared not in self.factors:
            self.factors[shared] = factored(problem, self.order, own._replace(matrix=matrix))
        return realized(problem, self.factors[shared])


def pole_residual(a: Array, b: Array) -> float:
    """Return the largest distance of paired poles over the largest modulus.

    Examples
    --------
    >>> pole_residual([1.0, 2.0], [2.0, 1.0])
    0.0
    """
    s, t = np.asarray(a, complex), np.asarray(b, complex)
    distance = np.abs(s[:, None] - t)
    rows, columns = assign(distance)
    return float(distance[rows, columns].max() / np.abs(t).max())


def projected_general(P: Array, d: Array, Q: Array, shifted: Array, first_row: Array, first_column: Array) -> Triple:
    """Realize from any factorization H(0) = P diag(d) Q', orthonormal or not: A = d^-1/2 P# H(1) (Q')# d^-1/2 (28, corrected).

    B = d^1/2 Q' E_m keeps Q', C = E_l' P d^1/2 keeps P.

    `P` (rows, n). `d` (n,). `Q` (columns, n). `shifted` (rows, columns): h(1). `first_row`: rows of the first block (outputs).
    `first_column`: columns of the first block (inputs).
    """
    root = np.sqrt(np.asarray(d, dtype=float))
    A = np.linalg.pinv(P) @ shifted @ np.linalg.pinv(np.asarray(Q).T) / np.outer(root, root)
    return Triple(A, root[:, None] * np.asarray(Q)[first_column].T, np.asarray(P)[first_row] * root, root.size)


def _sizes(response: Response) -> dict[str, Any]:
    count, outputs = response.values.shape[:2]
    if response.grid is not None:
        return {"block_rows": max(min(_DEGREE, 240 // outputs), 4)}
    rows = min(_BLOCK_ROWS, count // 3)
    return {"block_rows": rows, "block_columns": min(_BLOCK_COLUMNS, count - rows - 1)}


def _era_and_least_squares(given: _Given) -> float:
    era, squares = (given.built(name) for name in ("era", "least_squares"))
    n = min(given.order, era.factors.rank)
    return pole_residual(np.linalg.eigvals(squares.triple(n).A), np.linalg.eigvals(era.triple(n).A))


def _alternate_and_polyreference(given: _Given) -> float:
    shift, companion = (given.built(name, form="observable") for name in ("alternate", "polyreference"))
    n = min(given.order, shift.factors.rank)
    V = companion.matrix.row_shift.split(companion.factors.P[:, :n])[0]
    reduced = np.linalg.lstsq(V, companion.triple(n).A @ V, rcond=None)[0]
    return pole_residual(np.linalg.eigvals(reduced), np.linalg.eigvals(shift.triple(n).A))


def _dual(given: _Given) -> float:
    plain, transposed = (given.built("era", form=form) for form in ("observable", "controllable"))
    n = min(given.order, plain.factors.rank)
    return pole_residual(np.linalg.eigvals(transposed.triple(n).A), np.linalg.eigvals(plain.triple(n).A))


def _factorization(given: _Given) -> float:
    """Mix the singular vectors by a triangular matrix, which leaves H(0)_n = F G but neither F nor G orthonormal."""
    pipeline = given.built("era")
    n = min(given.order, pipeline.factors.rank)
    P, d, Q = pipeline.factors.P[:, :n], pipeline.factors.d[:n], pipeline.factors.Q[:, :n]
    mix = np.eye(n) + np.triu(np.full((n, n), 0.1), 1)
    other = Q * d @ np.linalg.inv(mix).T
    l, m = given.response.values.shape[1:]
    shifted = pipeline.matrix.shifted(1).dense()
    mixed = projected_general(P @ mix, np.ones(n), other, shifted, np.arange(l), np.arange(m))
    return pole_residual(np.linalg.eigvals(mixed.A), np.linalg.eigvals(pipeline.triple(n).A))


def _prce(given: _Given) -> float:
    """Eigenvalues of M_1 M_0# with the rows of the data matrix themselves, against the companion form's."""
    inputs = given.response.values.shape[2]
    degree = max(min(-(-given.order // inputs), 12), 1)
    rows = min(10 * _BLOCK_ROWS, given.response.count - degree - 1)
    given = given._replace(order=degree * inputs)
    companion = given.built("prce", form="controllable", block_columns=degree, block_rows=rows)
    M = companion.matrix.observable.tall().dense()
    M_0, M_1 = M[: degree * inputs], M[inputs : (degree + 1) * inputs]
    A = sla.lstsq(M_0.T, M_1.T)[0].T
    return pole_residual(np.linalg.eigvals(A), np.linalg.eigvals(companion.triple(degree * inputs).A))


#: Both sides of an identity, its source, and the check. From the third on both forms of a row are needed.
_CHECKS: tuple[tuple[str, str, Callable[[_Given], float]], ...] = (
    ("poles of ERA = nonzero poles of truncated least squares", "Eqs. 28 and 65", _era_and_least_squares),
    (
        "alternate = Galerkin projection of the polyreference companion form",
        "Eqs. 56 and 57",
        _alternate_and_polyreference,
    ),
    ("poles of ERA = poles of ERA on the transposed responses", "Eqs. 17 and 28", _dual),
    ("poles do not depend on the factorization of H(0)", "Eqs. 23 and 28, remark", _factorization),
    ("untruncated least squares = polyreference complex exponential", "Eqs. 53 and 66", _prce),
)

#: Rows of the table that an identity makes one estimator; the others relate one row to itself, or to a part of another.
_ONE_ESTIMATOR: dict[Callable[[_Given], float], tuple[str, ...]] = {_era_and_least_squares: ("era", "least_squares")}
