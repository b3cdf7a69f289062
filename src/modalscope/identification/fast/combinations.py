"""Compress many outputs to few combinations of them by a randomized range, and identify through these.

With H = D X, D the outputs' scale, and orthonormal U (l, r) that spans the range of X, the responses U'X of r combinations hold what
any model of fewer states can explain, H = D U (U'X). What they do not hold, |X - U U'X|^2, is measured over all lines. The outputs come
some at a time, twice: once for a sketch of their rows, which shows the leading directions V of the columns, and once for X V and (X V)'X.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
import scipy.linalg as sla

from modalscope.data.notes import Note
from modalscope.data.response import Misfit, Response
from modalscope.data.responses import ImpulseResponse
from modalscope.data.stored import StoredResponse
from modalscope.identification.matrices.full import FullMatrix, OfCombinations, full
from modalscope.identification.matrices.matrix import DataMatrix, Eigen, ModalFit, Triple
from modalscope.numerics.checks import Array, RealArray, sealed
from modalscope.numerics.operators import real_times
from modalscope.numerics.orthonormal import orthonormal
from modalscope.numerics.resources import check_fits

#: A response of one kind or the other.
Some = TypeVar("Some", bound=Response)

#: Combinations in excess of the order: terms of the polynomials, and spare directions.
_EXTRA_COMBINATIONS = 40

#: Minimum ratio of outputs to combinations at which combining saves time.
_MIN_OUTPUTS_PER_COMBINATION = 3

#: Rows of the sketch for every combination: eight discard as much as a range of two powers, sixteen hardly more than the best range.
_SKETCH_ROWS_PER_COMBINATION = 16

#: Power iterations for the range of the sketch, which is small.
_RANGE_POWERS = 2

#: Count of numbers of the data processed at a time.
_BLOCK_NUMBERS = 1_000_000

#: Below this share of the energy the discarded part is computed directly: the difference of sums would be rounding.
_MIN_DISCARDED_SHARE = 1e-10

#: Directions below this fraction of the first are rounding.
_ROUNDING = 1e-12


def enough(outputs: int, order: int) -> int | None:
    """Return how many combinations serve models up to an order; None where there are hardly more outputs than that.

    Examples
    --------
    >>> enough(1000, 80), enough(300, 80)
    (120, None)
    """
    count = order + _EXTRA_COMBINATIONS
    return count if outputs >= _MIN_OUTPUTS_PER_COMBINATION * count else None


@dataclass(frozen=True, eq=False)
class Combinations:
    """A response of r combinations of l outputs (made by `combinations`).

    `response`: U'X. `U` (l, r). `scale` (l,): the diagonal of D. `discarded`: |X - U U'X|^2 / |X|^2.
    """

    response: Response
    U: RealArray
    scale: RealArray
    discarded: float

    def spread(self, shapes: Array) -> Array:
        """Return D U c: shapes, or anything else of the combinations, (r, ...), for all outputs."""
        few = shapes.reshape(len(shapes), -1)
        values = real_times(self.U, few)
        values *= self.scale[:, None]
        return sealed(values.reshape(-1, *shapes.shape[1:]))

    def whole(self, measured: Response, matrix: DataMatrix) -> CombinedOutputs:
        """Return the matrix of the combinations as that of all outputs. `measured`: their response."""
        return CombinedOutputs(measured, self, full(matrix))

    @property
    def words(self) -> str:
        """What was done, in words."""
        outputs, count = self.U.shape
        return f"{outputs} outputs through {count} combinations, {self.discarded:.2g} of their energy discarded"


class OutputRows(Protocol):
    """Responses whose outputs come some at a time."""

    @property
    def outputs(self) -> int:
        """How many there are."""

    @property
    def columns(self) -> int:
        """Real numbers of one output: of every line or sample, input by input."""

    def parts(self) -> Iterator[tuple[slice, RealArray]]:
        """Yield which outputs, and their numbers as rows, (outputs, columns): an array that may be changed."""


class Found(NamedTuple):
    """What combinations are made of.

    `U` (l, r): no rows where it was not kept. `columns` (r, columns): U'X. `scale` (l,). `discarded`: |X - U U'X|^2 / |X|^2.
    """

    U: RealArray
    columns: RealArray
    scale: RealArray
    discarded: float


def combinations(response: Response, count: int, seed: int = 0) -> Combinations:
    """Return the response of `count` combinations of the outputs, which hold nearly all of its energy; fewer where the rank is smaller.

    `count`: r. `seed`: of the sketch; the result depends on it little.
    """
    rows = _InMemory(response.values)
    chosen = found_combinations(rows, count, seed)
    values = rows.as_response(chosen.columns)
    wanted = response.variance is not None or getattr(response, "feedthrough", None) is not None
    few = labelled(response, values, chosen.U / chosen.scale[:, None] if wanted else None, len(chosen.columns))
    return Combinations(few, chosen.U, chosen.scale, chosen.discarded)


def fewer_outputs(response: Response, order: int, options: Any) -> Combinations | None:
    """Return combinations of the outputs where these far exceed the states, by default; of correlations none."""
    count = enough(len(response.output_dofs), order)
    wanted = options.factorization == "auto" and not response.ambient
    return combinations(response, count) if count is not None and wanted else None


def found_combinations(rows: OutputRows, count: int, seed: int = 0, *, keep: bool = True) -> Found:
    """Return r combinations of outputs that come some at a time, in two passes over them.

    `count`: r. `seed`: of the sketch. `keep`: whether U, which has a row per output, is wanted.

    References
    ----------
    Halko, Martinsson and Tropp, "Finding structure with randomness", SIAM Review 53 (2011); Rokhlin and Tygert, "A fast randomized
    algorithm for overdetermined linear least-squares regression", PNAS 105 (2008), for the sketch that conditions X V.
    """
    V = _directions(_sketch(rows, _SKETCH_ROWS_PER_COMBINATION * count, seed), count, seed)
    r = V.shape[1]
    Y, scale = np.empty((rows.outputs if keep else 0, r)), np.empty(rows.outputs)
    products, gram, energy = np.zeros((r, rows.columns)), np.zeros((r, r)), 0.0
    for part, X in rows.parts():
        scale[part] = _level(X)
        energy += float(np.vdot(X, X))
        y = X @ V
        products += y.T @ X
        gram += y.T @ y
        if keep:
            Y[part] = y
    # the sketch has made X V nearly orthonormal
    inverse = np.asarray(sla.solve_triangular(sla.cholesky(gram, check_finite=False), np.eye(r), check_finite=False))
    columns = inverse.T @ products
    step = max(_BLOCK_NUMBERS // r, 1)
    for start in range(0, len(Y), step):
        Y[start : start + step] @= inverse
    missing = 1 - float(np.vdot(columns, columns)) / energy
    if missing < _MIN_DISCARDED_SHARE and keep:
        missing = sum(_left_by(X / scale[part, None], Y[part], columns) for part, X in rows.parts()) / energy
    return Found(Y, columns, scale, max(missing, 0.0))


def _left_by(X: RealArray, U: RealArray, columns: RealArray) -> float:
    """Return |X - U U'X|^2 of some rows."""
    X -= U @ columns
    return float(np.vdot(X, X))


def _level(X: RealArray) -> RealArray:
    """Bring rows to a root mean square of one, in place, and return what they had; 1 for rows of zeros."""
    scale = np.sqrt(np.einsum("lk,lk->l", X, X) / X.shape[1])
    scale = np.where(scale > 0, scale, 1.0)
    X /= scale[:, None]
    return np.asarray(scale)


def _sketch(rows: OutputRows, count: int, seed: int) -> RealArray:
    """Return sums of the level rows with random signs, each row in one of `count` sums; the rows themselves where they are fewer."""
    rng, total = np.random.default_rng(seed), np.zeros((min(count, rows.outputs), rows.columns))
    for part, X in rows.parts():
        _level(X)
        X *= rng.choice([-1.0, 1.0], len(X))[:, None]
        place = np.arange(part.start, part.stop) % len(total)
        for start in range(0, len(X), len(total)):
            total[place[start : start + len(total)]] += X[start : start + len(total)]
    return total


def _directions(sketch: RealArray, count: int, seed: int) -> RealArray:
    """Return leading directions of the columns, (columns, r), such that the sketch times them is orthonormal."""
    V = np.random.default_rng(seed).standard_normal((sketch.shape[1], min(count, *sketch.shape)))
    for _ in range(_RANGE_POWERS + 1):
        V = orthonormal(sketch.T @ orthonormal(sketch @ V))
    _, d, turn = np.linalg.svd(sketch @ V, full_matrices=False)
    kept = d > _ROUNDING * d[0]
    return np.asarray(V @ (turn[kept].T / d[kept]))


def labelled(response: Some, values: Array, back: RealArray | None, count: int) -> Some:
    """Return the combinations' response: what belongs to single outputs has no meaning for them, but variances add up.

    `response`: what it is made of. `values` (K, r, m). `back` (l, r): what the outputs are multiplied with; without it there must be no
    variance and no direct term. `count`: r.
    """
    changed: dict[str, Any] = {
        "values": values,
        "output_dofs": tuple(f"combination {k + 1}" for k in range(count)),
        "units": (("",) * count, response.units[1]),
        "geometry": None,
    }
    for name in ("variance", "coherence"):
        if getattr(response, name, None) is not None:
            changed[name] = None
    variance = response.variance
    if variance is not None and back is not None:
        changed["variance"] = np.einsum("or,kom->krm", back**2, variance, optimize=True)
    feedthrough = getattr(response, "feedthrough", None)
    if feedthrough is not None and back is not None:
        changed["feedthrough"] = back.T @ feedthrough
    return replace(response, **changed)


class _InMemory:
    """Values (K, l, m) in memory, complex numbers as two real ones."""

    def __init__(self, values: Array) -> None:
        self.values = values
        self.count, self.outputs, inputs = values.shape
        self.each = inputs * (2 if np.iscomplexobj(values) else 1)
        self.columns = self.count * self.each

    def parts(self) -> Iterator[tuple[slice, RealArray]]:
        """Yield outputs as rows; see `OutputRows`."""
        step = max(_BLOCK_NUMBERS // self.columns, 1)
        for start in range(0, self.outputs, step):
            part = self.values[:, start : start + step]
            some = np.empty((part.shape[1], self.count, part.shape[2]), dtype=part.dtype)
            for i in range(part.shape[2]):  # input by input: numpy copies pairs of numbers slowly
                some[:, :, i] = part[:, :, i].T
            yield slice(start, start + len(some)), some.view(np.float64).reshape(len(some), -1)

    def as_response(self, columns: RealArray) -> Array:
        """Return columns U'X as lines or samples of r outputs, (K, r, m)."""
        values = np.ascontiguousarray(columns.reshape(-1, self.count, self.each).transpose(1, 0, 2))
        return values.view(complex) if np.iscomplexobj(self.values) else values


@dataclass(frozen=True, eq=False)
class CombinedOutputs(OfCombinations):
    """A data matrix of combinations U'D^-1 H, whose models are taken back by D U: one product gives the shapes of all outputs.

    `response`: as it was measured. `inner`: of the combinations.
    """

    response: Response
    few: Combinations
    inner: FullMatrix

    @property
    def judged(self) -> Response:
        """The response of all outputs; of long records the lines that tell."""
        return self.response.judging()

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return len(self.few.U)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        return f"{self.inner.describe()}; {self.few.words}"

    def of_all_outputs(self, model: Triple) -> Triple:
        """Return the model of all outputs."""
        return replace(model, C=self.few.spread(model.C))

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return the fit to the combinations, its shapes and terms spread over all outputs; what was discarded is left as well."""
        fit = self.inner.fit(model, eigen)
        misfit = self._missed(eigen, fit) if fit.misfit is None else fit.misfit
        discarded = self.few.discarded
        return replace(
            fit,
            shapes=self.few.spread(fit.shapes),
            terms=self.few.spread(fit.terms.transpose(1, 0, 2)).transpose(1, 0, 2),
            basis=None,
            fitted=replace(fit, basis=None),
            misfit=float(np.sqrt((1 - discarded) * misfit**2 + discarded)),
        )

    def _missed(self, eigen: Eigen, fit: ModalFit) -> float:
        basis = fit.basis or self.few.response.basis(self.to_s(eigen.values), fit.powers)
        return self._misfit.of_modes(basis, fit.shapes, fit.participation, fit.terms)

    @cached_property
    def _misfit(self) -> Misfit:
        response = self.few.response
        return Misfit(response, np.ones(response.values.shape[1]))


#: Combinations of a stored response: enough for diagrams of eighty states.
COUNT = 120

#: Simultaneous copies of the sketch in memory.
_COPIES_OF_SKETCH = 3


@dataclass(frozen=True)
class _Rows:
    """A stored response as rows of outputs; see `OutputRows`."""

    stored: StoredResponse

    @property
    def outputs(self) -> int:
        """How many there are."""
        return len(self.stored.output_dofs)

    @property
    def columns(self) -> int:
        """Samples of one output, input by input."""
        return self.stored.samples * len(self.stored.input_dofs)

    def parts(self) -> Iterator[tuple[slice, RealArray]]:
        """Yield outputs as rows."""
        return self.stored.parts()


def combined(stored: StoredResponse, count: int = COUNT) -> tuple[ImpulseResponse, Note]:
    """Return the response of combinations of the outputs, and the discarded part.

    Poles, participation and everything that is judged over all outputs together are those of the whole; shapes belong to the
    combinations, see `modalscope.identification.modal.full_field`.

    `count`: how many.

    Raises `DataError`: samples that do not read, or a sketch that is too large for the memory.
    """
    rows = _Rows(stored)
    check_fits(
        f"combinations of {rows.outputs} outputs of {rows.columns} samples each",
        8.0 * _COPIES_OF_SKETCH * 16 * count * rows.columns,
        "Store fewer samples.",
    )
    chosen = found_combinations(rows, count, keep=False)
    few = len(chosen.columns)
    values: RealArray = chosen.columns.reshape(few, stored.samples, -1).transpose(1, 0, 2)
    text = (
        f"{rows.outputs} stored outputs are reduced to {few} combinations, which leave out {chosen.discarded:.2g} of their energy; "
        "full_field gives the shapes of all of them"
    )
    note = Note("combinations", {"outputs": rows.outputs, "combinations": few, "discarded": chosen.discarded}, text)
    return labelled(stored.part(0, 1), values, None, few), note
