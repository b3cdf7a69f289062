"""List the rows of the table beyond those of the report: on records, on matrix fractions and on Loewner matrices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from modalscope.identification.literature import NAMES
from modalscope.identification.matrices import of_method as matrices
from modalscope.identification.matrices.factor import tall_factors
from modalscope.identification.method import STATES, Method, Takes
from modalscope.identification.options_beyond import (
    DrivenOptions,
    FractionOptions,
    PointOptions,
    RecordOptions,
    SpectraOptions,
)
from modalscope.identification.orders import DEGREES
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.fraction_companion import fraction_companion
from modalscope.identification.realizations.shift import shift
from modalscope.identification.table import ROWS

#: Fields of the rows on projected records.
_PROJECTED: dict[str, Any] = {
    "domain": "time",
    "realization": "shift of one factor",
    "factor": tall_factors,
    "realize": shift,
    "orders": STATES,
}


_ON_PAST: tuple[Method, ...] = (
    Method(
        name="ssi-data",
        section="II-5 on projected records",
        common="SSI-data",
        known_as=("SSI-data, UPC (unweighted principal components)", "MOESP/N4SID without inputs"),
        aliases=("ssi-upc", "upc", "dd-ssi", "data-driven ssi", "subspace-dmd"),
        takes=Takes.PAST,
        matrix=matrices.projected_records,
        options_type=RecordOptions,
        **_PROJECTED,
    ),
    Method(
        name="ssi-cva",
        section="II-5 on projected records, whitened",
        common="CVA",
        known_as=("SSI-data, CVA (canonical variate analysis)", "canonical variates without inputs"),
        aliases=("cva", "canonical variate analysis"),
        takes=Takes.PAST,
        matrix=matrices.projected_records,
        options_type=RecordOptions,
        fixed={"weighting": "cva"},
        **_PROJECTED,
    ),
    Method(
        name="n4sid",
        section="II-5 on records projected on past inputs and outputs",
        common="N4SID",
        known_as=(
            "N4SID with the weights of canonical variates (CVA)",
            "PO-MOESP, MOESP with past inputs and outputs as instruments, its rows whitened",
        ),
        aliases=("moesp", "po-moesp", "past-output moesp"),
        takes=Takes.DRIVEN,
        matrix=matrices.driven_records,
        options_type=DrivenOptions,
        **_PROJECTED,
    ),
)

_FRACTION = Method(
    name="lscf",
    domain="z",
    realization="matrix fraction, companion form",
    section="not in the report",
    common="PolyMAX",
    known_as=("LSCF, polyreference least-squares complex frequency", "pLSCF", "PolyMAX"),
    aliases=("polymax", "plscf", "p-lscf"),
    takes=Takes.LINES,
    matrix=matrices.matrix_fraction,
    factor=matrices.fraction_factors,
    realize=fraction_companion,
    orders=DEGREES,
    options_type=FractionOptions,
    forms=("controllable",),
)

#: Domains of Loewner matrices, and what they take.
_ON_LINES = {"s": Takes.CONTINUOUS, "z": Takes.LINES}

#: Rows on Loewner matrices, a further column of lines in either domain.
_INTERPOLATING: tuple[Method, ...] = tuple(
    Method(
        name="loewner",
        domain=domain,
        realization="balanced projection",
        section="II-3 on Loewner matrices, not in the report",
        common="Loewner",
        known_as=(
            "Loewner framework",
            "quadrature-based balanced truncation (quadBT), B and D by least squares",
            "NExT-LF on half spectra",
        ),
        aliases=("ilf", "loewner framework", "next-lf", "quadbt"),
        takes=takes,
        matrix=matrices.loewner_of_lines,
        factor=matrices.loewner_factors,
        realize=balanced,
        orders=STATES,
        options_type=PointOptions,
        votes=False,
    )
    for domain, takes in _ON_LINES.items()
)

_ON_RECORDS: dict[str, Any] = {
    "takes": Takes.RECORDS,
    "matrix": matrices.records_on_lines,
    "options_type": SpectraOptions,
}

#: The rows of the report with their names in the literature; the last has no cell of other domains.
*_FOUR_ROWS, _PRCE = (replace(row, **NAMES[row.name, row.domain]._asdict()) for row in ROWS)

#: The rows of the report and those beyond; those of the frequency domains stand again on the lines of records.
_TABLE: tuple[Method, ...] = (
    *_FOUR_ROWS,
    *_ON_PAST,
    _PRCE,
    _FRACTION,
    *_INTERPOLATING,
    *(
        replace(row, section=f"{row.section}, on records", **_ON_RECORDS)
        for row in _FOUR_ROWS
        if row.takes in (Takes.RESPONSE, Takes.CONTINUOUS)
    ),
)


def methods() -> tuple[Method, ...]:
    """Return all rows; `modalscope.identification.method_names` finds some of them by name."""
    return _TABLE
