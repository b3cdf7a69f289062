"""Compute the accuracy indicators of modes: how well the rows and columns of the data matrix follow each of them."""

from __future__ import annotations

from collections.abc import Sequence
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
from modalscope.identification.matrices.evolved import ModalSide
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.matrix import DataMatrix, Eigen, ModalFit, Triple
from modalscope.identification.modal.eigenmodes import Eigenmodes
from modalscope.numerics.checks import RealArray
from modalscope.numerics.operators import padded


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


@np.errstate(over="ignore", invalid="ignore")  # a pole far outside may have a shape that no float holds
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
    known = np.where(np.isfinite(strength), strength, np.nan)
    if np.nanmax(known, initial=0.0) > 0:
        found["msv"] = known / np.nanmax(known)


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
