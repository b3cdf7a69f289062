"""Results of methods and groups of modes made by hand, for tests of what a comparison says of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.kinship import Kinship
from modalscope.analysis.comparing.run import MethodResult
from modalscope.data.modes import ModalModel
from modalscope.identification.method_names import find_method
from modalscope.numerics.functions.poles import poles_from

#: Methods of the time domain, by what they are called in a comparison.
ERA, ALTERNATE, POLY, LEAST, PRCE = (
    "era (time)",
    "alternate (time)",
    "polyreference (time)",
    "least_squares (time)",
    "prce (time)",
)
ALL = (ERA, ALTERNATE, POLY, LEAST, PRCE)

#: One mode: frequency, damping, shape of two outputs.
Mode = tuple[float, float, Sequence[complex]]


def result(name: str, modes: Iterable[Mode] | None = (), *, exact: bool = True, **more: Any) -> MethodResult:
    """Return what one method found; None is a method that failed."""
    row, domain = name[:-1].split(" (")
    method = find_method(row, domain, domain)
    if modes is None:
        return MethodResult(method=method, exact=exact, failure="it could not")
    found = list(modes)
    shapes = np.array([shape for *_, shape in found], dtype=complex).reshape(len(found), 2).T
    fields = ("frequencies_spread", "damping_ratios_spread", "reasons")
    given = {field: more.pop(field) for field in fields if field in more}
    model = ModalModel(
        poles=poles_from([f for f, *_ in found], [zeta for _, zeta, _ in found]),
        shapes=shapes,
        participation=np.ones((len(found), 3)),
        **given,
    )
    return MethodResult(method=method, exact=exact, modes=model, **{"fit_error": 0.1, **more})


def kin(names: Sequence[str], *equal: Sequence[str]) -> Kinship:
    """Return a kinship in which only the named ones are the same."""
    left = [name for name in names if not any(name in same for same in equal)]
    classes = [tuple(names.index(n) for n in same) for same in (*equal, *([n] for n in left))]
    k = len(names)
    return Kinship(tuple(names), 2, np.ones((k, k)), np.zeros((k, k)), np.zeros((k, 2)), tuple(classes))


def group(f: float = 10.0, zeta: float = 0.02, votes: Sequence[str] = ALL[:3], voters: int = 3, **more: Any) -> Group:
    """Return a mode on which the voters agree entirely, but for what is given."""
    fields: dict[str, Any] = {
        "members": dict.fromkeys(votes, 0),
        "frequencies": dict.fromkeys(votes, f),
        "damping_ratios": dict.fromkeys(votes, zeta),
        "mac": dict.fromkeys(votes, 1.0),
        "votes": tuple(votes),
        "voters": voters,
        "frequency": f,
        "damping": zeta,
        "frequency_between": 0.0,
        "damping_between": 0.0,
        "shape": np.array([1, 0], complex),
    }
    return Group(**{**fields, **more})
