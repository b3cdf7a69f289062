"""List the table of methods: a method is a data matrix and a realization.

These rows are those of the founding report; others are in `modalscope.identification.table_beyond`, and in packages that add theirs. Adding
a method is adding a row and, when its data matrix or its realization is new, one short module in `matrices/` or `realizations/`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

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
    "time": {"takes": Takes.SAMPLES, "options_type": HankelOptions, "forms": ("observable", "controllable")},
    "z": {"takes": Takes.RESPONSE, "matrix": transfer_of_response, "options_type": LineOptions},
    "s": {"takes": Takes.CONTINUOUS, "matrix": transfer_of_lines, "options_type": LineOptions},
}


def _row(name: str, realization: str, sections: dict[str, str], **stages: Any) -> Iterator[Method]:
    """Yield the cells of one row of the table, by domain the sections of the report; a data matrix among the stages is that of samples."""
    of_samples = stages.pop("matrix", plain_hankel)
    for domain, section in sections.items():
        column = _COLUMNS[domain] | ({"matrix": of_samples} if domain == "time" else {})
        yield Method(name=name, domain=domain, realization=realization, section=section, **column, **stages)


#: A data matrix in the columns, a realization in the rows; names of the literature are in `modalscope.identification.method_names`.
ROWS: tuple[Method, ...] = (
    *_row(
        "era",
        "balanced projection",
        {"time": "II-3, Eqs. 24-41", "z": "III-2, Eqs. 82-88", "s": "III-2, Eqs. 89-94"},
        factor=h0_factors,
        realize=balanced,
        orders=STATES,
    ),
    *_row(
        "polyreference",
        "null space, companion form",
        {"time": "II-4, Eqs. 42-54", "z": "III-3, Eqs. 95-101", "s": "III-3, Eqs. 102-109"},
        matrix=canonical_hankel,
        factor=tall_factors,
        realize=null_space_companion,
        orders=COMPANIONS,
    ),
    *_row(
        "alternate",
        "shift of one factor",
        {"time": "II-5, Eqs. 55-64", "z": "III-4, Eq. 110", "s": "III-4, Eq. 110"},
        factor=tall_factors,
        realize=shift,
        orders=STATES,
    ),
    *_row(
        "least_squares",
        "regression on H(0)",
        {"time": "II-6, Eqs. 65-66", "z": "left to the reader", "s": "left to the reader"},
        factor=h0_factors,
        realize=regression,
        orders=STATES,
    ),
    Method(
        name="prce",
        domain="time",
        realization="least squares, companion form",
        section="II-4 and II-6, Eqs. 53b, 66",
        takes=Takes.SAMPLES,
        matrix=complete_hankel,
        factor=complete_factors,
        realize=least_squares_companion,
        orders=BLOCKS,
        options_type=HankelOptions,
        forms=("controllable", "observable"),
        from_records="frf",
    ),
)


@replaceable("find_method")
def find_method(name: str, domain: str | None, default_domain: str, route: str | None = None) -> Method:
    """Return the cell of a row and a domain, by default that of the data.

    Raises `DataError`: there is none.
    """
    cells = {row.domain: row for row in ROWS if row.name == name}
    wanted = domain or (default_domain if default_domain in cells else next(iter(cells), default_domain))
    if wanted not in cells:
        have = ", ".join(map(str, ROWS))
        raise DataError(f"method={name!r} in domain {wanted!r}:", f"there are {have}", "Choose one of these.")
    return cells[wanted]


@replaceable("rows_with")
def rows_with(option: str) -> list[str]:
    """Return the rows that have an option, in words."""
    return [str(row) for row in ROWS if option in {f.name for f in fields(row.options_type)}]
