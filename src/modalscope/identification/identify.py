"""Data in, identification out: one method at one order, with its model, its modes and how far to trust them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.blocks.fraction import Fraction
from modalscope.blocks.shifted import Shifted
from modalscope.blocks.threads import one_thread
from modalscope.identification.accuracy import indicators_of
from modalscope.identification.eigenmodes import Eigenmodes, eigenmodes, from_modes, split_extraneous
from modalscope.identification.pipeline import Pipeline, build
from modalscope.identification.prepare import Data
from modalscope.modal.basis import basis_of_lines, fit_error, rebuilt_rows, scaled_terms
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.modes import ModalModel
from modalscope.model.response import Response, is_held, window_damping
from modalscope.model.statespace import StateSpace
from modalscope.realizations.order import recommend_order
from modalscope.realizations.triple import Triple

__all__ = ["Identification", "assemble", "identify", "realize", "rebuild"]

#: Degree of a matrix fraction when none is asked: enough for the modes of a usual band, whatever is left over turns out unstable.
_DEGREE = 30


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
    response: Response
    settings: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def poles(self) -> ComplexArray:
        """Poles of the modes, rad/s."""
        return self.modes.poles

    def rebuild(self) -> Response:
        """Return the response of the whole model on the lines or samples of the data.

        Residuals of modes outside the band, which "lscf" has, belong to `modes.frequency_response` and to `fit_error`: no state has them.
        """
        return rebuild(self.state_space, self.response)


def rebuild(model: StateSpace, response: Response) -> Response:
    """Return the response of a model where `response` was measured."""
    channels = {**response.labelled(), "processing": (), "quantity": response.quantity}
    if isinstance(response, FrequencyResponse):
        return model.frequency_response(response.frequencies, **channels)
    return model.impulse_response(response.samples, kind=response.kind, first_sample=response.first_sample, **channels)


@one_thread
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
        Of polyreference in the time domain to minimum order, see `modalscope.realizations.reduced`.
    row_shifts, column_shifts, row_subsets, column_subsets, row_weights, column_weights, row_compression, column_compression : optional
        The data matrix in its generality, see `modalscope.blocks.hankel`.
    largest_order : int, optional
        How many singular values are looked at when no order is given; 60 by default.
    **options
        Those from `band` on.

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
    """Return the state-space model alone, for control work.

    Parameters
    ----------
    data, method, domain, order, **options
        As in `identify`.
    """
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
    return ModalModel(
        poles=modal.poles + window_damping(response),
        shapes=modal.shapes,
        participation=modal.participation,
        feedthrough=modal.direct,
        lower_residual=lower,
        upper_residual=upper,
        quantity=response.quantity,
        dt=pipeline.matrix.dt,
        held_input=is_held(response),
        indicators=dict(indicators),
        **response.labelled(),
    )


def _state_space(pipeline: Pipeline, model: Triple, modal: Eigenmodes) -> StateSpace:
    """Return the model as it was realized; from lines in real modal coordinates, which do not depend on the polynomials."""
    if model.B is not None and not isinstance(pipeline.matrix, Fraction):
        return StateSpace(A=model.A, B=model.B, C=model.C, D=modal.direct, dt=pipeline.matrix.dt)
    poles, participation = modal.poles if pipeline.matrix.dt is None else modal.own, modal.participation
    if isinstance(pipeline.response, ImpulseResponse):  # Y(0) is the first sample there is
        participation = participation * modal.own[:, None] ** pipeline.response.first_sample
    return from_modes(poles, modal.shapes, participation, modal.direct, pipeline.matrix.dt)
