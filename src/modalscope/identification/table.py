"""List the table of methods (a method is a data matrix and a realization), and find rows by their names in the literature.

Adding a method is adding a row here and, when its data matrix or its realization is new, one short module in `blocks/` or `realizations/`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from difflib import get_close_matches
from typing import Any, NamedTuple

from modalscope.identification import matrices
from modalscope.identification.method import DOMAINS, Method, Takes, plain
from modalscope.identification.options import (
    AllOptions,
    DrivenOptions,
    FractionOptions,
    HankelOptions,
    LineOptions,
    Options,
    RecordOptions,
    SpectraOptions,
)
from modalscope.identification.orders import BLOCKS, COMPANIONS, DEGREES, STATES
from modalscope.numerics.errors import DataError, check_choice, check_option_names
from modalscope.realizations.balanced import balanced
from modalscope.realizations.companion import fraction_companion, least_squares_companion, null_space_companion
from modalscope.realizations.regression import regression
from modalscope.realizations.shift import shift

# ---------------------------------------------------------------------------------------------------------------- table

#: What a column of the table fixes for a row whose realization suits every data matrix.
_COLUMNS: dict[str, dict[str, Any]] = {
    "time": {
        "takes": Takes.SAMPLES,
        "matrix": matrices.plain_hankel,
        "options_type": HankelOptions,
        "forms": ("observable", "controllable"),
    },
    "z": {"takes": Takes.RESPONSE, "matrix": matrices.transfer_of_response, "options_type": LineOptions},
    "s": {"takes": Takes.CONTINUOUS, "matrix": matrices.transfer_of_lines, "options_type": LineOptions},
}


#: What records on lines fix for the same rows.
_ON_RECORDS: dict[str, Any] = {
    "takes": Takes.RECORDS,
    "matrix": matrices.records_on_lines,
    "options_type": SpectraOptions,
}


class _Cell(NamedTuple):
    """What is a cell's own: where the report has it, and what it is called."""

    section: str
    common: str
    known_as: tuple[str, ...]
    aliases: tuple[str, ...] = ()


def _row(name: str, cells: dict[str, _Cell], in_time: Any = matrices.plain_hankel, **shared: Any) -> Iterator[Method]:
    """Yield one row of the table, a cell a domain; in the time domain its Hankel matrix may be a special one."""
    for domain, cell in cells.items():
        column = dict(_COLUMNS[domain])
        if domain == "time":
            column["matrix"] = in_time
        yield Method(name=name, domain=domain, **cell._asdict(), **column, **shared)


#: What the rows share that read the shift off projected records.
_PROJECTED: dict[str, Any] = {
    "domain": "time",
    "realization": "shift of one factor",
    "factor": matrices.tall_factors,
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
                ("ho-kalman", "next-era", "eigensystem realization algorithm"),
            ),
            "z": _Cell("III-2, Eqs. 82-88", "ERA-FD", ("ERA-FD",), ("era-fd",)),
            "s": _Cell("III-2, Eqs. 89-94", "ERA-FD", ("ERA-FD, continuous",), ("era-fd continuous",)),
        },
        realization="balanced projection",
        realize=balanced,
        factor=matrices.h0_factors,
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
        in_time=matrices.canonical_hankel,
        realization="null space, companion form",
        realize=null_space_companion,
        factor=matrices.tall_factors,
        orders=COMPANIONS,
    ),
    *_row(
        "alternate",
        {
            "time": _Cell(
                "II-5, Eqs. 55-64",
                "SSI-cov",
                ("SSI-cov on correlations", "Kung", "LS-ESPRIT", "ERA without H(1)"),
                ("ssi-cov", "cov-ssi", "kung", "ls-esprit", "esprit"),
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
        factor=matrices.tall_factors,
        orders=STATES,
    ),
    *_row(
        "least_squares",
        {
            "time": _Cell(
                "II-6, Eqs. 65-66",
                "ITD",
                ("least squares regression, truncated", "ITD (Ibrahim), truncated", "delay-embedded DMD"),
                ("itd", "ibrahim", "ibrahim time domain", "dmd", "delay-embedded dmd"),
            ),
            "z": _Cell("left to the reader", "Least squares", ("least squares FD",), ("least-squares-fd",)),
            "s": _Cell(
                "left to the reader", "Least squares", ("least squares FD, continuous", "first-order form, Eq. 109")
            ),
        },
        realization="regression on H(0)",
        realize=regression,
        factor=matrices.h0_factors,
        orders=STATES,
    ),
    Method(
        name="ssi-data",
        section="II-5 on projected records",
        common="SSI-data",
        known_as=("SSI-data, UPC (unweighted principal components)", "MOESP/N4SID without inputs"),
        aliases=("ssi-upc", "upc", "dd-ssi", "data-driven ssi"),
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
        matrix=matrices.complete_hankel,
        factor=matrices.complete_factors,
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


def _on_records(row: Method) -> Method:
    """Return a row of the frequency domains on the lines of records themselves."""
    return replace(row, section=f"{row.section}, on records", **_ON_RECORDS)


_TABLE: tuple[Method, ...] = (
    *_REPORTED,
    *(_on_records(row) for row in _REPORTED if row.takes in (Takes.RESPONSE, Takes.CONTINUOUS)),
)


def methods() -> tuple[Method, ...]:
    """Return the table of methods: one entry a cell, with name, domain, realization, report section and the names it is known as.

    Examples
    --------
    >>> sorted({m.name for m in methods()})[:2]
    ['alternate', 'era']
    """
    return _TABLE


# --------------------------------------------------------------------------------------------------------- field words
# What practitioners call methods that are no row of the table, and where the work that each names is done here.

_FDD = (
    "Singular values of spectra and their peaks are modalscope.preprocess.decomposition(record).peaks() (the command psd); "
    "for damping take ssi-cov."
)
_MARKOV = "Estimate Markov parameters first, modalscope.estimate_markov(record), and identify them by era; or leave method out."
_ML = "Found modes are refined to the maximum of the likelihood: modalscope.refine(data, modes), which analyze does by itself."
_FRACTION = "The matrix fraction on orthogonal polynomials is polyreference in s; with few states alternate in s is the better conditioned."
_SINGLE = (
    "Fits of one resonance at a time are not offered: give the band around it, band=(f1, f2), and any row of the table."
)
_RECORDS = "Records with inputs take n4sid, or no method at all (records on their own lines); without inputs ssi-cov or ssi-data."
_RESIDUES = "Residues to known poles are modalscope.fit_residues(response, modes); identify fits them by itself."
_DWELL = "Appropriated forces and their indicator are modalscope.tuned_dwell(response)."
_INDICATOR = (
    "That is an indicator, not a method: modalscope.plot.indicator(response) draws it, select reads it by itself."
)
_AMBIENT = (
    "Ambient records need no special call: identify, stabilize and analyze take them as they are, ssi-cov by default."
)
_FRF = "Frequency responses need no special call: identify, stabilize and analyze take them as they are."

#: Names in plain words, small letters with blanks between, and what to do in place of them.
POINTERS: dict[str, str] = {
    "era dc": "Take method='era' with column_compression=H0, the Hankel matrix itself: it then works on correlations.",
    "next": "Estimate correlations, modalscope.estimate_correlation(record), and take method='era'; the default is ssi-cov.",
    "okid": _MARKOV,
    "okid era": _MARKOV,
    "okid/era": _MARKOV,
    "era/okid": _MARKOV,
    "era/dc": "Take method='era' with column_compression=H0, the Hankel matrix itself: it then works on correlations.",
    "ssi": "Say which: ssi-cov (correlations), ssi-data (records projected on their past) or ssi-cva (the same, canonical variates).",
    "ssi pc": "Principal components with weights are not offered: take ssi-data (unweighted) or ssi-cva (canonical variates).",
    "polymax plus": f"Take polymax, then the likelihood. {_ML}",
    "fdpi": "Take method='polyreference', domain='s': direct parameter identification, also called dpi.",
    "rfp": _FRACTION,
    "grfp": _FRACTION,
    "rfp z": "Take method='lscf': the matrix fraction in z.",
    "lsfd": _RESIDUES,
    "fdd": _FDD,
    "efdd": _FDD,
    "fsdd": _FDD,
    "cfdd": _FDD,
    "peak picking": _FDD,
    "pp": _FDD,
    "bfdd": _FDD,
    "cmif": _INDICATOR,
    "mif": _INDICATOR,
    "mmif": _INDICATOR,
    "mle": _ML,
    "mlmm": _ML,
    "ml": _ML,
    "maximum likelihood": _ML,
    "bayesian fft": f"Not offered. {_ML}",
    "matrix pencil": "Take method='esprit' (the row alternate): the pencil of a Hankel matrix and its shift.",
    "half power": _SINGLE,
    "circle fit": _SINGLE,
    "sdof": _SINGLE,
    "smac": _SINGLE,
    "subspace": "Say which: n4sid (records with inputs), ssi-data (without), fd-subspace (frequency responses).",
    "arx": _RECORDS,
    "armax": _RECORDS,
    "arma": _RECORDS,
    "pem": _RECORDS,
    "std": "Sparse time domain is a way to compute Ibrahim's method: take method='itd'.",
    "mritd": "Take method='itd' with several decays as inputs.",
    "normal mode": _DWELL,
    "phase resonance": _DWELL,
    "force appropriation": _DWELL,
    "oma": _AMBIENT,
    "ema": _FRF,
    "omax": _RECORDS,
}


# -------------------------------------------------------------------------------------------------------------- lookup


def cell_label(name: str, domain: str) -> str:
    """Return the common name of a cell, and its own behind it; of what the table has not, the two as they stand.

    Examples
    --------
    >>> cell_label("alternate", "time"), cell_label("lscf", "z")
    ('SSI-cov (alternate)', 'PolyMAX (lscf, z)')
    """
    return next((m.label for m in methods() if (m.name, m.domain) == (name, domain)), f"{name} ({domain})")


def _named(name: Any) -> list[Method]:
    """Return the cells that a name means: a whole row by its own name, those it is an alias of else."""
    wanted = plain(name) if isinstance(name, str) else ""
    rows = [m for m in methods() if plain(m.name) == wanted]
    return rows or [m for m in methods() if wanted in {plain(alias) for alias in m.aliases}]


def find_method(name: str, domain: str | None, default_domain: str, route: str | None = None) -> Method:
    """Return the cell of a name and a domain; without a domain the one that suits the data, else the row's only one.

    `name`: A row of the table, or a name from the literature ("ssi-cov", "polymax", "itd"); any case, hyphens and underscores alike.
    `default_domain`: what suits the data. `route`: from records with inputs: only rows that this way serves.

    Raises `DataError`: an unknown name, or a cell that does not exist.
    """
    found = _named(name)
    if not found:
        raise _unknown(name)
    cells: dict[str, Method] = {}
    for m in found:
        if route is None or not m.route or m.served_by(route):
            cells.setdefault(m.domain, m)
    if not cells:
        ways = dict.fromkeys(m.route for m in found if m.route)
        raise DataError(
            f"method {name!r} by route={route!r} was asked",
            f"from records with inputs it is reached by {' or '.join(ways) or 'no way'}",
            "Leave route out, or choose another method.",
        )
    if domain is None:
        return cells.get(default_domain) or next(iter(cells.values()))
    check_choice("domain", domain, DOMAINS)
    if domain not in cells:
        raise DataError(
            f"method {name!r} in domain {domain!r} was asked",
            f"that row has only {', '.join(cells)}",
            "Choose one of these domains.",
        )
    return cells[domain]


def _unknown(name: Any) -> DataError:
    rows = list(dict.fromkeys(m.name for m in methods()))
    pointer = POINTERS.get(" ".join(str(name).lower().replace("-", " ").replace("_", " ").split()))
    if pointer is not None:
        return DataError(f"method={name!r} was asked", "it is no row of the table", pointer)
    words = {plain(word): word for m in methods() for word in (m.name, *m.aliases)}
    near = get_close_matches(plain(str(name)), words, n=1)
    hint = f"Did you mean {words[near[0]]!r}? " if near else ""
    return DataError(
        f"method={name!r} was asked",
        f"there are only {', '.join(rows)}, and their names in the literature (see methods())",
        f"{hint}Choose one of these.",
    )


# --------------------------------------------------------------------------------------------------------- row options
# The options of one row, from what was asked of it.


def options_of(row: Method, given: Mapping[str, Any]) -> Options:
    """Return the row's own options; what it has no use for is refused, with the rows that have it.

    `given`: none stands for what is not given.
    """
    own = {f.name for f in fields(row.options_type)}
    chosen = {name: value for name, value in given.items() if value is not None}
    for name, value in row.fixed.items():
        if chosen.get(name, value) != value:
            raise DataError(
                f"{name}={chosen[name]!r} was asked of method {row}",
                f"{name}={value!r} is what makes that row",
                "Leave the option out, or choose another method.",
            )
    asked = {**row.fixed, **chosen}
    check_option_names(str(row), asked, AllOptions.__annotations__)
    for name in asked:
        if name not in own:
            having = dict.fromkeys(str(m) for m in methods() if name in {f.name for f in fields(m.options_type)})
            raise DataError(
                f"option {name!r} was asked of method {row}",
                row.options_type.why_not,
                f"Leave it out, or choose one of the methods that have it: {', '.join(having)}.",
            )
    return row.options_type(**asked)


def check_form(row: Method, form: str | None) -> None:
    """Raise when a form was asked that a row does not have."""
    if form is None:
        return
    check_choice("form", form, ("observable", "controllable", "smaller"))
    allowed = (*row.forms, "smaller") if len(row.forms) > 1 else row.forms
    if form not in allowed:
        raise DataError(
            f"form={form!r} of method {row.name!r} in domain {row.domain!r} was asked",
            f"it has only {' and '.join(allowed)}: its columns are lines or times, in which the state matrix does not appear as B, AB, ...",
            f"Use form={allowed[0]!r}, or a method in the time domain.",
        )
