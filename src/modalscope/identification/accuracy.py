"""How far to trust the modes of one order: every indicator that the data matrix gives."""

from __future__ import annotations

import numpy as np

from modalscope.blocks.fraction import Fraction
from modalscope.blocks.hankel import Hankel
from modalscope.identification.eigenmodes import Eigenmodes
from modalscope.identification.pipeline import Pipeline
from modalscope.modal.evolution import column_side, row_side
from modalscope.modal.indicators import cluster_mpc, clusters, mac, modal_singular_values, mpc, mpd
from modalscope.model.checks import RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.response import Response

__all__ = ["indicators_of"]

#: Shapes of repeated modes are independent; above this MAC two poles are one mode.
SPLIT_SHAPE = 0.9


def indicators_of(pipeline: Pipeline, order: int, modes: Eigenmodes) -> dict[str, RealArray]:
    """Return the accuracy indicators of the modes of one order; those that the structure of the data matrix does not give are left out."""
    found: dict[str, RealArray] = {}
    matrix, realization = pipeline.matrix, pipeline.realization
    if not realization.canonical and not isinstance(matrix, Fraction):
        vectors, rows, shapes, participation = modes.vectors, modes.rows, modes.shapes, modes.participation
        if isinstance(matrix, Hankel):  # its columns start from the first sample kept, not from the impulse
            participation = participation * modes.own[:, None] ** matrix.response.first_sample
        if pipeline.dual:
            vectors, rows, shapes, participation = rows.T, vectors.T, participation.T, shapes.T
        inner = column_side(matrix, realization, order, modes.own, rows, participation)
        silent = inner is None or bool(np.isnan(inner[1]).any())
        outer = row_side(matrix, realization, order, modes.own, vectors, shapes, coherence=silent)
        if pipeline.dual:
            outer, inner = inner, outer
        # where the columns say nothing (NaN, or None for all) the rows alone speak
        sides = [side for side in (inner, outer) if side is not None]
        if sides:
            found["amplitude_coherence"] = _first_number(
                *(coherence for _, coherence in sides if coherence is not None)
            )
        if outer is not None:
            found["emac"] = outer[0] * (1 if inner is None else np.where(np.isnan(inner[0]), 1, inner[0]))
            found["emaco"] = outer[0]
    collinear = mpc(modes.shapes)
    for group in clusters(modes.poles):
        # poles this close with one shape are one mode that was split, not repeated modes
        if group.size > 1 and np.max(mac(modes.shapes[:, group]) - np.eye(group.size)) < SPLIT_SHAPE:
            collinear[group] = cluster_mpc(modes.shapes[:, group])
    found["mpc"] = collinear
    if "emac" in found:
        found["cmi"] = found["emac"] * collinear
    dt = matrix.dt or 1 / (2 * _highest(pipeline.response))
    # growing poles count as undamped ones there
    z = np.exp(np.minimum(modes.poles.real, 0) * dt + 1j * modes.poles.imag * dt)
    strength = modal_singular_values(modes.shapes, modes.participation, z, _length(pipeline))
    found["msv"] = strength / strength.max() if strength.size and strength.max() > 0 else strength
    found["mpd"] = mpd(modes.shapes)
    return found


def _first_number(first: RealArray, *others: RealArray) -> RealArray:
    for other in others:
        first = np.where(np.isnan(first), other, first)
    return first


def _highest(response: Response) -> float:
    return float(response.frequencies[-1]) if isinstance(response, FrequencyResponse) else response.sampling_rate / 2


def _length(pipeline: Pipeline) -> int:
    response = pipeline.response
    return response.samples if isinstance(response, ImpulseResponse) else response.lines
