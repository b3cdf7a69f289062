"""Define and check the options of the data matrices of records, of matrix fractions and of Loewner matrices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modalscope.identification.options import Options
from modalscope.numerics.errors import check_choice


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class FractionOptions(Options):
    """Of a matrix fraction; see `modalscope.identification.matrices.fraction`.

    `form`: "controllable". `weights` (lines,).
    """

    why_not = "a matrix fraction is fitted to all lines and has no blocks"

    form: str | None = None
    weights: Any = None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class PointOptions(Options):
    """Of a Loewner matrix; see `modalscope.identification.matrices.loewner`.

    `form`: "observable". `weights` (lines,).
    """

    why_not = "a Loewner matrix interpolates the lines themselves"

    form: str | None = None
    weights: Any = None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class DrivenOptions(Options):
    """Of records with inputs projected on their past; see `modalscope.identification.matrices.driven`.

    `block_rows`, `block_columns`: blocks of the future and of the past. `form`: "observable".
    """

    why_not = "a projection of records has whole, equal blocks of samples"

    block_rows: int | None = None
    block_columns: int | None = None
    form: str | None = None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class RecordOptions(DrivenOptions):
    """Of records projected on their past; see `modalscope.identification.matrices.projections`.

    `block_rows`, `block_columns`: blocks of the future and of the past. `form`: "observable". `references`: outputs of the past;
    all by default. `weighting`: "cva": both sides are whitened, so that the singular values are canonical correlations.
    """

    references: Any = None
    weighting: str | None = None

    def __post_init__(self) -> None:
        DrivenOptions.__post_init__(self)
        if self.weighting is not None:
            check_choice("weighting", self.weighting, ("cva",))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class SpectraOptions(Options):
    """Of records on lines; see `modalscope.identification.matrices.records`.

    `block_rows`: the degree of the polynomials. `form`: "observable".
    """

    why_not = "the columns of records on lines are all lines of whole runs"

    block_rows: int | None = None
    form: str | None = None
