"""Compute several orders of a sweep at once, as many as fit into the cache: their modes in one basis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from modalscope.identification.matrices.full import FullMatrix
from modalscope.identification.modal.eigenmodes import Eigenmodes
from modalscope.identification.pipeline import Pipeline
from modalscope.identification.sweep import Model, model_of
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import ModalBasis

#: Maximum sum of states times lines or samples of orders that are computed together: their arrays fit into the cache.
_MAX_NUMBERS_TOGETHER = 100_000


def first_models(pipeline: Pipeline, orders: Sequence[int]) -> list[Model | DataError]:
    """Return the first of increasing orders, or their errors: as many as are faster computed together, at least one."""
    models: list[Model | DataError] = []
    matrix, size = pipeline.matrix.fitted, 0
    several = isinstance(matrix, FullMatrix) and matrix.by_mode
    for order in orders:
        models.append(found := model_of(pipeline, order))
        if isinstance(found, DataError):
            continue
        size += len(found.triple.A) * pipeline.response.count
        if size > _MAX_NUMBERS_TOGETHER or not (several and found.triple.span is None):
            break
    bases = iter(_with_bases(pipeline, [model.modal for model in models if isinstance(model, Model)]))
    return [model if isinstance(model, DataError) else model._replace(modal=next(bases)) for model in models]


def _with_bases(pipeline: Pipeline, several: Sequence[Eigenmodes]) -> list[Eigenmodes]:
    """Return the modes of several orders with the basis of their poles, computed at once, where the fit has no misfit."""
    response = pipeline.matrix.fitted.judged
    compared = pipeline.response if pipeline.problem.whitening is None else response
    if getattr(pipeline.matrix.fitted, "weights", None) is not None or response is not compared:
        return list(several)
    fits = [modes.fit.fitted or modes.fit for modes in several]
    if not several or any(fit.misfit is not None or fit.basis is not None for fit in fits):
        return list(several)
    basis = response.basis(np.concatenate([modes.poles for modes in several]), fits[0].powers)
    ends = 2 * np.cumsum([0, *(modes.poles.size for modes in several)])
    several_bases = (replace(basis, functions=basis.functions[:, a:b]) for a, b in pairwise(ends))
    parts = several_bases if len(several) > 1 else [basis]  # one may have columns of inputs and ends, too
    return [_with_basis(modes, part) for modes, part in zip(several, parts, strict=True)]


def _with_basis(modes: Eigenmodes, basis: ModalBasis) -> Eigenmodes:
    """Return modes whose fit has this basis, or the fit of the whitened channels where there is one."""
    if modes.fit.fitted is None:
        return replace(modes, fit=replace(modes.fit, basis=basis))
    return replace(modes, fit=replace(modes.fit, basis=None, fitted=replace(modes.fit.fitted, basis=basis)))
