"""Define and check the options of the data matrices, one frozen type for each.

A row of the table names its type; `prepare` refuses an option that the type has not, with the rows that have it. What `Settings` says of
every result (band, channels left out, route, factorization) is in `modalscope.data.results`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Integral
from typing import Any, ClassVar, TypedDict

from numpy.typing import ArrayLike

from modalscope.data.geometry import Dof
from modalscope.data.results import Settings
from modalscope.identification.matrices.factor import FACTORIZATIONS
from modalscope.numerics.checks import check_band, check_count, check_each, check_kind, check_shifts, freeze
from modalscope.numerics.errors import check_choice

#: Routes from records into the table: "auto" follows the rule of `modalscope.identification.routes`, "correlation" is that of records
#: without inputs, also where they look like free decays.
ROUTES = ("auto", "records", "frf", "markov", "subspace", "decays", "correlation")


class AllOptions(TypedDict, total=False):
    """Every option that some row of the table has, for the verbs' keywords."""

    band: tuple[float, float] | None
    exclude: Any
    route: str | None
    delays: Mapping[str, int] | None
    reciprocal: bool | None
    factorization: str
    block_rows: int | None
    block_columns: int | None
    form: str | None
    reduction: str | None
    weights: str | ArrayLike | None
    initial_values: str | ArrayLike | None
    basis: str | None
    source: str | None
    references: Any
    weighting: str | None
    row_shifts: Any
    column_shifts: Any
    row_subsets: Any
    column_subsets: Any
    row_weights: ArrayLike | None
    column_weights: ArrayLike | None
    row_compression: ArrayLike | None
    column_compression: ArrayLike | None


#: Checks of sizes and shifts of blocks.
_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "block_rows": check_count,
    "block_columns": check_count,
    "row_shifts": check_shifts,
    "column_shifts": check_shifts,
}


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Options(Settings):
    """Options of every row; see `Settings`."""

    #: Why options of other data matrices do not apply.
    why_not: ClassVar[str] = ""

    def __post_init__(self) -> None:
        exclude: Any = self.exclude
        given = {name: value for name in _CHECKS if (value := getattr(self, name, None)) is not None}
        freeze(
            self,
            **{name: _CHECKS[name](name, value) for name, value in given.items()},
            band=None if self.band is None else check_band(self.band),
            exclude=None if exclude is None else labels_of(exclude),
            route=None if self.route is None else check_choice("route", self.route, ROUTES),
            reciprocal=None if self.reciprocal is None else reciprocity_of(self.reciprocal),
            factorization=check_choice("factorization", self.factorization, FACTORIZATIONS),
        )


def reciprocity_of(reciprocal: Any) -> bool:
    """Return whether inputs and outputs are exchanged."""
    check_kind("reciprocal", reciprocal, bool)
    return bool(reciprocal)


def labels_of(exclude: Any) -> tuple[Any, ...]:
    """Return channels as a tuple, also one label or index."""
    if isinstance(exclude, str | Integral | Dof):
        return (exclude,)
    return tuple(check_each("exclude", exclude, "labels"))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class HankelOptions(Options):
    """Of a Hankel matrix of samples; see `modalscope.identification.matrices.hankel`.

    `block_rows`, `block_columns`: blocks of H(0). `form`: which side the shift is read off. `reduction`: of the canonical form to minimum
    order. `row_shifts`, `column_shifts`, `row_subsets`, `column_subsets`, `row_weights`, `column_weights`, `row_compression`,
    `column_compression`: the matrix in its generality.
    """

    why_not = "this method works on samples"

    block_rows: int | None = None
    block_columns: int | None = None
    form: str | None = None
    reduction: str | None = None
    row_shifts: tuple[int, ...] | None = None
    column_shifts: tuple[int, ...] | None = None
    row_subsets: Any = None
    column_subsets: Any = None
    row_weights: Any = None
    column_weights: Any = None
    row_compression: Any = None
    column_compression: Any = None

    def __post_init__(self) -> None:
        Options.__post_init__(self)
        if self.form is not None:
            check_choice("form", self.form, ("observable", "controllable", "smaller"))

    @property
    def general(self) -> dict[str, Any]:
        """Options of the matrix beyond its size, by name."""
        names = [
            f"{side}_{what}" for what in ("shifts", "subsets", "weights", "compression") for side in ("row", "column")
        ]
        return {name: getattr(self, name) for name in names}

    @property
    def spans(self) -> tuple[int | None, int | None]:
        """Samples spanned by rows and columns, where given."""
        rows = self.block_rows if not self.row_shifts else max(self.row_shifts) + 1
        columns = self.block_columns if not self.column_shifts else max(self.column_shifts) + 1
        return rows, columns


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class LineOptions(Options):
    """Of a matrix of transfer functions, on lines or on those of a window of samples; see `transfer` and `shifted` of the matrices.

    `block_rows`: the degree of the polynomials. `block_columns`: samples in the window, with source="samples". `form`: "observable".
    `weights` (lines,).
    """

    why_not = "the columns of a frequency-domain matrix are lines"

    block_rows: int | None = None
    block_columns: int | None = None
    form: str | None = None
    weights: Any = None
    initial_values: Any = None
    basis: str | None = None
    source: str | None = None
    row_shifts: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        Options.__post_init__(self)
        if self.source is not None:
            check_choice("source", self.source, ("samples", "elimination"))
