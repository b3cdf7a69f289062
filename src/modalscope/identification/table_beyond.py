"""List all rows of the table: those of the report with their names in the literature, on records, of fractions, on Loewner matrices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from modalscope.identification import matrices_beyond as matrices
from modalscope.identification.matrices.factor import tall_factors
from modalscope.identification.matrices_beyond import (
    DrivenOptions,
    FractionOptions,
    PointOptions,
    RecordOptions,
    SpectraOptions,
)
from modalscope.identification.method import BLOCKS, STATES, Method, Takes
from modalscope.identification.orders import DEGREES
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.shift import shift
from modalscope.identification.table import ROWS

#: Columns of the table.
DOMAINS = {
    "time": "Hankel matrix of Markov parameters",
    "z": "shifted transfer functions",
    "s": "differentiated transfer functions",
}


class Names(NamedTuple):
    """Names of one cell: the common one, those of the literature, and what is accepted besides."""

    common: str
    known_as: tuple[str, ...]
    aliases: tuple[str, ...] = ()


#: By row and domain.
NAMES: dict[tuple[str, str], Names] = {
    ("era", "time"): Names(
        "ERA",
        ("ERA", "Ho-Kalman", "ERA/DC with column_compression=H(0)", "NExT-ERA on correlations"),
        ("ho-kalman", "next-era", "eigensystem realization algorithm", "projected-dmd"),
    ),
    ("era", "z"): Names("ERA-FD", ("ERA-FD",), ("era-fd",)),
    ("era", "s"): Names("ERA-FD", ("ERA-FD, continuous",), ("era-fd continuous",)),
    ("polyreference", "time"): Names(
        "Polyreference", ("polyreference, canonical-form realization",), ("canonical-form realization",)
    ),
    ("polyreference", "z"): Names("Polyreference FD", ("polyreference FD",), ("polyreference-fd",)),
    ("polyreference", "s"): Names(
        "Polyreference FD",
        ("polyreference FD, continuous", "direct parameter identification"),
        ("dpi", "direct parameter identification"),
    ),
    ("alternate", "time"): Names(
        "SSI-cov",
        ("SSI-cov on correlations", "Kung", "LS-ESPRIT", "ERA without H(1)", "optimized DMD when refined"),
        (
            *("ssi-cov", "cov-ssi", "kung", "ls-esprit", "esprit"),
            *("tls-dmd", "total-least-squares dmd", "optimized-dmd"),
        ),
    ),
    ("alternate", "z"): Names("FD-subspace", ("alternate FD",), ("alternate-fd",)),
    ("alternate", "s"): Names(
        "FD-subspace",
        ("alternate FD, continuous", "frequency-domain subspace identification"),
        ("fd-subspace", "frequency-domain subspace identification"),
    ),
    ("least_squares", "time"): Names(
        "ITD",
        ("least squares regression, truncated", "ITD (Ibrahim), truncated", "delay-embedded DMD"),
        ("itd", "ibrahim", "ibrahim time domain", "dmd", "exact-dmd", "delay-embedded dmd", "hankel-dmd"),
    ),
    ("least_squares", "z"): Names("Least squares", ("least squares FD",), ("least-squares-fd",)),
    ("least_squares", "s"): Names("Least squares", ("least squares FD, continuous", "first-order form, Eq. 109")),
    ("prce", "time"): Names(
        "PRCE",
        (
            "PRCE, polyreference complex exponential",
            "LSCE with one input",
            "Prony with one channel",
            "ITD (Ibrahim) with one input, form='observable'",
        ),
        ("lsce", "prony", "polyreference complex exponential", "ptd"),
    ),
}


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
    realize=matrices.fraction_models,
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

#: The rows of the report with their names in the literature.
_REPORTED = tuple(
    replace(row, **names._asdict()) if (names := NAMES.get((row.name, row.domain))) else row for row in ROWS
)

#: The rows of the report and those beyond; those of the frequency domains stand again on the lines of records.
_TABLE: tuple[Method, ...] = (
    *(row for row in _REPORTED if row.orders is not BLOCKS),
    *_ON_PAST,
    *(row for row in _REPORTED if row.orders is BLOCKS),
    _FRACTION,
    *_INTERPOLATING,
    *(
        replace(row, section=f"{row.section}, on records", **_ON_RECORDS)
        for row in _REPORTED
        if row.takes in (Takes.RESPONSE, Takes.CONTINUOUS)
    ),
)


def methods() -> tuple[Method, ...]:
    """Return all rows; `modalscope.identification.method_names` finds some of them by name."""
    return _TABLE
