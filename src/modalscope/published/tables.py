"""Published numbers, as they were printed: each with its source and the last digit that it has."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["TABLES", "Table"]


class Table(NamedTuple):
    """One published table.

    Attributes
    ----------
    name : str
        By which the recomputation is found.
    source : str
        Who published it.
    columns : tuple of str
    digits : tuple of int
        Decimals that each column was printed with.
    rows : tuple of tuple of float
    """

    name: str
    source: str
    columns: tuple[str, ...]
    digits: tuple[int, ...]
    rows: tuple[tuple[float, ...], ...]


def _column(name: str, source: str, column: str, digits: int, *values: float) -> Table:
    return Table(name, source, (column,), (digits,), tuple((value,) for value in values))


#: Hz: what the closed form gives, and what was identified.
_FIVE_STOREYS = (0.889952, 2.597758, 4.095108, 5.260697, 6.000096)

_IASC = "Johnson, Lam, Katafygiotis and Beck, J. Eng. Mech. 130 (2004), 3-15: the IASC-ASCE benchmark, 12 degrees of freedom"

TABLES = (
    Table(
        "three masses, structure",
        "pyyeti, documentation of its ERA example: the structure",
        ("f Hz", "zeta %"),
        (5, 1),
        ((1.33603, 2.0), (7.39083, 7.5), (13.79671, 5.0)),
    ),
    Table(
        "three masses, noisy record",
        "pyyeti, documentation of its ERA example: the noisy record",
        ("f Hz", "zeta %", "MSV", "EMAC", "EMACO", "MPC", "CMIO"),
        (4, 4, 3, 3, 3, 3, 3),
        (
            (1.3330, 6.5080, 0.838, 0.761, 0.779, 0.946, 0.737),
            (7.4181, 6.9215, 0.851, 0.768, 0.796, 0.999, 0.795),
            (13.7967, 4.8219, 1.000, 0.753, 0.837, 0.998, 0.836),
        ),
    ),
    _column(
        "five storeys",
        "pyOMA example: closed form of the chain",
        "f Hz",
        6,
        *_FIVE_STOREYS,
    ),
    _column(
        "five storeys, identified",
        "the same, from its responses",
        "f Hz",
        6,
        *_FIVE_STOREYS,
    ),
    _column("shear building", _IASC, "f Hz", 2, 9.41, 11.79, 16.38, 25.54, 32.01, 38.66, 48.01, 60.15),
)
