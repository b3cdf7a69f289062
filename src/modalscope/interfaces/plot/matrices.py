"""Describe the MAC matrix and the singular values of the data matrix."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data import ModalModel, StabilizationDiagram, indicators
from modalscope.identification.identify import Identification
from modalscope.interfaces.plot.diagrams import singular_values_picture
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import (
    Areas,
    Axis,
    Item,
    Panel,
    Picture,
    Words,
    axis_of_names,
    boxes,
    decimals,
    remark,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, complex_array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Maximum number of modes on a side for which the cells contain numbers, and the shade from which these are white.
_MAX_NUMBERED, _DARK = 16, 0.55

#: Maximum number of ticks of an axis.
_MAX_TICKS = 40


#: What has the singular values of its data matrix.
Factored = StabilizationDiagram | Identification


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
    return painted(mac_picture(a, b), ax)


def mac_picture(a: ModalModel | ArrayLike, b: ModalModel | ArrayLike | None = None) -> Picture:
    """Return the MAC of two sets of shapes, or the AutoMAC of one; of one output a remark."""
    if isinstance(a, ModalModel) and isinstance(b, ModalModel) and a.output_dofs != b.output_dofs:
        b = b.select(outputs=a.output_dofs)
    if len(_shapes(a)) == 1:
        return remark("One output was measured: shapes cannot be compared.")
    values = np.atleast_2d(indicators.mac(_shapes(a), None if b is None else _shapes(b)))
    title = "AutoMAC" if b is None else "MAC, rows against columns"
    i, j = (index.ravel() for index in np.indices(values.shape))
    shades = np.clip(np.nan_to_num(values.ravel()), 0, 1)
    items: list[Item] = [Areas(boxes(j - 0.48, j + 0.48, i - 0.48, i + 0.48), "blue", strength=shades)]
    for dark, ink in ((True, "paper"), (False, "ink")):
        kept = np.flatnonzero((shades > _DARK) == dark) if max(values.shape) <= _MAX_NUMBERED else np.zeros(0, int)
        items.append(Words(j[kept], i[kept], [f"{v:.2f}" if v >= 0.005 else "·" for v in shades[kept]], ink))
    across, down = _names(a if b is None else b, values.shape[1]), _names(a, len(values))
    down = replace(down, low=down.high, high=down.low)
    return Picture([Panel(across, down, items, title, "white 0, blue 1", equal=True, grid=False)], title, (720, 640))


def _names(modes: ModalModel | ArrayLike, count: int) -> Axis:
    """Return an axis with the names of modes: frequencies, or numbers of those that have none."""
    if isinstance(modes, ModalModel):
        label, names = "frequency [Hz]", [f"{f:.{decimals(modes.frequencies)}f}" for f in modes.frequencies]
    else:
        label, names = "mode", [str(k + 1) for k in range(count)]
    return replace(axis_of_names(label, names, _MAX_TICKS), low=-0.5, high=count - 0.5)


def _shapes(modes: ModalModel | ArrayLike) -> Array:
    if isinstance(modes, ModalModel):
        return modes.shapes
    return complex_array("shapes", modes, "(channels,) or (channels, modes)", (1, 2))


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
    return painted(singular_values_picture(source, order), ax)
