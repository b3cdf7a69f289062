"""Finding a cell of the table by the words that people have for it."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

from modalscope.identification.field_words import POINTERS
from modalscope.identification.method import DOMAINS, Method, plain
from modalscope.identification.table import methods
from modalscope.model.checks import DataError, check_choice

__all__ = ["cell_label", "find_method"]


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

    Parameters
    ----------
    name : str
        A row of the table, or a name from the literature ("ssi-cov", "polymax", "itd"); any case, hyphens and underscores alike.
    domain : {"time", "z", "s"}, optional
    default_domain : str
        What suits the data.
    route : str, optional
        From records with inputs: only rows that this way serves.

    Raises
    ------
    DataError
        An unknown name, or a cell that does not exist.
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
