"""THE TABLE: a method is a data matrix and a realization, and this module lists them.

Adding a method is adding a row here and, when its realization is new, one short module in `realize/`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from modalscope.blocks.factor import Factors
from modalscope.model.checks import DataError, check_choice
from modalscope.realizations.balanced import balanced
from modalscope.realizations.companion import least_squares_companion, null_space_companion
from modalscope.realizations.fraction import fraction_companion
from modalscope.realizations.regression import regression
from modalscope.realizations.shift import shift
from modalscope.realizations.triple import Realization

__all__ = ["DOMAINS", "Method", "find_method", "methods"]

DOMAINS = {
    "time": "Hankel matrix of Markov parameters",
    "z": "shifted transfer functions",
    "s": "differentiated transfer functions",
}

Realize = Callable[[Any, Factors], Realization]


@dataclass(frozen=True)
class Method:
    """One cell of the table.

    Parameters
    ----------
    name, domain : str
        The row and the column.
    realization : str
        How the model is read off, in words.
    section : str
        Where the report has it.
    known_as : tuple of str
        Names in the literature of this cell, with the options that make them.
    realize : callable
        Data matrix and factors -> all orders.
    factors : {"h0", "tall", "complete", "fraction"}
        What is factored: H(0), the matrix with one block row more, all of that without truncation, or the normal equations of a matrix
        fraction, whose order is the degree.
    forms : tuple of str
        Observable and controllable forms that exist; the first is the default, "smaller" takes the one with fewer states.
    on_records : bool
        Whether the data matrix is made of records themselves, not of a response.
    """

    name: str
    domain: str
    realization: str
    section: str
    known_as: tuple[str, ...]
    realize: Realize
    factors: str
    forms: tuple[str, ...] = ("observable",)
    on_records: bool = False

    def __str__(self) -> str:
        return f"{self.name} ({self.domain})"

    @property
    def canonical(self) -> bool:
        """Whether models have as many states as the block rows have rows, whatever the rank."""
        return self.realize in (null_space_companion, least_squares_companion)


def _row(
    name: str, realization: str, realize: Realize, factors: str, cells: dict[str, tuple[str, tuple[str, ...]]]
) -> list[Method]:
    """Return one row of the table; in the time domain inputs and outputs may change places, on lines they may not."""
    forms = {"time": ("observable", "controllable"), "z": ("observable",), "s": ("observable",)}
    return [
        Method(name, domain, realization, section, known, realize, factors, forms[domain])
        for domain, (section, known) in cells.items()
    ]


_TABLE: tuple[Method, ...] = (
    *_row(
        "era",
        "balanced projection",
        balanced,
        "h0",
        {
            "time": (
                "II-3, Eqs. 24-41",
                ("ERA", "Ho-Kalman", "ERA/DC with column_compression=H(0)", "NExT-ERA on correlations"),
            ),
            "z": ("III-2, Eqs. 82-88", ("ERA-FD",)),
            "s": ("III-2, Eqs. 89-94", ("ERA-FD, continuous",)),
        },
    ),
    *_row(
        "polyreference",
        "null space, companion form",
        null_space_companion,
        "tall",
        {
            "time": ("II-4, Eqs. 42-54", ("polyreference, canonical-form realization",)),
            "z": ("III-3, Eqs. 95-101", ("polyreference FD",)),
            "s": ("III-3, Eqs. 102-109", ("polyreference FD, continuous", "direct parameter identification")),
        },
    ),
    *_row(
        "alternate",
        "shift of one factor",
        shift,
        "tall",
        {
            "time": ("II-5, Eqs. 55-64", ("SSI-cov on correlations", "Kung", "LS-ESPRIT", "ERA without H(1)")),
            "z": ("III-4, Eq. 110", ("alternate FD",)),
            "s": ("III-4, Eq. 110", ("alternate FD, continuous", "frequency-domain subspace identification")),
        },
    ),
    *_row(
        "least_squares",
        "regression on H(0)",
        regression,
        "h0",
        {
            "time": (
                "II-6, Eqs. 65-66",
                ("least squares regression, truncated", "ITD (Ibrahim), truncated", "delay-embedded DMD"),
            ),
            "z": ("left to the reader", ("least squares FD",)),
            "s": ("left to the reader", ("least squares FD, continuous", "first-order form, Eq. 109")),
        },
    ),
    Method(
        "ssi-data",
        "time",
        "shift of one factor",
        "II-5 on projected records",
        ("SSI-data, UPC (unweighted principal components)", "MOESP/N4SID without inputs"),
        shift,
        "tall",
        on_records=True,
    ),
    Method(
        "prce",
        "time",
        "least squares, companion form",
        "II-4 and II-6, Eqs. 53b, 66",
        (
            "PRCE, polyreference complex exponential",
            "LSCE with one input",
            "Prony with one channel",
            "ITD (Ibrahim) with one input, form='observable'",
        ),
        least_squares_companion,
        "complete",
        ("controllable", "observable"),
    ),
    Method(
        "lscf",
        "z",
        "matrix fraction, companion form",
        "not in the report",
        ("LSCF, polyreference least-squares complex frequency", "pLSCF", "PolyMAX"),
        fraction_companion,
        "fraction",
        ("controllable",),
    ),
)


def methods() -> tuple[Method, ...]:
    """Return the table: one entry a cell, with name, domain, realization, report section and the names it is known as.

    Examples
    --------
    >>> sorted({m.name for m in methods()})[:2]
    ['alternate', 'era']
    """
    return _TABLE


def find_method(name: str, domain: str | None, default_domain: str) -> Method:
    """Return the cell of a row name and a domain; without a domain the one that suits the data, else the row's only one.

    Raises
    ------
    DataError
        An unknown name, or a cell that does not exist.
    """
    check_choice("method", name, dict.fromkeys(m.name for m in _TABLE))
    cells = {m.domain: m for m in _TABLE if m.name == name}
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
