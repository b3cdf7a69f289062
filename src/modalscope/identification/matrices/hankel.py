"""Block Hankel matrices of Markov parameters: block (j, i) of H(k) is Y(j + k + i) = C A^j A^k A^i B (Eq. 17).

The rows of the table on samples build theirs here, with default sizes. Structure makes products with it cheap: see
`modalscope.identification.fast.structured_hankel`. Blocks that are chosen, weighted or combined are in
`modalscope.identification.matrices.general_hankel`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.responses import ImpulseResponse
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, DerivedMatrix, Eigen, ModalFit, RowShift, Triple
from modalscope.identification.method import Built, Problem, fewer_outputs
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import to_continuous, to_discrete
from modalscope.numerics.handed import replaceable
from modalscope.numerics.operators import DenseMatrix, Operator

#: The short side of a truncation spans one in so many samples: a sixth, see `default_windows`.
SHORT_SIDE_SHARE = 6

#: Maximum number of rows on the short side of a Hankel matrix of samples, and on the long side.
_MAX_SHORT_ROWS, _MAX_LONG_ROWS = 33_000, 67_000

#: Variances within this factor count as equal.
_SAME_PRECISION = 2.0

#: Maximum number of states of a companion form, whose eigenvalues cost their cube.
MAX_COMPANION_STATES = 240

#: Block rows and columns of a response for a largest order, where either is not given.
_Sizes = Callable[[ImpulseResponse, int, int | None, int | None], tuple[int, int]]


# ------------------------------------------------------------------------------------------------------ of a row's problem


def plain_hankel(problem: Problem, order: int) -> Built:
    """Return the Hankel matrix of samples, by default in observable form."""
    form = problem.options.form
    return _built(problem, order, form == "controllable" or (form == "smaller" and _fewer_inputs(problem)))


def canonical_hankel(problem: Problem, order: int) -> Built:
    """Return the Hankel matrix whose companion form has fewer states, by default."""
    form = problem.options.form
    turned = form == "controllable" or (form != "observable" and _fewer_inputs(problem))
    return _built(problem, order, turned, companion_windows)


def complete_hankel(problem: Problem, order: int) -> Built:
    """Return the Hankel matrix of a form without truncation, with as many blocks as the order has."""
    form = problem.options.form
    turned = form in (None, "controllable") or (form == "smaller" and _fewer_inputs(problem))
    return _built(problem, order, turned, complete_blocks)


def _fewer_inputs(problem: Problem) -> bool:
    """Whether the side of the inputs is the smaller one; by channels where sizes are not given."""
    _, outputs, inputs = problem.response.values.shape
    rows, columns = problem.options.block_rows, problem.options.block_columns
    return bool(inputs < outputs if rows is None or columns is None else inputs * columns < outputs * rows)


def _built(problem: Problem, order: int, turned: bool, states: _Sizes | None = None) -> Built:
    """Return the matrix with its sizes; `states`: of a companion form, the side of whose states is the one that the order counts."""
    options, measured = problem.options, problem.response
    assert isinstance(measured, ImpulseResponse)
    general = {name: value for name, value in options.general.items() if value is not None}
    few = None if general else fewer_outputs(measured, order, options)
    response: ImpulseResponse = measured if few is None else few.response
    rows, columns = options.spans
    if turned and states is not None:
        columns, rows = states(transposed(response), order, columns, rows)
    else:
        rows, columns = (states or default_windows)(response, order, rows, columns)
    settings = replace(options, block_rows=rows, block_columns=columns, form="controllable" if turned else "observable")
    response, notes = lags_read(response, rows + columns)
    matrix = (turned_hankel if turned else hankel)(response, block_rows=rows, block_columns=columns, **general)
    return Built(matrix if few is None else few.whole(measured, matrix), settings, notes)


def lags_read(response: ImpulseResponse, read: int) -> tuple[ImpulseResponse, tuple[Note, ...]]:
    """Return a correlation without the lags that no block contains."""
    if response.kind != "correlation" or response.samples <= read:
        return response, ()
    note = Note("lags used", {"used": read, "there": response.samples}, f"{read} of {response.samples} lags are used")
    return replace(response, values=response.values[:read]), (note,)


def transposed(response: ImpulseResponse) -> ImpulseResponse:
    """Return the response with inputs and outputs in each other's places."""
    return replace(
        response,
        values=response.values.transpose(0, 2, 1),
        feedthrough=None,
        output_dofs=tuple(f"in {dof}" for dof in response.input_dofs),
        input_dofs=tuple(f"out {dof}" for dof in response.output_dofs),
        units=response.units[::-1],
        groups=None,
    )


# ---------------------------------------------------------------------------------------------------------- default sizes


@replaceable("cheaper_windows")
def cheaper_windows(
    response: ImpulseResponse, order: int, lying: tuple[int, int], standing: tuple[int, int]
) -> tuple[int, int]:
    """Return block sizes of equal precision that cost least: without structure those whose rows are the short side.

    `lying`: sizes whose rows are the short side. `standing`: those whose columns are.
    """
    return lying


def default_windows(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return block sizes of a truncation: one side spans a sixth of the samples, the other all the rest.

    With r blocks on the shorter side and s on the longer one, the pole of a mode that does not fade is the difference of two means over r
    samples that lie s apart, whichever side is which: its variance is N^3 / (6 r s^2) times the least that N samples allow. That is 1.125
    at a third, 1.44 at a sixth (deviations 1.2 times the least) and 5.4 at a thirtieth of the samples; samples that are not read cost the
    power of three. Where a mode fades the vectors on both sides fade with it, so that blocks beyond its life add no noise of first
    order, and the bound itself is reached. Three times as many rows, or columns, as states at
    least, as far as half of the samples give them.

    Rows are the short side, whose shapes tell close modes apart, unless columns there cost less: of many outputs the Gram matrix of a
    short side of inputs is a small one. Of T rows and columns in all, l r + m s, a third belongs to the short side, where r s^2 is
    largest; of very long records that are held to it, the way is taken that is twice as precise. What is given is kept, and the other
    side reads the rest. Correlations have errors that do not fade; see `default_blocks`.

    `block_rows`, `block_columns`: as given.
    """
    if response.ambient:
        return default_blocks(response, order, block_rows, block_columns)
    samples, outputs, inputs = response.values.shape
    lying = _spans(samples, (outputs, inputs), order, (block_rows, block_columns))
    standing = _spans(samples, (inputs, outputs), order, (block_columns, block_rows))[::-1]
    if block_rows is not None or block_columns is not None:
        return lying if block_rows is not None else standing
    rough, precise = sorted((lying, standing), key=_precision)
    if _precision(rough) * _SAME_PRECISION <= _precision(precise):
        return precise
    return cheaper_windows(response, order, lying, standing)


def _precision(sizes: tuple[int, int]) -> float:
    """Return r s^2, r the shorter and s the longer side: one over the variance of a pole, but for a factor."""
    return float(min(sizes) * max(sizes) ** 2)


def _spans(
    samples: int,
    channels: tuple[int, int],
    order: int,
    given: tuple[int | None, int | None],
    most: int = _MAX_SHORT_ROWS,
) -> tuple[int, int]:
    """Return blocks on the short side and on the long one, of so many channels each; `most` rows in all on the short side."""
    short, long = given
    least = min(max(-(-3 * order // channels[0]), 10), max(samples // 2, 1))
    room = samples if long is None else max(samples - long, 1)
    short = short or min(max(min(samples // SHORT_SIDE_SHARE, most // channels[0]), least), room)
    return short, long or max(min(samples - short, max(_MAX_LONG_ROWS // channels[1], short)), 1)


def companion_windows(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return those of a truncation whose block rows are all states, 240 of them at most, or three times the order."""
    if response.ambient:
        return default_blocks(response, order, block_rows, block_columns)
    samples, *channels = response.values.shape
    return _spans(samples, (channels[0], channels[1]), order, (block_rows, block_columns), MAX_COMPANION_STATES)


def default_blocks(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return block sizes of correlations, and of regressions without truncation, into which noise comes in squares.

    Three times as many rows as states, and the rest of the samples, up to twenty times, as columns. Both are at least ten blocks where
    the samples allow it. Correlations get four times as many columns as rows and at least eighty: their errors do not fade with the lag
    as the modes do, so that long ones harm.
    """
    samples, outputs, inputs = response.values.shape
    room = samples if block_columns is None else max(samples - block_columns, 1)
    rows = block_rows or min(max(-(-3 * order // outputs), 10), max(samples // 2, 1), room)
    ample = max(4 * rows, 80) if response.ambient else max(-(-20 * order // inputs), rows, 10)
    columns = block_columns or max(min(samples - rows, ample), 1)
    return rows, columns


def complete_blocks(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return those whose block rows hold as many rows as the order has states."""
    return default_blocks(response, order, block_rows or -(-order // response.values.shape[1]), block_columns)


# ------------------------------------------------------------------------------------------------------------- the matrix


def fit_of_samples(response: ImpulseResponse, model: Triple, eigen: Eigen) -> ModalFit:
    """Return shapes C X, participation X^-1 B referred to the impulse (Eqs. 15-16), and the direct term."""
    assert model.B is not None
    participation = eigen.left @ model.B
    if response.first_sample:
        participation = participation / eigen.values[:, None] ** response.first_sample
    feedthrough = response.feedthrough
    direct = np.zeros(response.values.shape[1:]) if feedthrough is None else feedthrough
    return ModalFit(np.asarray(model.C @ eigen.vectors), participation, direct[None])


class SampledMatrix(DataMatrix):
    """Block rows are samples, one after the other."""

    @property
    @abstractmethod
    def dt(self) -> float:
        """Sampling interval, seconds."""

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles ln(z) fs, rad/s."""
        return to_continuous(poles, self.dt)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles of the sampled system, exp(s / fs)."""
        return to_discrete(poles, self.dt)


@dataclass(frozen=True, eq=False)
class Hankel(SampledMatrix):
    """A block Hankel matrix of whole consecutive blocks (made by `hankel`).

    `blocks`: r and s, block rows and columns of H(0).
    """

    response: ImpulseResponse
    blocks: tuple[int, int]

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0)."""
        return self.blocks[0]

    @property
    def block_columns(self) -> int:
        """Blocks in a row of H(0)."""
        return self.blocks[1]

    @property
    def dt(self) -> float:
        """Sampling interval, seconds."""
        return 1 / self.response.sampling_rate

    def _of_rows(self, first: int, rows: int) -> DenseMatrix:
        """Return block rows Y(first + i), Y(first + i + 1), ... of all columns."""
        i, j = np.ogrid[first : first + rows, : self.block_columns]
        blocks = self.response.values[i + j].transpose(0, 2, 1, 3)
        return DenseMatrix(blocks.reshape(rows * blocks.shape[1], -1))

    def shifted(self, k: int) -> Operator:
        """Return H(k)."""
        return self._of_rows(k, self.block_rows)

    def tall(self) -> Operator:
        """Return H(0) with one more block row, the rows of H(0) and of H(1) together."""
        return self._of_rows(0, self.block_rows + 1)

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1 for factors of `tall()`."""
        return RowShift.by_block(self.outputs, self.block_rows)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return E_l' H(k) X: C = E_l' H(0) Q d^-1/2 (Eqs. 28, 39)."""
        row = self.response.values[k : k + self.block_columns].transpose(0, 2, 1)
        return np.asarray(row.reshape(-1, self.outputs).T @ right)

    def first_block_column(self, *, tall: bool = False) -> RealArray:
        """Return H(0) E_m, or that of `tall()`: B of the companion forms (Eqs. 53, 54, 65)."""
        return self.response.values[: self.block_rows + tall].reshape(-1, self.response.values.shape[2])

    def first_columns(self, factors: Factors) -> RealArray:
        """Return X (m, k) such that B = d^1/2 X' (Eqs. 28, 37): the first rows of Q."""
        return factors.Q[: self.response.values.shape[2]]

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X and participation X^-1 B, referred to the impulse (Eqs. 15-16)."""
        return fit_of_samples(self.response, model, eigen)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        _, outputs, inputs = self.response.values.shape
        return f"Hankel matrix of {self.block_rows} x {self.block_columns} blocks of {outputs} x {inputs}"


@dataclass(frozen=True, eq=False)
class TurnedHankel(DerivedMatrix):
    """A Hankel matrix of the transposed response, whose models are turned back: (A, B, C) -> (A', C', B').

    `response`: as it was measured. `inner`: of the transposed response.
    """

    response: ImpulseResponse
    inner: Any

    @property
    def observable(self) -> Any:
        """The Hankel matrix of the transposed response, which is factored."""
        return self.inner

    @property
    def block_rows(self) -> int:
        """Blocks on the side of the outputs."""
        return int(self.inner.block_columns)

    def model(self, triple: Triple) -> Triple:
        """Return the model with inputs and outputs in their own places."""
        return triple.dual()

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X and participation X^-1 B, referred to the impulse."""
        return fit_of_samples(self.response, model, eigen)


@replaceable("hankel")
def hankel(response: ImpulseResponse, *, block_rows: int, block_columns: int, **general: Any) -> Hankel:
    """Return H(0) and H(1) of Markov parameters (samples, outputs, inputs), of which block_rows + block_columns are read.

    `general`: what a `general_hankel` has beyond its size.

    Raises `DataError`: a response that is too short.
    """
    need, samples = block_rows + block_columns, response.samples
    if need > samples or general:
        what = ", ".join(general) or f"samples 0 to {need - 1}"
        have = f"the response has {samples}" if need > samples else "a plain matrix has whole consecutive blocks"
        raise DataError(f"a Hankel matrix of {what}:", have, "Lower block_rows + block_columns, or omit options.")
    return Hankel(response, (block_rows, block_columns))


@replaceable("turned_hankel")
def turned_hankel(response: ImpulseResponse, *, block_rows: int, block_columns: int, **general: Any) -> TurnedHankel:
    """Return the matrix of the transposed response, whose rows are the columns of that of the response."""
    inner = hankel(transposed(response), block_rows=block_columns, block_columns=block_rows, **general)
    return TurnedHankel(response, inner)
