"""One mode, seen in the model that it belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.model.checks import ComplexArray
from modalscope.model.mode_table import COLUMNS

if TYPE_CHECKING:
    from modalscope.model.modes import ModalModel

__all__ = ["Mode"]


@dataclass(frozen=True, eq=False, slots=True)
class Mode:
    """One mode of a `ModalModel`: `modes[0]` is the first; nothing is copied.

    Parameters
    ----------
    modes : ModalModel
        The model that it belongs to.
    index : int
        Which of its modes, from zero.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> first = chain5().modes()[0]
    >>> print(first, first.shape.size)
    0.9060 Hz, 0.247 % 4
    """

    modes: ModalModel
    index: int

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, Hz."""
        return float(np.abs(self.pole) / (2 * np.pi))

    @property
    def damping_ratio(self) -> float:
        """Damping ratio (0.01 is 1 %)."""
        return float(self.modes.damping_ratios[self.index])

    @property
    def pole(self) -> complex:
        """The pole in rad/s: of a conjugate pair the one above the real axis."""
        return complex(self.modes.poles[self.index])

    @property
    def kind(self) -> str:
        """What the pole is: mode, real, unstable, nyquist or zero."""
        return self.modes.kinds[self.index]

    @property
    def shape(self) -> ComplexArray:
        """The mode shape, (l,)."""
        return self.modes.shapes[:, self.index]

    @property
    def participation(self) -> ComplexArray | None:
        """How strongly each input drives the mode, (m,); None where that is not known."""
        return None if self.modes.participation is None else self.modes.participation[self.index]

    @property
    def indicators(self) -> Mapping[str, float]:
        """Accuracy indicators by name."""
        return {name: float(values[self.index]) for name, values in self.modes.indicators.items()}

    @property
    def reason(self) -> Mapping[str, Any]:
        """Why the mode is reported; empty where nothing was said."""
        return self.modes.reasons[self.index] if self.modes.reasons else {}

    @property
    def spreads(self) -> Mapping[str, float]:
        """Every deviation and gain that is known, by the name of its column, such as `frequency_std_hz`."""
        known = {column: getattr(self.modes, name) for column, name in COLUMNS.items()}
        return {column: float(values[self.index]) for column, values in known.items() if values is not None}

    def __repr__(self) -> str:
        return f"<mode {self.index + 1}: {self}>"

    def __str__(self) -> str:
        return f"{self.frequency:.4f} Hz, {100 * self.damping_ratio:.3f} %"
