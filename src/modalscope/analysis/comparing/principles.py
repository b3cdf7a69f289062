"""Count the different estimators among the methods of a comparison, and name the independent witnesses behind each mode.

Methods whose poles agree to rounding on the data at hand are one principle: what they find together is one finding. A witness is one of
them by route, domain and principle. All of this is measured on these data; where an identity of the report says why, it is named with
its residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.identities import Identity
from modalscope.analysis.comparing.kinship import Kinship
from modalscope.analysis.comparing.run import MethodResult
from modalscope.data.shown import counted, figures
from modalscope.identification.method import Method
from modalscope.identification.table_beyond import DOMAINS


@dataclass(frozen=True)
class Principle:
    """One estimator, by whatever names.

    `name`: of its rows, as in "ERA = least squares". `members`: the methods, as `era (s)`. `why`: what makes them one, or by how much the
    nearest other method differs.
    """

    name: str
    members: tuple[str, ...]
    why: str


class Witness(NamedTuple):
    """What found a mode: the route from records with inputs (empty for other data), the domain, and the name of the principle."""

    route: str
    domain: str
    principle: str


def row_name(method: Method) -> str:
    """Return the name of a row in words: in capitals where the literature has it so.

    Examples
    --------
    >>> from modalscope.identification.method_names import find_method
    >>> [row_name(find_method(name, None, "time")) for name in ("era", "least_squares", "prce")]
    ['ERA', 'least squares', 'PRCE']
    """
    capitals = method.name.upper()
    listed = " ".join((method.common, *method.known_as))
    return capitals if capitals in listed else method.name.replace("_", " ")


def principles_of(kin: Kinship, identities: Sequence[Identity]) -> tuple[Principle, ...]:
    """Return the principles of the methods with modes, in the order of the methods."""
    return tuple(
        Principle(_joined(kin, members), tuple(kin.names[i] for i in members), _why(kin, members, identities))
        for members in kin.classes
    )


def witnesses_of(
    groups: Sequence[Group], results: Sequence[MethodResult], principles: Sequence[Principle]
) -> tuple[tuple[Witness, ...], ...]:
    """Return the witnesses of each mode: one a vote, so that of a principle, and of a route, there is one."""
    by_name = {r.name: r for r in results}
    names = {member: p.name for p in principles for member in p.members}
    return tuple(
        tuple(Witness(by_name[v].route, by_name[v].method.domain, names.get(v, v)) for v in group.votes)
        for group in groups
    )


def headline(
    kin: Kinship, results: Sequence[MethodResult], principles: Sequence[Principle], identities: Sequence[Identity]
) -> str:
    """Return how many methods ran, how many of them differ, which are one, and to what the identities hold."""
    failed = len(results) - len(kin.names)
    count = f"{len(kin.names)} of {counted(len(results), 'method')}" if failed else counted(len(results), "method")
    different = "1 different one" if len(principles) == 1 else f"{len(principles)} different ones"
    equal: dict[str, list[str]] = {}
    for members, principle in zip(kin.classes, principles, strict=True):
        if len(members) > 1:
            equal.setdefault(principle.name, []).extend(kin.methods[i].domain for i in members if kin.methods)
    same = ", ".join(f"{name}{_in_domains(domains)}" for name, domains in equal.items())
    held = [i.residual for i in identities if np.isfinite(i.residual)]
    hold = f"; identities hold to {max(held):.0e}" if held else ""
    return f"{count}, {different}{f': {same}' if same else ''}{hold}"


def _in_domains(domains: Sequence[str]) -> str:
    """Return the domains of equal methods in words."""
    words = [domain for domain in DOMAINS if domain in domains]
    return f" in {' and '.join(filter(None, (', '.join(words[:-1]), *words[-1:])))}" if words else ""


def _joined(kin: Kinship, members: Sequence[int]) -> str:
    """Return the names of the rows of some methods, each once."""
    if not kin.methods:
        return " = ".join(kin.names[i] for i in members)
    return " = ".join(dict.fromkeys(row_name(kin.methods[i]) for i in members))


def _why(kin: Kinship, members: Sequence[int], identities: Sequence[Identity]) -> str:
    """Return why methods are one principle, measured; of a single one how far the next is."""
    unit = f"half bandwidths at order {kin.order}"
    others = [k for k in range(len(kin.names)) if k not in members]
    if len(members) == 1:
        distances = kin.distances[members[0]]
        nearest = min(others, key=lambda k: float(distances[k]), default=None)
        if nearest is None:
            return "the only method"
        return f"nearest to {kin.labels[nearest]}, whose poles differ by {figures(distances[nearest], 2)} {unit}"
    apart = f"poles alike within {float(np.max(kin.distances[np.ix_(members, members)])):.0e} {unit}"
    rows = {(kin.methods[i].name, kin.methods[i].domain) for i in members} if kin.methods else set()
    for identity in identities:
        if rows and rows <= {(name, identity.domain) for name in identity.rows} and np.isfinite(identity.residual):
            return f"{identity.name} ({identity.source}), residual {identity.residual:.0e}; {apart}"
    return apart
