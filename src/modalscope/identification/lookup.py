"""Find a method by the names that the field has for it, and say which options it takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from modalscope.identification.method import DOMAINS, Method, plain
from modalscope.identification.options import AllOptions, Options
from modalscope.identification.table import methods
from modalscope.numerics.errors import DataError, check_choice, check_option_names

__all__ = ["POINTERS", "cell_label", "check_form", "find_method", "options_of"]


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
