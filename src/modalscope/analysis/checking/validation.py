"""Validate modes on channels that they were not fitted to, and test the residual for whiteness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.analysis.workflow.simulation import ModelValidation, simulated
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.setups import as_test
from modalscope.data.shown import Shown, figures, percent, summary_of
from modalscope.data.statespace import StateSpace
from modalscope.identification.prepare import measure
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray, check_kind
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import one_thread
from modalscope.selection.judging.refine import refine, refinement
from modalscope.selection.likelihood.whitening import Colour

#: Minimum number of parts: the others must have something in common with the one that is left out.
_MIN_PARTS = 3

_VALUES = ("frequencies", "damping_ratios")


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Validation(Shown):
    """How well modes explain what they were not fitted to.

    Parameters
    ----------
    parts : tuple of str
        What was left out in turn: inputs, or outputs.
    fit_errors : array, (g,)
        norm(measured - rebuilt) / norm(measured) of each part by poles and shapes (or participation) of modes that were refined without it.
    fit_errors_with : array, (g,)
        The same by modes that were refined with it.
    frequencies_std, damping_ratios_std : array, (n,)
        Hz, ratio: sqrt((g - 1) / g sum (x_g - mean)^2) of the values without each part, the deviation by leaving out.
    correlation, uneven : float
        Of the residual of all data: of neighbouring lines or samples, and the scatter of its level over that of white noise.
    white : bool
        Whether that is no more than white noise shows.
    notes : tuple of Note
    """

    parts: tuple[str, ...]
    fit_errors: RealArray
    fit_errors_with: RealArray
    frequencies_std: RealArray
    damping_ratios_std: RealArray
    correlation: float
    uneven: float
    white: bool
    notes: tuple[Note, ...] = ()

    def table(self) -> str:
        """Return one line for each part that was left out, and the residual of all."""
        lines = [f"{'left out':12s} {'fit error %':>12s} {'fitted too %':>13s}"]
        for name, out, held in zip(self.parts, self.fit_errors, self.fit_errors_with, strict=True):
            lines.append(f"{name:12s} {figures(100 * out):>12s} {figures(100 * held):>13s}")
        return "\n".join([*lines, *map(str, self.notes)])


@named()
@one_thread
def validate(data: Any, modes: Any, *, leaving: str = "inputs") -> Validation | ModelValidation:
    """Say how well a model explains a record, or modes what they are not fitted to; data and model in either order.

    Of a state-space model and a record, simulate and predict the record, with the first state and the offset that fit best: the variance
    explained, and whether the errors of prediction are white. A continuous model is sampled at the record's rate, its inputs held.

    Of modes, leave out each input or output in turn, refine the modes on the others, and see how well they explain what was left out.

    Poles and shapes of an input that was left out are those of the other inputs; its participation alone is fitted (of an output: its
    components of the shapes). What is common to all inputs is explained as well as where it was fitted; what one of them alone makes up
    is not. The frequencies and damping ratios without each part give deviations, a second way beside those of `refine`.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or StateSpace
        In the band that the modes were identified in; or a state-space model.
    modes : ModalModel, Signals or Records
        Of a model a record with its inputs and outputs, at its rate.
    leaving : str
        "inputs" or "outputs".

    Returns
    -------
    Validation, or ModelValidation of a model

    Raises
    ------
    DataError
        Correlations or records, modes of other channels, fewer than three inputs or outputs.

    Examples
    --------
    >>> from modalscope import identify
    >>> from modalscope.systems import chain5
    >>> response = chain5().impulse_response(300, noise=0.01, seed=0)
    >>> seen = validate(response, identify(response, method="era", order=10).modes, leaving="outputs")
    >>> bool(seen.white), bool(seen.fit_errors.max() < 0.02)
    (True, True)
    """
    given = (data, modes)
    data, modes = given[::-1] if isinstance(data, ModalModel) or isinstance(modes, StateSpace) else given
    if isinstance(data, StateSpace):
        return simulated(data, as_test(modes) if isinstance(modes, list | tuple) else modes)
    check_kind("modes of validate", modes, ModalModel)
    check_choice("leaving", leaving, ("inputs", "outputs"))
    response = measure(data).response
    if response.ambient or not response.separable:
        have, change = "the data are correlations or records", "Give frequency or impulse responses."
        raise DataError("a validation on channels left out:", have, change)
    labels = response.input_dofs if leaving == "inputs" else response.output_dofs
    if len(labels) < _MIN_PARTS:
        change = f"Give {_MIN_PARTS} at least, or leave out the other side."
        raise DataError(f"leaving {leaving} out in turn needs more of them", f"there are {len(labels)}", change)
    held = refinement(response, modes)
    if held.settled is None:
        fault = f"none of the {len(modes)} given ones is significant in these data"
        raise DataError("a validation on channels left out needs modes", fault, "Give modes that were found in them.")
    whole, seen = held.modes(), held.settled.colour
    without = [_without(response, whole, leaving, k, len(labels)) for k in range(len(labels))]
    kept = [_error(response, whole, leaving, k) for k in range(len(labels))]
    f, zeta = (_by_leaving_out(np.array([getattr(one, name) for one in without])) for name in _VALUES)
    error = np.array([_error(response, one, leaving, k) for k, one in enumerate(without)])
    return Validation(
        parts=labels,
        fit_errors=error,
        fit_errors_with=np.array(kept),
        frequencies_std=f,
        damping_ratios_std=zeta,
        correlation=seen.correlation,
        uneven=seen.uneven,
        white=not seen.coloured,
        notes=_told(labels, error, np.array(kept), seen),
    )


def _without(response: Response, modes: ModalModel, leaving: str, k: int, count: int) -> ModalModel:
    """Return the modes refined without a part, where they were: what the others do not show stays as it was."""
    rest = [i for i in range(count) if i != k]
    some = replace(modes, unrefined=None, left_out=())
    found = refine(response.select(**{leaving: rest}), some.select(**{leaving: rest}))
    start = found if found.unrefined is None else found.unrefined
    own = np.array([int(np.argmin(np.abs(modes.poles - s))) for s in start.poles], dtype=int)
    poles, shapes = modes.poles.copy(), modes.shapes.copy()
    participation = modes.known_participation("leaving out").copy()
    poles[own] = found.poles
    if leaving == "inputs":
        shapes[:, own] = found.shapes
    else:
        participation[own] = found.known_participation("leaving out")
    return replace(some, poles=poles, shapes=shapes, participation=participation, shapes_std=None)


def _error(response: Response, modes: ModalModel, leaving: str, k: int) -> float:
    """Return the residual of one input or output when that part of the residues alone is fitted."""
    part = response.select(**{leaving: [k]})
    basis = part.whole_basis(modes.poles - response.added_damping, part.refined_powers)
    shapes, participation = modes.shapes, modes.known_participation("leaving out")
    if leaving == "inputs":
        participation, terms = basis.fit_participation(shapes)
    else:
        shapes, terms = basis.fit_shapes(participation)
    return float(np.linalg.norm(basis.data - basis.rebuilt(shapes, participation, terms)) / np.linalg.norm(basis.data))


def _by_leaving_out(values: RealArray) -> RealArray:
    g = len(values)
    return np.asarray(np.sqrt((g - 1) / g * np.sum((values - values.mean(axis=0)) ** 2, axis=0)))


def _told(labels: tuple[str, ...], out: RealArray, held: RealArray, seen: Colour) -> tuple[Note, ...]:
    worst = int(np.argmax(out / np.maximum(held, 1e-300)))
    residual = f"not white (lag-1 correlation {seen.correlation:.2g})" if seen.coloured else "white"
    text = (
        f"Median fit error {percent(np.median(out))} of parts left out, {percent(np.median(held))} of fitted ones; "
        f"worst {labels[worst]}, {figures(100 * out[worst])} against {percent(held[worst])}; residual of all {residual}"
    )
    return (Note("validation", {"out": float(np.median(out)), "with": float(np.median(held))}, text),)


@summary_of.register
def _(found: Validation) -> str:
    out, held = (100 * float(np.median(part)) for part in (found.fit_errors, found.fit_errors_with))
    left = f"{figures(out)} % unexplained where left out, {figures(held)} % where fitted (medians)"
    return f"validation: of {len(found.parts)} parts {left}; residual {'white' if found.white else 'coloured'}"
