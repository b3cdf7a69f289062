"""What a sweep asks of whoever knows the errors of the data: standard deviations of poles."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol

from modalscope.data.notes import Note
from modalscope.identification.matrices.matrix import Eigen, Triple
from modalscope.identification.modal.eigenmodes import Eigenmodes
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray


class Deviations(NamedTuple):
    """Standard deviations of frequencies (Hz) and damping ratios, (k,) each; NaN where they are withheld."""

    frequency: RealArray
    damping_ratio: RealArray


class Asked(NamedTuple):
    """Poles of a model whose deviations are asked.

    Attributes
    ----------
    order : int
    model : Triple
        Of that order.
    poles : array of complex
        All of that order, rad/s, as they are in the data.
    eigen : Eigen
        The same in the plane of the data matrix.
    which : array of int
        Those that are asked; the others are NaN.
    noise : object
        The noise of that order, of whoever answers.
    """

    order: int
    model: Triple
    poles: ComplexArray
    eigen: Eigen
    which: IntArray
    noise: Any


class Deviating(Protocol):
    """Standard deviations of the poles of the orders of one pipeline."""

    #: The noise in the data, and what was asked, by order.
    noise: Any
    asked: dict[int, Asked]

    def ask(self, order: int, model: Triple, modal: Eigenmodes, which: IntArray) -> Asked:
        """Return what the deviations of some poles of an order are computed of; its fit tells its noise."""

    def deviations(self, *asked: Asked) -> list[Deviations]:
        """Return the deviations of some poles of orders, NaN at others that are not known; each pole is computed once."""

    def take_from(self, other: Any) -> None:
        """Share the deviations of another pipeline with the same poles, and its noise: they depend on poles and data alone."""

    def note_on(self, asked: Iterable[Asked]) -> Note:
        """Return how the deviations were estimated, or why there are none."""
