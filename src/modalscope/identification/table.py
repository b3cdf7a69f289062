"""List the table of methods: a method is a data matrix and a realization.

These rows are those of the founding report; others are in `modalscope.identification.table_beyond`, and in packages that add theirs. Adding
a method is adding a row and, when its data matrix or its realization is new, one short module in `matrices/` or `realizations/`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any, NamedTuple

from modalscope.identification.matrices.factor import complete_factors, h0_factors, tall_factors
from modalscope.identification.matrices.hankel import canonical_hankel, complete_hankel, plain_hankel
from modalscope.identification.matrices.lines import transfer_of_lines, transfer_of_response
from modalscope.identification.method import BLOCKS, COMPANIONS, STATES, Method, Takes
from modalscope.identification.options import HankelOptions, LineOptions
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.companion import least_squares_companion, null_space_companion
from modalscope.identification.realizations.regression import regression
from modalscope.identification.realizations.shift import shift
from modalscope.numerics.errors import DataError
from modalscope.numerics.handed import replaceable

#: Fields of `Method` that a column of the table fixes, for rows whose realization suits every data matrix.
_COLUMNS: dict[str, dict[str, Any]] = {
    "time": {
        "takes": Takes.SAMPLES,
        "matrix": plain_hankel,
        "options_type": HankelOptions,
        "forms": ("observable", "controllable"),
    },
    "z": {"takes": Takes.RESPONSE, "matrix": transfer_of_response, "options_type": LineOptions},
    "s": {"takes": Takes.CONTINUOUS, "matrix": transfer_of_lines, "options_type": LineOptions},
}


class _Cell(NamedTuple):
    """Section of the report and names of one cell."""

    section: str
    common: str
    known_as: tuple[str, ...]
    aliases: tuple[str, ...] = ()


def _row(name: str, cells: dict[str, _Cell], in_time: Any = plain_hankel, **shared: Any) -> Iterator[Method]:
    """Yield the cells of one row of the table by domain; `in_time`: its Hankel matrix in the time domain."""
    for domain, cell in cells.items():
        column = _COLUMNS[domain] | ({"matrix": in_time} if domain == "time" else {})
        yield Method(name=name, domain=domain, **cell._asdict(), **column, **shared)


#: A data matrix in the columns, a realization in the rows.
ROWS: tuple[Method, ...] = (
    *_row(
        "era",
        {
            "time": _Cell(
                "II-3, Eqs. 24-41",
                "ERA",
                ("ERA", "Ho-Kalman", "ERA/DC with column_compression=H(0)", "NExT-ERA on correlations"),
                ("ho-kalman", "next-era", "eigensystem realization algorithm", "projected-dmd"),
            ),
            "z": _Cell("III-2, Eqs. 82-88", "ERA-FD", ("ERA-FD",), ("era-fd",)),
            "s": _Cell("III-2, Eqs. 89-94", "ERA-FD", ("ERA-FD, continuous",), ("era-fd continuous",)),
        },
        realization="balanced projection",
        realize=balanced,
        factor=h0_factors,
        orders=STATES,
    ),
    *_row(
        "polyreference",
        {
            "time": _Cell(
                "II-4, Eqs. 42-54",
                "Polyreference",
                ("polyreference, canonical-form realization",),
                ("canonical-form realization",),
            ),
            "z": _Cell("III-3, Eqs. 95-101", "Polyreference FD", ("polyreference FD",), ("polyreference-fd",)),
            "s": _Cell(
                "III-3, Eqs. 102-109",
                "Polyreference FD",
                ("polyreference FD, continuous", "direct parameter identification"),
                ("dpi", "direct parameter identification"),
            ),
        },
        in_time=canonical_hankel,
        realization="null space, companion form",
        realize=null_space_companion,
        factor=tall_factors,
        orders=COMPANIONS,
    ),
    *_row(
        "alternate",
        {
            "time": _Cell(
                "II-5, Eqs. 55-64",
                "SSI-cov",
                ("SSI-cov on correlations", "Kung", "LS-ESPRIT", "ERA without H(1)", "optimized DMD when refined"),
                (
                    "ssi-cov",
                    "cov-ssi",
                    "kung",
                    "ls-esprit",
                    "esprit",
                    "tls-dmd",
                    "total-least-squares dmd",
                    "optimized-dmd",
                ),
            ),
            "z": _Cell("III-4, Eq. 110", "FD-subspace", ("alternate FD",), ("alternate-fd",)),
            "s": _Cell(
                "III-4, Eq. 110",
                "FD-subspace",
                ("alternate FD, continuous", "frequency-domain subspace identification"),
                ("fd-subspace", "frequency-domain subspace identification"),
            ),
        },
        realization="shift of one factor",
        realize=shift,
        factor=tall_factors,
        orders=STATES,
    ),
    *_row(
        "least_squares",
        {
            "time": _Cell(
                "II-6, Eqs. 65-66",
                "ITD",
                ("least squares regression, truncated", "ITD (Ibrahim), truncated", "delay-embedded DMD"),
                ("itd", "ibrahim", "ibrahim time domain", "dmd", "exact-dmd", "delay-embedded dmd", "hankel-dmd"),
            ),
            "z": _Cell("left to the reader", "Least squares", ("least squares FD",), ("least-squares-fd",)),
            "s": _Cell(
                "left to the reader", "Least squares", ("least squares FD, continuous", "first-order form, Eq. 109")
            ),
        },
        realization="regression on H(0)",
        realize=regression,
        factor=h0_factors,
        orders=STATES,
    ),
)

#: Least squares without truncation, in companion form.
PRCE = Method(
    name="prce",
    domain="time",
    realization="least squares, companion form",
    section="II-4 and II-6, Eqs. 53b, 66",
    common="PRCE",
    known_as=(
        "PRCE, polyreference complex exponential",
        "LSCE with one input",
        "Prony with one channel",
        "ITD (Ibrahim) with one input, form='observable'",
    ),
    aliases=("lsce", "prony", "polyreference complex exponential", "ptd"),
    takes=Takes.SAMPLES,
    matrix=complete_hankel,
    factor=complete_factors,
    realize=least_squares_companion,
    orders=BLOCKS,
    options_type=HankelOptions,
    forms=("controllable", "observable"),
    from_records="frf",
)


@replaceable("find_method")
def find_method(name: str, domain: str | None, default_domain: str, route: str | None = None) -> Method:
    """Return the cell of a row and a domain, by default that of the data; names of the literature are in `method_names`.

    Raises `DataError`: there is none.
    """
    cells = {row.domain: row for row in (*ROWS, PRCE) if row.name == name}
    domain = domain or (default_domain if default_domain in cells else next(iter(cells), ""))
    if domain not in cells:
        have = ", ".join(dict.fromkeys(row.name for row in (*ROWS, PRCE)))
        raise DataError(f"method={name!r} in domain {domain!r} was asked", f"there are {have}", "Choose one of these.")
    return cells[domain]


@replaceable("rows_with")
def rows_with(option: str) -> list[str]:
    """Return the rows that have an option, in words."""
    return [str(row) for row in (*ROWS, PRCE) if option in {f.name for f in fields(row.options_type)}]
