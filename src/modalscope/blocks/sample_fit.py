"""Modes of a model of samples, referred to the impulse."""

from __future__ import annotations

import numpy as np

from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.model.impulse import ImpulseResponse

__all__ = ["fit_of_samples"]


def fit_of_samples(response: ImpulseResponse, model: Triple, eigen: Eigen) -> ModalFit:
    """Return shapes C X, participation X^-1 B referred to the impulse (Eqs. 15-16), and the direct term."""
    assert model.B is not None
    participation = eigen.left @ model.B
    if response.first_sample:
        participation = participation / eigen.values[:, None] ** response.first_sample
    known = response.feedthrough
    direct = np.zeros(response.values.shape[1:]) if known is None else known
    return ModalFit(np.asarray(model.C @ eigen.vectors), participation, direct[None])
