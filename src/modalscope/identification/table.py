"""List the table of methods: a method is a data matrix and a realization.

Adding a method is adding a row here and, when its data matrix or its realization is new, one short module in `blocks/` or `realizations/`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from modalscope.identification.matrices import of_method as matrices
from modalscope.identification.matrices.factor import complete_factors, h0_factors, tall_factors
from modalscope.identification.matrices.hankel import canonical_hankel, complete_hankel, plain_hankel
from modalscope.identification.matrices.lines import transfer_of_lines, transfer_of_response
from modalscope.identification.method import BLOCKS, COMPANIONS, STATES, Method, Takes
from modalscope.identification.options import (
    DrivenOptions,
    FractionOptions,
    HankelOptions,
    LineOptions,
    PointOptions,
    RecordOptions,
    SpectraOptions,
)
from modalscope.identification.orders import DEGREES
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.companion import least_squares_companion, null_space_companion
from modalscope.identification.realizations.fraction_companion import fraction_companion
from modalscope.identification.realizations.regression import regression
from modalscope.identification.realizations.shift import shift

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

#: Domains of Loewner matrices, and what they take.
_ON_LINES = {"s": Takes.CONTINUOUS, "z": Takes.LINES}


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


#: Fields of the rows on projected records.
_PROJECTED: dict[str, Any] = {
    "domain": "time",
    "realization": "shift of one factor",
    "factor": tall_factors,
    "realize": shift,
    "orders": STATES,
}


_REPORTED: tuple[Method, ...] = (
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
    Method(
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
    ),
    Method(
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
    ),
)


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

#: The reported rows; those of the frequency domains stand again on the lines of records.
_TABLE: tuple[Method, ...] = (
    *_REPORTED,
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
