"""Identify a model and its modes by one method at one order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Unpack

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.rebuilt import fit_error_of
from modalscope.data.response import Response
from modalscope.data.shown import Shown, cells_of, percent, summary_of
from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.matrix import DataMatrix
from modalscope.identification.method import Problem
from modalscope.identification.method_names import cell_label
from modalscope.identification.modal.eigenmodes import split_extraneous
from modalscope.identification.modal.state_space import state_space
from modalscope.identification.options import AllOptions, Options
from modalscope.identification.orders import choose
from modalscope.identification.pipeline import Pipeline, factor
from modalscope.identification.prepare import prepare
from modalscope.identification.sweep import Sweep
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, RealArray, check_count
from modalscope.numerics.resources import one_thread


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Identification(Shown):
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
    response : Response
        The data that were identified.
    settings : Options
        Every option with the value that was taken; `identify(data, method=..., domain=..., order=..., **settings)` repeats the result.
    notes : tuple of Note
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
    settings: Options
    notes: tuple[Note, ...]

    @property
    def poles(self) -> ComplexArray:
        """Poles of the modes, rad/s."""
        return self.modes.poles

    def rebuild(self) -> Response:
        """Return the response of the whole model on the lines or samples of the data.

        Residuals of modes outside the band, which "lscf" has, belong to `modes.frequency_response` and to `fit_error`: no state has them.
        """
        return self.response.rebuilt_by(self.state_space)


@named(AllOptions.__annotations__, ("largest_order", "deviations"))
@one_thread
def identify(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    order: int | None = None,
    largest_order: int = 60,
    deviations: bool = True,
    **options: Unpack[AllOptions],
) -> Identification:
    """Identify a structure by one cell of the table of methods, at one order.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse, Signals, Records or a list of records
        Records with inputs are taken on their own lines, or by another `route`; records without are turned into correlations first.
    method : str, optional
        A row of the table (`methods()`): "era", "polyreference", "alternate", "least_squares", ..., or a name from the literature such
        as "ssi-cov" or "polymax". By default "alternate" for frequency responses and records, "era" for impulse responses.
    domain : {"time", "z", "s"}, optional
        A column of the table; by default the one that suits the data.
    order : int, optional
        Number of states, the rank of the truncation; two for every mode. By default what stands out of the noise. Of "lscf" the
        degree of the polynomials, 30 by default.
    largest_order : int, optional
        How many singular values are looked at when no order is given; 60 by default.
    deviations : bool
        Whether standard deviations of the poles are wanted.
    band : (float, float), optional
        Lowest and highest frequency in Hz that is used.
    exclude : labels, optional
        Channels to leave out.
    route : {"auto", "records", "frf", "markov", "subspace", "decays", "correlation"}, optional
        The way from records with inputs: on their own lines, by estimated frequency responses, by an observer (OKID), projected on
        their past, or by the free decays after hits. By default what serves the method, and of several ways the one that suits the
        records. "correlation" is the way of records without inputs, which `analyze` then does not take as free decays either.
    delays : mapping of label to int, optional
        Samples by which outputs of records with inputs come late after the forces, which is taken out; {} for none. By default what is
        seen with certainty after random forces.
    reciprocal : bool, optional
        Whether inputs and outputs of responses to single forces are exchanged (H_ij = H_ji). By default where the inputs outnumber the
        outputs, as of a roving hammer, and no point that was both driven and measured contradicts: shapes are then over the drive points.
    block_rows, block_columns : int, optional
        Blocks of H(0); on lines block_rows is the degree of the polynomials and columns are lines.
    form : {"observable", "controllable", "smaller"}, optional
        Which side the shift is read off, in the time domain.
    weights : array (lines,), {"coherence", "variance", "level"}, optional
        Weights of the lines.
    initial_values, basis, source : optional
        Known initial terms, the polynomials and where shifted transfer functions come from, see
        `modalscope.identification.matrices.transfer`; source is "samples" (of impulse responses; of a sampled system's full grid of
        lines, periodised) or "elimination" (any lines).
    references : labels, optional
        Outputs of the past, of "ssi-data".
    factorization : {"auto", "dense", "gram", "randomized", "lanczos"}, optional
        The route to the singular vectors.
    reduction : {"projection", "markov"}, optional
        Of polyreference in the time domain to minimum order, see `modalscope.identification.realizations.reductions`.
    row_shifts, column_shifts, row_subsets, column_subsets, row_weights, column_weights, row_compression, column_compression : optional
        The data matrix in its generality, see `modalscope.identification.matrices.hankel`.
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
    problem = prepare(data, method, domain, **options)
    chosen: tuple[Note, ...] = ()
    if order is None:
        largest = check_count("largest_order", largest_order)
        choice = choose(problem.method.orders, largest, partial(_factored, problem))
        order, chosen = choice.order, choice.notes
    pipeline = factor(problem, order)
    return assemble(pipeline, order, chosen, deviations=deviations)


def _factored(problem: Problem, largest: int) -> tuple[DataMatrix, Factors]:
    pipeline = factor(problem, largest)
    return pipeline.matrix.observable, pipeline.factors


def assemble(
    pipeline: Pipeline, order: int, chosen: tuple[Note, ...] = (), *, deviations: bool = True
) -> Identification:
    """Return the identification of one order, with its fit error and modes apart from extraneous poles; `chosen`: why this order."""
    pending = Sweep(pipeline, [order], deviations=deviations)
    cut = pending.cut(order)
    model = state_space(pipeline.matrix, cut.triple, cut.modal)
    error, by_channel = fit_error_of(full(pipeline.matrix).compared(model, cut.modal.poles, cut.modal.fit))
    kept, rest = split_extraneous(cut.modal, cut.triple)
    kinds = cut.modes.kinds
    odd: dict[str, float] = {
        kind: kinds.count(kind) for kind in ("real", "nyquist", "unstable", "zero") if kind in kinds
    }
    text = f"poles that are not decaying oscillations: {', '.join(f'{count} {kind}' for kind, count in odd.items())}"
    no_modes = (Note("poles that are no modes", odd, text),) if odd else ()
    return Identification(
        method=pipeline.method.name,
        domain=pipeline.method.domain,
        order=cut.order,
        state_space=model,
        modes=cut.modes.take(kept).noted(pipeline.response.inseparable_inputs),
        extraneous=cut.modes.take(rest),
        singular_values=pipeline.factors.spectrum,
        fit_error=error,
        fit_error_by_channel=by_channel,
        response=pipeline.response,
        settings=pipeline.settings,
        notes=(*pipeline.notes, *chosen, *no_modes, *pending.notes_on([cut])),
    )


@summary_of.register
def _(found: Identification) -> str:
    found_at = f"{cell_label(found.method, found.domain)} at order {found.order}"
    return f"{found_at}: {summary_of(found.modes)}; fit error {percent(found.fit_error)}"


@cells_of.register
def _(found: Identification) -> list[list[str]]:
    return cells_of(found.modes)
