"""Modes of several orders as those of the largest: what is said of each mode alone is then said of all of them at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modalscope.blocks.triple import Eigen, ModalFit, Triple, padded
from modalscope.modal.eigenmodes import Eigenmodes

__all__ = ["Part", "nests", "together"]

#: A model with its modes.
Part = tuple[Triple, Eigenmodes]


def nests(model: Triple) -> bool:
    """Whether the states of a model are the first of those of any larger one from the same factors."""
    return model.factors is not None and model.span is None and len(model.A) == model.rank


def together(parts: Sequence[Part]) -> Part:
    """Return the modes of models whose states nest, all of them as modes of the largest: states that a model has not are zero.

    Parameters
    ----------
    parts : sequence of (Triple, Eigenmodes)
        Of one realization, at least one.
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
