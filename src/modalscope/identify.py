"""Data in, identification out: one method at one order, with its model, its modes and how far to trust them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.blocks.fraction import Fraction
from modalscope.blocks.hankel import Hankel
from modalscope.blocks.shifted import Shifted
from modalscope.eigenmodes import Eigenmodes, eigenmodes, split_extraneous
from modalscope.indicators import cluster_mpc, clusters, mac, modal_singular_values, mpc, mpd
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.modes import ModalModel
from modalscope.model.statespace import StateSpace
from modalscope.pipeline import Data, Pipeline, build
from modalscope.realize.evolution import column_side, row_side
from modalscope.realize.order import recommend_order
from modalscope.realize.triple import Triple
from modalscope.residues import (
    basis_of_lines,
    fit_error,
    rebuilt_rows,
    scaled_terms,
)

__all__ = [
    "Eigenmodes",
    "Identification",
    "eigenmodes",
    "identify",
    "indicators_of",
    "realize",
    "rebuild",
    "split_extraneous",
]


#: Shapes of repeated modes are independent; above this MAC two poles are one mode.
SPLIT_SHAPE = 0.9


#: Degree of a matrix fraction when none is asked: enough for the modes of a usual band, whatever is left over turns out unstable.
_DEGREE = 30


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
        outer = row_side(matrix, realization, order, modes.own, vectors, shapes)
        inner = column_side(matrix, realization, order, modes.own, rows, participation)
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


def _highest(response: FrequencyResponse | ImpulseResponse) -> float:
    return float(response.frequencies[-1]) if isinstance(response, FrequencyResponse) else response.sampling_rate / 2


def _length(pipeline: Pipeline) -> int:
    response = pipeline.response
    return response.samples if isinstance(response, ImpulseResponse) else response.lines


@dataclass(frozen=True, eq=False, kw_only=True)
class Identification:
    """A model and its modes, found by one method at one order.

    Parameters
    ----------
    method, domain : str
        The cell of the table.
    order : int
        States kept: the rank of the truncation.
    state_space : StateSpace
        Continuous in the s-domain and under the bilinear map, else sampled.
    modes : ModalModel
    extraneous : ModalModel
        What a canonical form has beyond the rank; empty for the others.
    singular_values : array
        Of the data matrix.
    fit_error : float
        norm(measured - rebuilt) / norm(measured) over all channels.
    fit_error_by_channel : array, (l, m)
    response : ImpulseResponse or FrequencyResponse
        The data that were identified.
    settings : mapping
    notes : tuple of str
    """

    method: str
    domain: str
    order: int
    state_space: StateSpace
    modes: ModalModel
    extraneous: ModalModel
    singular_values: RealArray
    fit_error: float
    fit_error_by_channel: RealArray
    response: ImpulseResponse | FrequencyResponse
    settings: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def poles(self) -> ComplexArray:
        """Poles of the modes, rad/s."""
        return self.modes.poles

    def rebuild(self) -> ImpulseResponse | FrequencyResponse:
        """Return the response of the whole model on the lines or samples of the data.

        Residuals of modes outside the band, which "lscf" has, belong to `modes.frequency_response` and to `fit_error`: no state has them.
        """
        return rebuild(self.state_space, self.response)


def rebuild(model: StateSpace, response: ImpulseResponse | FrequencyResponse) -> ImpulseResponse | FrequencyResponse:
    """Return the response of a model where `response` was measured."""
    channels = {
        name: getattr(response, name) for name in ("output_dofs", "input_dofs", "units", "geometry", "quantity")
    }
    if isinstance(response, FrequencyResponse):
        return model.frequency_response(response.frequencies, **channels)
    return model.impulse_response(response.samples, kind=response.kind, first_sample=response.first_sample, **channels)


def identify(
    data: Data, *, method: str | None = None, domain: str | None = None, order: int | None = None, **options: Any
) -> Identification:
    """Identify a structure by one cell of the table of methods, at one order.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or Signals
        Records with inputs are turned into frequency responses first, records without into correlations.
    method : str, optional
        A row of the table (`methods()`): "era", "polyreference", "alternate", "least_squares", ... By default "alternate"
        for frequency responses and records, "era" for impulse responses.
    domain : {"time", "z", "s"}, optional
        A column of the table; by default the one that suits the data.
    order : int, optional
        Number of states, the rank of the truncation; two for every mode. By default what stands out of the noise. Of "lscf" the
        degree of the polynomials, 30 by default.
    band : (float, float), optional
        Lowest and highest frequency in Hz that is used.
    exclude : labels, optional
        Channels to leave out.
    block_rows, block_columns : int, optional
        Blocks of H(0); on lines block_rows is the degree of the polynomials and columns are lines.
    form : {"observable", "controllable", "smaller"}, optional
        Which side the shift is read off, in the time domain.
    weights : array (lines,), {"coherence", "variance", "level"}, optional
        Weights of the lines.
    initial_values, basis, source : optional
        Known initial terms, the polynomials and where shifted transfer functions come from, see `modalscope.blocks.transfer`;
        source is "samples" (of impulse responses; of a sampled system's full grid of lines, periodised) or "elimination" (any lines).
    factorization : {"auto", "dense", "gram"}, optional
        The route to the singular vectors.
    reduction : {"projection", "markov", "reversed"}, optional
        Of polyreference in the time domain to minimum order, see `modalscope.realize.reduced`.
    row_shifts, column_shifts, row_subsets, column_subsets, row_weights, column_weights, row_compression, column_compression : optional
        The data matrix in its generality, see `modalscope.blocks.hankel`.

    Returns
    -------
    Identification
        With `state_space`, `modes`, `extraneous`, `singular_values`, `fit_error`, `settings` and `notes`.

    Raises
    ------
    DataError
        Data that cannot be used, an order above the rank, an option that the method does not survive.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> response = chain5().state_space(dt=0.05).impulse_response(200)
    >>> found = identify(response, method="era", order=10)
    >>> len(found.modes), found.fit_error < 1e-9
    (5, True)
    """
    if order is None and method == "lscf":
        order = _DEGREE
    if order is None:
        probe = build(data, method=method, domain=domain, order=options.pop("largest_order", 60), **options)
        advice = recommend_order(probe.factors)
        order = advice.order
        if probe.method.factors == "complete" and not isinstance(probe.matrix, Fraction):
            # untruncated: room for the noise beside the modes, in whole blocks
            block = probe.factors.P.shape[0] // (probe.matrix.block_rows + 1)
            order = -(-2 * order // block) * block
        chosen = f"order {order} was chosen ({advice.confidence}): {advice.reason}"
        pipeline = build(data, method=method, domain=domain, order=order, **options)
        return assemble(replace(pipeline, notes=(*pipeline.notes, chosen)), order)
    pipeline = build(data, method=method, domain=domain, order=order, **options)
    return assemble(pipeline, order)


def realize(
    data: Data, *, method: str | None = None, domain: str | None = None, order: int | None = None, **options: Any
) -> StateSpace:
    """Return the state-space model alone, for control work; the options are those of `identify`."""
    return identify(data, method=method, domain=domain, order=order, **options).state_space


def assemble(pipeline: Pipeline, order: int) -> Identification:
    """Cut one order out of a pipeline and judge it."""
    model = pipeline.triple(order)
    modal = eigenmodes(pipeline, model)
    state_space = _state_space(pipeline, model, modal)
    error, by_channel = fit_error(*_measured_and_rebuilt(pipeline, modal, state_space))
    modes = modal_model(pipeline, modal, indicators_of(pipeline, order, modal))
    own, rest = split_extraneous(modal, model)
    notes = pipeline.notes
    odd = [
        f"{modes.kinds.count(kind)} {kind}" for kind in ("real", "nyquist", "unstable", "zero") if kind in modes.kinds
    ]
    if odd:
        notes = (*notes, f"poles that are not decaying oscillations: {', '.join(odd)}")
    return Identification(
        method=pipeline.method.name,
        domain=pipeline.method.domain,
        order=order,
        state_space=state_space,
        modes=modes.take(own),
        extraneous=modes.take(rest),
        singular_values=pipeline.factors.spectrum,
        fit_error=error,
        fit_error_by_channel=by_channel,
        response=pipeline.response,
        settings=pipeline.settings,
        notes=notes,
    )


def _measured_and_rebuilt(pipeline: Pipeline, modal: Eigenmodes, model: StateSpace) -> tuple[Array, Array]:
    """Return data and model where the model was fitted: on lines, also on those of a window of samples, or on all samples."""
    response, matrix = pipeline.response, pipeline.matrix
    if isinstance(response, FrequencyResponse) and modal.powers != (0,):
        basis = basis_of_lines(response, modal.poles, modal.powers)
        return basis.data, rebuilt_rows(basis, modal.shapes, modal.participation, modal.terms)
    if isinstance(response, FrequencyResponse):
        s = 2j * np.pi * response.frequencies
        return response.values, model.transfer(s if model.dt is None else np.exp(s * model.dt))
    rebuilt = rebuild(model, response).values
    if isinstance(matrix, Shifted):
        return matrix.transformed(response.values), matrix.transformed(rebuilt)
    return response.values, rebuilt


def modal_model(pipeline: Pipeline, modal: Eigenmodes, indicators: Mapping[str, Array]) -> ModalModel:
    """Wrap the modal form of one order, with the damping of an exponential window taken off the poles."""
    response = pipeline.response
    lower, upper = None, None
    if len(modal.powers) == 2 and isinstance(response, FrequencyResponse):
        lower, upper = scaled_terms(modal.terms, modal.powers, response.frequencies)
    added = response.added_damping if isinstance(response, FrequencyResponse) else 0.0
    held = response.sampling_rate is not None if isinstance(response, FrequencyResponse) else response.kind == "pulse"
    return ModalModel(
        poles=modal.poles + added,
        shapes=modal.shapes,
        participation=modal.participation,
        feedthrough=modal.direct,
        lower_residual=lower,
        upper_residual=upper,
        quantity=response.quantity,
        dt=pipeline.matrix.dt,
        held_input=held,
        indicators=dict(indicators),
        output_dofs=response.output_dofs,
        input_dofs=response.input_dofs,
        units=response.units,
        geometry=response.geometry,
        processing=response.processing,
    )


def _state_space(pipeline: Pipeline, model: Triple, modal: Eigenmodes) -> StateSpace:
    """Return the model as it was realized; from lines in real modal coordinates, which do not depend on the polynomials."""
    if model.B is not None and not isinstance(pipeline.matrix, Fraction):
        return StateSpace(A=model.A, B=model.B, C=model.C, D=modal.direct, dt=pipeline.matrix.dt)
    poles, participation = modal.poles if pipeline.matrix.dt is None else modal.own, modal.participation
    if isinstance(pipeline.response, ImpulseResponse):  # Y(0) is the first sample there is
        participation = participation * modal.own[:, None] ** pipeline.response.first_sample
    return from_modes(poles, modal.shapes, participation, modal.direct, pipeline.matrix.dt)


def from_modes(poles: Array, shapes: Array, participation: Array, direct: Array, dt: float | None) -> StateSpace:
    """Return the real model of modes: a block [[a, w], [-w, a]] for each pair, one state for each real pole.

    With c = c_r + j c_i and l = l_r + j l_i a pair contributes C = 2 [c_r, c_i] and B = [l_r'; -l_i'], both scaled to one size.
    """
    n = np.where(poles.imag == 0, 1, 2)
    A, B, C = (
        np.zeros((n.sum(), n.sum())),
        np.zeros((n.sum(), participation.shape[1])),
        np.zeros((shapes.shape[0], n.sum())),
    )
    for j, k in enumerate(np.cumsum(n) - n):
        size = np.sqrt(np.linalg.norm(shapes[:, j]) * np.linalg.norm(participation[j])) or 1.0
        c, b = (
            shapes[:, j] / (np.linalg.norm(shapes[:, j]) or 1.0) * size,
            participation[j] / (np.linalg.norm(participation[j]) or 1.0) * size,
        )
        if n[j] == 1:
            A[k, k], B[k], C[:, k] = poles[j].real, b.real, c.real
            continue
        a, w = poles[j].real, poles[j].imag
        A[k : k + 2, k : k + 2] = [[a, w], [-w, a]]
        C[:, k], C[:, k + 1] = 2 * c.real, 2 * c.imag
        B[k], B[k + 1] = b.real, -b.imag
    return StateSpace(A=A, B=B, C=C, D=direct, dt=dt)
