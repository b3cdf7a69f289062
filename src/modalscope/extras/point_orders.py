"""Choose orders of common denominators: lines that are interpolated, poles that are moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from modalscope.data.response import Response
from modalscope.identification.orders import UsualOrder, orders_compared, states_each


class _Interpolants(UsualOrder):
    """The order is the number of lines that are interpolated; with their conjugates about twice as many states."""

    #: Default number of lines, and the largest by default.
    usual, most = 15, 30

    def ladder(self, measured: Response) -> list[int]:
        """Numbers up to 30, or half of the lines."""
        return list(range(2, max(min(self.most, measured.count // 2), 2) + 1))


class _Poles(UsualOrder):
    """The order is the number of poles of a common denominator."""

    #: Default number of poles, and the largest by default: work goes with its cube.
    usual, most = 30, 40

    def ladder(self, measured: Response) -> list[int]:
        """Even numbers up to 40, or the number of lines less one."""
        return list(range(2, max(min(self.most, measured.count - 1), 2) + 1, 2))


INTERPOLANTS, POLES = _Interpolants(), _Poles()


@states_each.register
def _(rule: _Interpolants, response: Response) -> int:
    return 2


@orders_compared.register
def _(rule: _Interpolants, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
    return tuple(sorted({min(max(n // 2, 2), max(response.count // 2, 2)) for n in asked})), {}
