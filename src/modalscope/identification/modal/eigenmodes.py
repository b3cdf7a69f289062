"""Compute the modes of a model (poles, shapes, participation) and indicators of their shapes, and find extraneous poles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.data.indicators import OF_SHAPES
from modalscope.data.modes import ModalModel
from modalscope.identification.matrices.matrix import DataMatrix, Eigen, ModalFit, Triple
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import one_of_each_pair
from modalscope.numerics.handed import replaceable


@dataclass(frozen=True, eq=False, slots=True)
class Eigenmodes:
    """The modal form of one model: one pole of each pair, rad/s, with what belongs to it.

    `poles` (k,): rad/s, as identified (an exponential window's damping still in them). `eigen`: the same in the plane of the data matrix,
    with the vectors of A. `fit`: shapes, participation and terms.
    """

    poles: ComplexArray
    eigen: Eigen
    fit: ModalFit

    @property
    def shapes(self) -> ComplexArray:
        """Shapes, (l, k)."""
        return self.fit.shapes

    @property
    def participation(self) -> ComplexArray:
        """Participation referred to the impulse itself, (k, m)."""
        return self.fit.participation

    @property
    def direct(self) -> RealArray:
        """Direct term, (l, m): zero beside residuals."""
        return self.fit.terms[0] if self.fit.powers == (0,) else np.zeros(self.fit.terms.shape[1:])

    @property
    def amplitude(self) -> RealArray:
        """Size of each residue times its reach, its share of the response: what tells extraneous poles.

        On lines the reach is the norm of 1 / (x - s) over them: an undamped pole between two lines has little. For samples it is the
        root of the time it acts for.
        """
        size = np.linalg.norm(self.shapes, axis=0) * np.linalg.norm(self.participation, axis=1)
        if self.fit.reach is not None:
            return np.asarray(size * self.fit.reach)
        return np.asarray(size / np.sqrt(np.maximum(np.abs(self.poles.real), 1e-12 * np.abs(self.poles) + 1e-300)))


def eigenmodes(matrix: DataMatrix, model: Triple) -> Eigenmodes:
    """Return the modal form of a model (Eqs. 15-16); participation from B, or by least squares over lines or samples."""
    eigen = model.eigen()
    poles = matrix.to_s(eigen.values)
    kept = one_of_each_pair(poles)
    eigen = eigen.take(kept)
    return Eigenmodes(poles[kept], eigen, matrix.fit(model, eigen))


def split_extraneous(modes: Eigenmodes, model: Triple) -> tuple[Array, Array]:
    """Return the modes that a rank explains, and the extraneous ones of a canonical form: what the truncated factor explains least."""
    count = modes.poles.size
    if model.A.shape[0] <= model.rank:
        return np.arange(count), np.arange(0)
    # a negative real pole of a sampled system is one state, although its logarithm is not real
    states = np.where(modes.eigen.values.imag == 0, 1, 2)
    share = model.explained(modes.eigen)
    by_size = np.argsort(-(modes.amplitude if share is None else share), kind="stable")
    kept = np.sort(by_size[np.cumsum(states[by_size]) <= model.rank])
    return kept, np.setdiff1d(np.arange(count), kept)


def modal_model(matrix: DataMatrix, modal: Eigenmodes, indicators: Mapping[str, Array]) -> ModalModel:
    """Wrap the modal form of one order, with the damping of an exponential window taken off the poles."""
    response = matrix.judged
    terms: dict[str, Any] = {"feedthrough": modal.direct, **response.named_terms(modal.fit.terms, modal.fit.powers)}
    return ModalModel(
        poles=modal.poles + response.added_damping,
        shapes=modal.shapes,
        participation=response.of_inputs(modal.participation),
        quantity=response.quantity,
        dt=matrix.dt,
        held_input=response.held_input,
        indicators=dict(indicators),
        **terms,
        **response.labelled(),
    )


@replaceable("indicators_of_all")
def indicators_of_all(matrix: DataMatrix, parts: Sequence[tuple[Triple, Eigenmodes]]) -> list[dict[str, RealArray]]:
    """Return the indicators of the modes of several orders: those of shapes; of factors, see `modalscope.identification.modal.accuracy`."""
    return [{name: of(modes.shapes) for name, of in OF_SHAPES.items()} for _, modes in parts]
