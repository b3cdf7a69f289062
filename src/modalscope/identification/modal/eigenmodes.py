"""Compute the modes of a model (poles, shapes, participation) and their accuracy indicators, and find extraneous poles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from modalscope.data.indicators import (
    OF_SHAPES,
    agreement,
    cluster_mpc,
    coherence,
    decay_step,
    mac,
    modal_singular_values,
    repeated,
)
from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.evolved import ModalSide
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.matrix import DataMatrix, Eigen, ModalFit, Triple
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import one_of_each_pair
from modalscope.numerics.operators import padded


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


def state_space(matrix: DataMatrix, model: Triple, modes: Eigenmodes) -> StateSpace:
    """Return the model as it was realized, with the gain of its innovations where the data matrix knows it."""
    made = deterministic(matrix, model, modes)
    return made if model.B is not None else full(matrix).with_noise(made)


def deterministic(matrix: DataMatrix, model: Triple, modes: Eigenmodes) -> StateSpace:
    """Return the model without noise; from lines in real modal coordinates, which do not depend on the polynomials."""
    if model.B is not None:
        whole = full(matrix).of_all_outputs(model)
        assert whole.B is not None
        return StateSpace(A=whole.A, B=whole.B, C=whole.C, D=modes.direct, dt=matrix.dt)
    z = modes.eigen.values
    # samples: Y(0) is the first sample there is
    participation = matrix.judged.of_inputs(modes.participation) * z[:, None] ** matrix.judged.steps_late
    poles = modes.poles if matrix.dt is None else z
    return from_modes(poles, modes.shapes, participation, modes.direct, matrix.dt)


def from_modes(poles: Array, shapes: Array, participation: Array, direct: Array, dt: float | None) -> StateSpace:
    """Return the real model of modes: a block [[a, w], [-w, a]] for each pair, one state for each real pole.

    With c = c_r + j c_i and l = l_r + j l_i a pair contributes C = 2 [c_r, c_i] and B = [l_r'; -l_i'], both scaled to one size.
    """
    n = np.where(poles.imag == 0, 1, 2)
    A, B = np.zeros((n.sum(), n.sum())), np.zeros((n.sum(), participation.shape[1]))
    C = np.zeros((shapes.shape[0], n.sum()))
    for j, k in enumerate(np.cumsum(n) - n):
        sizes = np.linalg.norm(shapes[:, j]), np.linalg.norm(participation[j])
        size = np.sqrt(sizes[0] * sizes[1]) or 1.0
        c, b = shapes[:, j] / (sizes[0] or 1.0) * size, participation[j] / (sizes[1] or 1.0) * size
        if n[j] == 1:
            A[k, k], B[k], C[:, k] = poles[j].real, b.real, c.real
            continue
        a, w = poles[j].real, poles[j].imag
        A[k : k + 2, k : k + 2] = [[a, w], [-w, a]]
        C[:, k], C[:, k + 1] = 2 * c.real, 2 * c.imag
        B[k], B[k + 1] = b.real, -b.imag
    return StateSpace(A=A, B=B, C=C, D=direct, dt=dt)


def followed(side: ModalSide) -> tuple[RealArray, RealArray]:
    """Return amplitude coherence over all blocks, and EMAC: an identified block against the modes' first one, grown.

    NaN where nothing is seen.
    """
    found = side.compare(agreement, decay_step)
    values = coherence(found.inner, found.identified, found.expected), found.agreement
    if found.seen is None:
        return values
    return np.where(found.seen, values[0], np.nan), np.where(found.seen, values[1], np.nan)


#: A model with its modes.
Part = tuple[Triple, Eigenmodes]


def nests(model: Triple) -> bool:
    """Whether modes of a model may stand beside those of larger ones: its states are their first ones, or no factors are compared with."""
    return model.factors is None or (model.span is None and len(model.A) == model.rank)


def together(parts: Sequence[Part]) -> Part:
    """Return the modes of models whose states nest, all of them as modes of the largest: states that a model has not are zero.

    `parts`: of one realization, at least one.
    """
    if len(parts) == 1:
        return parts[0]
    largest = max((model for model, _ in parts), key=lambda model: model.rank)
    modes = [modal for _, modal in parts]
    eigen = Eigen(
        np.concatenate([modal.eigen.values for modal in modes]),
        padded([modal.eigen.vectors.T for modal in modes]).T,
        padded([modal.eigen.left for modal in modes]),
    )
    return largest, Eigenmodes(np.concatenate([m.poles for m in modes]), eigen, _side_by_side([m.fit for m in modes]))


def _side_by_side(fits: Sequence[ModalFit]) -> ModalFit:
    """Return shapes and participation of all; terms, which no mode has for itself, are those of the first."""
    inner = [fit.fitted for fit in fits if fit.fitted is not None]
    return ModalFit(
        np.concatenate([fit.shapes for fit in fits], axis=1),
        np.concatenate([fit.participation for fit in fits]),
        fits[0].terms,
        fitted=_side_by_side(inner) if len(inner) == len(fits) else None,
    )


#: Shapes of repeated modes are independent; above this MAC two poles are one mode.
SPLIT_SHAPE = 0.9


def indicators_of(matrix: DataMatrix, model: Triple, modes: Eigenmodes) -> dict[str, RealArray]:
    """Return the accuracy indicators of the modes of one order; those that the structure of the data matrix does not give are left out."""
    return indicators_of_all(matrix, [(model, modes)])[0]


def indicators_of_all(matrix: DataMatrix, parts: Sequence[Part]) -> list[dict[str, RealArray]]:
    """Return the accuracy indicators of several orders: what concerns one mode alone is computed for all of them at once.

    `parts`: one order, or several: those whose models nest go together.
    """
    if len(parts) > 1 and not all(nests(model) for model, _ in parts):
        return [indicators_of(matrix, *part) for part in parts]
    model, modes = together(parts)
    found = _of_factors(matrix, model, modes)
    found |= {name: of(modes.shapes) for name, of in OF_SHAPES.items()}
    # growing poles count as undamped ones
    dt = matrix.dt or 1 / (2 * matrix.judged.span[1])
    z = np.exp(np.minimum(modes.poles.real, 0) * dt + 1j * modes.poles.imag * dt)
    found["msv"] = modal_singular_values(modes.shapes, modes.participation, z, matrix.judged.count)
    ends = np.cumsum([0, *(modal.poles.size for _, modal in parts)])
    each = [{name: values[a:b] for name, values in found.items()} for a, b in pairwise(ends)]
    for own, (_, modal) in zip(each, parts, strict=True):
        _within_order(own, modal)
    return each


def _within_order(found: dict[str, RealArray], modes: Eigenmodes) -> None:
    """Complete what modes of one order say of each other: repeated ones, and which is the strongest."""
    collinear, strength = found["mpc"], found["msv"]
    for group in repeated(modes.poles):
        # poles this close with one shape are one mode that was split, not repeated modes
        if np.max(mac(modes.shapes[:, group]) - np.eye(group.size)) < SPLIT_SHAPE:
            collinear[group] = cluster_mpc(modes.shapes[:, group])
    if "emac" in found:
        found["cmi"] = found["emac"] * collinear
    if strength.size and strength.max() > 0:
        found["msv"] = strength / strength.max()


def _of_factors(matrix: DataMatrix, model: Triple, modes: Eigenmodes) -> dict[str, RealArray]:
    """Return coherence and EMAC of both factors: where the columns say nothing (NaN, or None for all) the rows alone speak."""
    columns = full(matrix).column_side(model, modes.eigen, modes.fit)
    rows = full(matrix).row_side(model, modes.eigen, modes.fit)
    found: dict[str, RealArray] = {}
    of_inputs = None
    if columns is not None:
        found["amplitude_coherence"], of_inputs = followed(columns)
    if rows is None:
        return found
    by_rows, of_outputs = followed(rows)
    known = found.get("amplitude_coherence", by_rows)
    both = of_outputs if of_inputs is None else of_outputs * np.where(np.isnan(of_inputs), 1, of_inputs)
    return {"amplitude_coherence": np.where(np.isnan(known), by_rows, known), "emac": both, "emaco": of_outputs}
