"""What a sweep asks of whoever knows the errors of the data: standard deviations of poles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from modalscope.data.deferred import Deferred
from modalscope.data.notes import Note
from modalscope.data.results import DEVIATIONS
from modalscope.identification.matrices.matrix import Eigen, Triple
from modalscope.identification.modal.eigenmodes import Eigenmodes
from modalscope.identification.sweep import Cut
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.numerics.resources import one_thread


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
        """Return what standard deviations of some poles of an order need; the noise is that of its fit."""

    def deviations(self, *asked: Asked) -> list[Deviations]:
        """Return the deviations of some poles of orders, NaN at others that are not known; each pole is computed once."""

    def take_from(self, other: Any) -> None:
        """Share the deviations of another pipeline with the same poles, and its noise: they depend on poles and data alone."""

    def note_on(self, asked: Iterable[Asked]) -> Note:
        """Return how the deviations were estimated, or why there are none."""


def deferred_deviations(cuts: Sequence[Cut]) -> dict[str, Any]:
    """Return the standard deviations of the reported poles of all orders, as fields of the diagram, computed when they are read."""
    due = [cut.due for cut in cuts if cut.due is not None]
    if len(due) < len(cuts):
        return {}
    asked, deviations = [one for _, one in due], due[0][0].deviations
    ends = np.cumsum([0, *(one.which.size for one in asked)])

    @one_thread
    def compute(index: IntArray) -> RealArray:
        """Take orders together, of each those of its poles that are asked: index into the diagram, increasing."""
        own = [
            (one, one.which[index[(index >= a) & (index < b)] - a])
            for one, (a, b) in zip(asked, pairwise(ends), strict=True)
        ]
        some = [one._replace(which=which) for one, which in own if which.size]
        found = zip(some, deviations(*some), strict=True)
        return np.concatenate([np.stack(std)[:, one.which] for one, std in found], axis=1)

    return dict.fromkeys(DEVIATIONS, Deferred(int(ends[-1]), compute))
