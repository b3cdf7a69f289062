"""Recompute published tables value by value on this installation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.identification.identify import identify
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.resources import one_thread
from modalscope.systems.chains import spring_chain
from modalscope.systems.examples import iasc_asce, three_masses, three_masses_record


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


#: Hz, of the closed form and identified.
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
    _column("five storeys", "pyOMA example: closed form of the chain", "f Hz", 6, *_FIVE_STOREYS),
    _column("five storeys, identified", "the same, from its responses", "f Hz", 6, *_FIVE_STOREYS),
    _column("shear building", _IASC, "f Hz", 2, 9.41, 11.79, 16.38, 25.54, 32.01, 38.66, 48.01, 60.15),
)


#: Maximum difference in units of the last printed digit: a printed number is rounded.
_MAX_ROUNDING = 0.51


@dataclass(frozen=True, slots=True)
class Value:
    """One published number and what this installation gives.

    `row`: from one. `digits`: decimals that were printed.
    """

    table: str
    source: str
    column: str
    row: int
    published: float
    computed: float
    digits: int

    @property
    def same(self) -> bool:
        """Whether the computed value rounds to the published one."""
        return bool(abs(self.computed - self.published) <= _MAX_ROUNDING * 10.0**-self.digits)


@one_thread
def recomputed() -> tuple[Value, ...]:
    """Return every published value of the tables that come with the package, and what this installation gives.

    Examples
    --------
    >>> all(value.same for value in recomputed())
    True
    """
    values = []
    for name, source, columns, digits, rows in TABLES:
        computed = _RECOMPUTED[name](np.array(rows))
        for (i, k), value in np.ndenumerate(computed):
            values.append(Value(name, source, columns[k], i + 1, rows[i][k], float(value), digits[k]))
    return tuple(values)


def _nearest(modes: ModalModel, frequencies: Array) -> ModalModel:
    """Return the mode nearest to each frequency."""
    return modes.take([int(np.argmin(np.abs(modes.frequencies - f))) for f in frequencies])


def _f_and_zeta(modes: ModalModel) -> RealArray:
    return np.column_stack([modes.frequencies, 100 * modes.damping_ratios])


def _noisy_record(printed: RealArray) -> RealArray:
    """Hankel matrix of 50 x 50 blocks, singular values kept while above .05 of the first, rounded up to even: 34."""
    found = identify(three_masses_record(), method="era", domain="time", order=34, block_rows=50, block_columns=50)
    modes = _nearest(found.modes, printed[:, 0])
    named_ = [modes.indicators[name] for name in ("msv", "emac", "emaco", "mpc")]
    return np.column_stack([_f_and_zeta(modes), *named_, named_[2] * named_[3]])


def _five_storeys(printed: RealArray) -> RealArray:
    response = spring_chain().frequency_response(np.linspace(0.1, 10, 200))
    return identify(response, method="alternate", domain="s", order=10).modes.frequencies[:, None]


_RECOMPUTED: dict[str, Callable[[RealArray], RealArray]] = {
    "three masses, structure": lambda printed: _f_and_zeta(three_masses().modes()),
    "three masses, noisy record": _noisy_record,
    "five storeys": lambda printed: spring_chain().modes().frequencies[:, None],
    "five storeys, identified": _five_storeys,
    "shear building": lambda printed: _nearest(iasc_asce().modes(), printed[:, 0]).frequencies[:, None],
}
