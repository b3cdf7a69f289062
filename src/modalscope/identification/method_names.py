"""Find rows of the table by their names in the literature, and answer names of methods that are no row of it."""

from __future__ import annotations

import re
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from modalscope.identification.method import Method, Takes
from modalscope.identification.options import Options
from modalscope.identification.suits import is_driven, route_of, served_by
from modalscope.identification.table_beyond import DOMAINS, methods as table
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_each, check_kind
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.plugins import METHODS, added, names_added

_FDD = (
    "Singular values of spectra and their peaks are modalscope.preprocess.decomposition(record).peaks() (the command psd); "
    "for damping use ssi-cov."
)
_ML = "Modes are refined to the maximum of the likelihood by modalscope.refine(data, modes); analyze does it by itself."
_ERA_DC = "Use method='era' with column_compression=H0, the Hankel matrix itself: it then works on correlations."
_FRACTION = "The matrix fraction on orthogonal polynomials is polyreference in s; with few states alternate in s is better conditioned."
_SINGLE = (
    "Fits of one resonance at a time are not offered: give the band around it, band=(f1, f2), and any row of the table."
)
_RECORDS = "Records with inputs: use n4sid, or no method at all (records on their own lines); without inputs ssi-cov or ssi-data."
_DWELL = "Appropriated forces and their indicator are modalscope.tuned_dwell(response)."

#: Names of the field in small letters with blanks between, several of one answer divided by commas, and what to use instead.
_ANSWERS = {
    "era dc": _ERA_DC,
    "next": "Estimate correlations, modalscope.estimate_correlation(record), and use method='era'; the default is ssi-cov.",
    "okid, okid era, era okid": "Estimate Markov parameters, modalscope.estimate_markov(record), and identify them by era; or omit method.",
    "ssi, ssi dat, ssi ref": "Say which: ssi-cov (correlations), ssi-data (projected records) or ssi-cva (the same, canonical variates).",
    "ssi pc": "Weighted principal components are not offered: use ssi-data (unweighted) or ssi-cva (canonical variates).",
    "polymax plus": f"Use polymax, then the likelihood. {_ML}",
    "fdpi": "Use method='polyreference', domain='s': direct parameter identification, also called dpi.",
    "rfp, grfp, lsrf": _FRACTION,
    "rfp z": "Use method='lscf': the matrix fraction in z.",
    "lsfd": "Residues of known poles are modalscope.fit_residues(response, modes); identify fits them by itself.",
    "fdd, efdd, fsdd, cfdd, frequency domain decomposition, peak picking, pp, bfdd": _FDD,
    "cmif, mif, mmif": "An indicator, not a method: modalscope.plot.indicator(response) draws it, select uses it by itself.",
    "mle, mlmm, ml, maximum likelihood, opt dmd": _ML,
    "bayoma, bayesian, bayesian fft, fast bayesian fft": f"{_ML} Its interval is that of the posterior under a flat prior.",
    "matrix pencil": "Use method='esprit' (the row alternate): the pencil of a Hankel matrix and its shift.",
    "half power, circle fit, ewins gleeson, sdof, smac": _SINGLE,
    "subspace, subspace identification": "Say which: n4sid (records with inputs), ssi-data (without), fd-subspace (frequency responses).",
    "ar, var, arx, armax, arma, pem, omax": _RECORDS,
    "std": "Sparse time domain is an algorithm for Ibrahim's method: use method='itd'.",
    "mritd": "Use method='itd' with several decays as inputs.",
    "normal mode, phase resonance, force appropriation": _DWELL,
    "oma": "Ambient records need no special call: identify, stabilize and analyze accept them, ssi-cov by default.",
    "ema": "Frequency responses need no special call: identify, stabilize and analyze accept them.",
}

#: Name -> answer.
POINTERS = {name: answer for names, answer in _ANSWERS.items() for name in names.split(", ")}


def plain(name: str) -> str:
    """Return a name in small letters without hyphens, underscores and blanks."""
    return "".join(c for c in name.lower() if c not in "-_ ")


@named()
def methods(name: str | None = None) -> tuple[Method, ...]:
    """Return the table of methods: one entry a cell, with name, domain, realization, report section and names in the literature.

    Parameters
    ----------
    name : str, optional
        A row, or one of its names in the literature ("tls-dmd", "polymax"): its cells alone.

    Raises
    ------
    DataError
        A name that is no row; where it is known, with what to use instead.

    Examples
    --------
    >>> sorted({m.name for m in methods()})[:2]
    ['aaa', 'alternate']
    >>> [str(m) for m in methods("PolyMAX")]
    ['lscf (z)']
    """
    return (*table(), *_rows_added()) if name is None else _rows_named(name)


def _rows_added() -> tuple[Method, ...]:
    """Return the rows that installed packages add."""
    rows: list[Method] = []
    for name in names_added(METHODS):
        given = added(METHODS, name)
        given = (given,) if isinstance(given, Method) else given
        rows += check_each(f"the method {name} of an installed package", given, "rows of the table")
    for row in rows:
        check_kind("a row of the table", row, Method)
    return tuple(rows)


def _rows_named(name: Any) -> tuple[Method, ...]:
    """Return the cells of a row by its name or one of its aliases, in any case, with hyphens, underscores or blanks."""
    wanted = plain(name) if isinstance(name, str) else ""
    for rows in (table, _rows_added):  # those that packages add are looked for where the table has none
        found = [m for m in rows() if plain(m.name) == wanted]
        found = found or [m for m in rows() if wanted in {plain(alias) for alias in m.aliases}]
        if found:
            return tuple(found)
    raise _unknown(name)


def rows_of(name: str) -> tuple[Method, ...]:
    """Return the cells of a row by its name in the table, as results and files have it; none of a name that is not there."""
    return tuple(m for m in table() if m.name == name) or tuple(m for m in _rows_added() if m.name == name)


def options_type_of(name: str, domain: str, route: str | None) -> type[Options] | None:
    """Return the type of the options of a cell, as results and files have it; None for a name that is not there."""
    cells = (m for m in rows_of(name) if m.domain == domain)
    return next((m.options_type for m in cells if (served_by(m, route) if route else not is_driven(m))), None)


def rows_with(option: str) -> list[str]:
    """Return the rows that have an option, in words."""
    return [str(m) for m in methods() if option in {f.name for f in fields(m.options_type)}]


def label_of(row: Method) -> str:
    """Return the common name of a row first, with its name and domain in the table behind it: "SSI-cov (alternate)"."""
    name = () if plain(row.common) == plain(row.name) else (row.name,)
    domain = () if row.domain == "time" else (row.domain,)
    details = ", ".join((*name, *domain, *(("records",) if row.takes is Takes.RECORDS else ())))
    return f"{row.common} ({details})" if details else row.common


def cell_label(name: str, domain: str) -> str:
    """Return the common name of a cell with its name in the table; an unknown name with its domain.

    Examples
    --------
    >>> cell_label("alternate", "time"), cell_label("lscf", "z")
    ('SSI-cov (alternate)', 'PolyMAX (lscf, z)')
    """
    return next((label_of(m) for m in rows_of(name) if m.domain == domain), f"{name} ({domain})")


def find_method(name: str, domain: str | None, default_domain: str, route: str | None = None) -> Method:
    """Return the cell of a name and a domain; by default the domain of the data, or the first of the row.

    `name`: a row of the table, or a name from the literature ("ssi-cov", "polymax", "itd"), in any case, with hyphens, underscores or
    blanks. `default_domain`: domain of the data. `route`: restricts to the rows that this route from records with inputs serves.

    Raises `DataError`: an unknown name, or a cell that does not exist.
    """
    rows = _rows_named(name)
    cells: dict[str, Method] = {}
    for m in rows:
        if route is None or not route_of(m) or served_by(m, route):
            cells.setdefault(m.domain, m)
    if not cells:
        routes = dict.fromkeys(filter(None, map(route_of, rows)))
        raise DataError(
            f"method {name!r} by route={route!r}:",
            f"it takes records with inputs by route {' or '.join(map(repr, routes)) or 'none'} only",
            "Omit route, or choose another method.",
        )
    if domain is None:
        return cells.get(default_domain) or next(iter(cells.values()))
    check_choice("domain", domain, DOMAINS)
    if domain not in cells:
        raise DataError(
            f"method {name!r} in domain {domain!r}:", f"it has only {', '.join(cells)}", "Choose one of these domains."
        )
    return cells[domain]


def _unknown(name: Any) -> DataError:
    rows = list(dict.fromkeys(m.name for m in methods()))
    pointer = POINTERS.get(" ".join(re.split(r"[-_/ ]+", str(name).strip().lower())))
    if pointer is not None:
        return DataError(f"method={name!r}:", "it is no row of the table", pointer)
    words = {plain(word): word for m in methods() for word in (m.name, *m.aliases)}
    near = get_close_matches(plain(str(name)), words, n=1)
    hint = f"Did you mean {words[near[0]]!r}? " if near else ""
    return DataError(
        f"method={name!r}:",
        f"there are {', '.join(rows)}, and their names in the literature (see methods())",
        f"{hint}Choose one of these.",
    )
