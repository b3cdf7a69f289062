"""Draw the MAC matrix and the singular values of the data matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data import ModalModel, indicators
from modalscope.interfaces.plot._style import (
    DOTTED,
    INK,
    VERMILLION,
    decimals,
    dress,
    frameless,
    key,
    new_axes,
    one_output,
    sequential,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, RealArray, complex_array, real_array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Maximum number of modes on a side for which the cells contain numbers.
_MAX_NUMBERED = 16

#: Maximum number of ticks of an axis.
_MAX_TICKS = 40


@runtime_checkable
class Factored(Protocol):
    """An object with the singular values of its data matrix, such as a diagram."""

    @property
    def singular_values(self) -> RealArray:
        """The singular values, largest first."""


@named()
def mac(a: ModalModel | ArrayLike, b: ModalModel | ArrayLike | None = None, ax: Axes | None = None) -> Axes:
    """Draw the modal assurance criterion between two sets of shapes, or the AutoMAC of one set; of one output a remark instead.

    Parameters
    ----------
    a, b : ModalModel or array (l, n)
        Shapes as columns; `b` is `a` by default. The channels of two models are matched by their labels.
    ax : Axes, optional

    Raises
    ------
    DataError
        Shapes of different channels.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> ax = mac(chain5().modes())
    >>> ax.get_title(loc="left"), len(ax.texts)
    ('AutoMAC', 25)
    """
    ax = new_axes(ax, (7.2, 6.4))
    if isinstance(a, ModalModel) and isinstance(b, ModalModel) and a.output_dofs != b.output_dofs:
        b = b.select(outputs=a.output_dofs)
    if len(_shapes(a)) == 1:
        return one_output(ax, "shapes cannot be compared")
    values = indicators.mac(_shapes(a), None if b is None else _shapes(b))
    ax.imshow(values, cmap=sequential(), vmin=0, vmax=1, aspect="equal")
    rows, columns = values.shape
    if max(rows, columns) <= _MAX_NUMBERED:
        size = float(np.clip(80 / max(rows, columns), 6.5, 10))
        for i, j in np.ndindex(rows, columns):
            text = f"{values[i, j]:.2f}" if values[i, j] >= 0.005 else "·"
            ax.text(j, i, text, ha="center", va="center", fontsize=size, color="white" if values[i, j] > 0.55 else INK)
    dress(ax, title="AutoMAC" if b is None else "MAC, rows against columns", grid=False)
    _name_modes(ax, a, a if b is None else b, (rows, columns))
    ax.tick_params(length=0)
    frameless(ax)
    ax.set_xticks(np.arange(-0.5, columns), minor=True)
    ax.set_yticks(np.arange(-0.5, rows), minor=True)
    ax.grid(which="minor", color="white", linewidth=1.5)
    return ax


def _shapes(modes: ModalModel | ArrayLike) -> Array:
    if isinstance(modes, ModalModel):
        return modes.shapes
    return complex_array("shapes", modes, "(channels,) or (channels, modes)", (1, 2))


def _name_modes(ax: Axes, a: ModalModel | ArrayLike, b: ModalModel | ArrayLike, counts: tuple[int, int]) -> None:
    for modes, count, axis in ((a, counts[0], ax.yaxis), (b, counts[1], ax.xaxis)):
        every = max(1, -(-count // _MAX_TICKS))
        names = [str(i + 1) for i in range(count)]
        if isinstance(modes, ModalModel):
            names = [f"{f:.{decimals(modes.frequencies)}f}" for f in modes.frequencies]
        axis.set_ticks(np.arange(count)[::every], names[::every])
        axis.set_label_text("frequency [Hz]" if isinstance(modes, ModalModel) else "mode")
    if counts[1] > 7 and isinstance(b, ModalModel):
        ax.tick_params(axis="x", rotation=90)


@named()
def singular_values(source: Factored | ArrayLike, ax: Axes | None = None, *, order: int | None = None) -> Axes:
    """Draw the singular values of the data matrix, largest first, relative to the largest.

    Parameters
    ----------
    source : diagram, identification or array (k,)
    ax : Axes, optional
    order : int, optional
        Recommended or chosen order, marked by a line.

    Raises
    ------
    DataError
        Values that are not finite numbers along one axis.
    """
    given = source.singular_values if isinstance(source, Factored) else source
    values = real_array("singular_values", given, "(values,)", 1)
    ax = new_axes(ax, (9.0, 4.8))
    largest = float(np.max(values, initial=0.0)) or 1.0
    positive = np.flatnonzero(values > 0)
    ax.plot(positive + 1, values[positive] / largest, label="singular values", **DOTTED)
    if positive.size:
        ax.set_yscale("log")
    dress(ax, xlabel="number", ylabel="singular value / largest")
    ax.set_xlim(0, values.size + 1)
    if order is not None:
        ax.axvline(order + 0.5, color=VERMILLION, linewidth=1.1, linestyle=(0, (5, 3)), label=f"order {order}")
        key(ax)
    return ax
