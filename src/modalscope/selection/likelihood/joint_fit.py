"""Fit the residues of all modes of a list together, alone or with the residual terms of the model whose poles are reported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.mode_fields import DIRECT
from modalscope.data.modes import ModalModel
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.residual_terms import ResidualTerms
from modalscope.data.response import Response, root_mean_squares
from modalscope.data.whitening import levels_of_channels
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.driven_basis import DrivenBasis
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.orthonormal import triangle_of

#: The fit ends where a round lowers the squared misfit by less than this part of it: residues then change by about 1e-5 of the residual ...
_MIN_DECREASE = 1e-10

#: ... and after so many rounds at most; each is a small fit on the compressed data.
_MAX_ROUNDS = 200

#: Singular values of unit columns below this are rounding.
_ROUNDING = 1e-12


#: Poles (n,), shapes (l, n) and participation (n, m).
_Modes = tuple[Array, Array, Array]


def joint_residues(
    response: Response, poles: Array, shapes: Array, held: _Modes | None = None
) -> tuple[ComplexArray, dict[str, Any]]:
    """Fit residues of rank one, R_j = c_j l_j, of all modes together to all data; poles are kept.

    min over c, l, terms of sum |Y - sum_j (c_j l_j g_j + conjugate) - terms|^2, every channel in parts of its level, from the given shapes
    on: participation with the shapes held, then shapes with the participation held, and so on. No round can raise the misfit, so that
    the result explains at least what the given shapes explain. The data are compressed once to as many rows as there are functions.

    `poles` (n,): rad/s, as the modes have them. `shapes` (l, n): starting values. `held`: poles, shapes and participation of modes with
    known residues, which are subtracted from the data.

    Returns
    -------
    shapes : array of complex, (l, n)
    fields : dict
        `participation` and the direct term or residuals, as a `ModalModel` has them.
    """
    powers = response.outside_powers
    basis = response.basis(poles - response.added_damping, powers)
    if held is not None:
        left = response.residual_of(held[0] - response.added_damping, *held[1:], powers)
        basis = replace(basis, data=left, whole=None)
    basis, (outputs, inputs, level) = basis.compressed(), _sides(response, None)
    shapes, participation, terms = _in_turn(replace(basis, data=basis.data / level), shapes / outputs[:, None])
    participation = response.of_inputs(participation * inputs)
    return shapes * outputs[:, None], {"participation": participation, **response.named_terms(terms * level, powers)}


def _sides(response: Response, sides: tuple[RealArray, RealArray] | None) -> tuple[RealArray, RealArray, RealArray]:
    """Return what outputs, drives and channels are divided by, (l,), (m,) or (m + R,), (l, m) or (l, 1): drives of records stay.

    `sides`: of outputs and inputs; None for the levels of the data, and one of correlations, whose channels are whitened elsewhere.
    """
    even = None if response.ambient else levels_of_channels(response.values)
    outputs, inputs = sides or even or (np.ones(count) for count in response.values.shape[1:])
    if response.separable:
        return outputs, inputs, np.outer(outputs, inputs)
    return outputs, np.ones(response.drives), outputs[:, None]


def _in_turn(basis: ModalBasis, shapes: Array) -> tuple[ComplexArray, ComplexArray, RealArray]:
    """Return shapes, participation and terms of least squares, each side fitted in turn to the other as long as that helps.

    What lies outside the span of the outputs' data is no part of any of them: many outputs are compressed to that span first.
    """
    rows, outputs, inputs = basis.data.shape
    if outputs > rows * inputs:
        flat = basis.data.transpose(1, 0, 2).reshape(outputs, -1)
        U, R = (np.asarray(each, float) for each in sla.qr(flat, mode="economic", check_finite=False))
        few = replace(basis, data=R.reshape(-1, rows, inputs).transpose(1, 0, 2), whole=None)
        shapes, participation, terms = _in_turn(few, U.T @ shapes)
        return U @ shapes, participation, U @ terms
    participation, terms = basis.fit_participation(shapes)
    best = float(np.linalg.norm(basis.data - basis.rebuilt(shapes, participation, terms))) ** 2
    for _ in range(_MAX_ROUNDS if shapes.shape[1] else 0):
        turned, _ = basis.fit_shapes(participation)
        again, more = basis.fit_participation(turned)
        now = float(np.linalg.norm(basis.data - basis.rebuilt(turned, again, more))) ** 2
        if not now < best:
            break
        shapes, participation, terms, gained, best = turned, again, more, best - now, now
        if gained < _MIN_DECREASE * best:
            break
    return shapes, participation, terms


class JointFit(NamedTuple):
    """Residues of modes, and what was fitted together with them.

    `shapes` (l, n). `participation` (n, m + R): of the inputs and, of records, of the ends of runs. `terms`: besides the modes.
    `direct`: the same for all frequencies, as a direct term or residuals, by the fields of a `ModalModel`.
    """

    shapes: ComplexArray
    participation: ComplexArray
    terms: ResidualTerms
    direct: dict[str, Any]

    def fields(self, response: Response) -> dict[str, Any]:
        """Return all that is reported of it besides the shapes, by the fields of a `ModalModel`."""
        participation = response.shortest_participation(response.of_inputs(self.participation))
        return {"participation": participation, "residual_terms": (self.terms,), **self.direct}


def joint_fit(
    response: Response,
    poles: Array,
    shapes: Array,
    fixed: Array,
    powers: tuple[int, ...],
    *,
    participation: Array | None = None,
    shapes_fixed: bool = False,
    rows: RealArray | None = None,
    sides: tuple[RealArray, RealArray] | None = None,
) -> JointFit:
    """Fit residues together with residual terms: the last fit, with the very model whose poles are reported.

    min over c, l, x of sum |W (Y - sum_j (c_j l_j g_j + conjugate) - B x)|^2, B the powers of the frequency and the functions of the
    `fixed` poles, x free in every channel. Without B the modes would take up what it explains, and their shapes would be biased.

    `poles` (n,), `fixed` (k,): as they are in the data. `shapes` (l, n): starting values, kept where `shapes_fixed`. Where the
    `participation` is given, (n, m) or (n, m + R), both are kept, and the terms alone are fitted, with ends of runs that are not given.
    `rows` (K,), `sides` (l,), (m,): standard deviations of rows, by default one, and of outputs and inputs, by default their levels.
    """
    channels = response.values.shape[1], len(response.input_dofs)
    outputs, inputs, level = _sides(response, sides)
    columns, basis = _compressed(response, poles, fixed, powers, rows, level)
    shapes, basis = shapes / outputs[:, None], replace(basis, terms=_span(columns))
    if participation is None and shapes_fixed:
        participation, _ = basis.fit_participation(shapes)
    elif participation is None:
        shapes, participation, _ = _in_turn(basis, shapes)
    else:
        participation = _with_ends(basis, shapes, participation / inputs[: participation.shape[1]])
    nothing = basis.of_terms(np.zeros((basis.terms.shape[1], level.size)))
    left = (basis.data - basis.rebuilt(shapes, participation, nothing)).reshape(len(columns), level.size)
    drives = None if response.separable else response.drives
    top = float(response.span[1]) or 1.0

    def terms(columns: RealArray, poles: Array, powers: tuple[int, ...]) -> ResidualTerms:
        x = _least_squares(columns, left) * level.reshape(-1)
        where: dict[str, Any] = {"top": top, "rate": response.sampling_rate, "band": response.span}
        return ResidualTerms.of_columns(x, np.asarray(poles, complex), powers, channels, drives, **where)

    found = terms(columns, fixed + response.added_damping, powers)
    first = len(response.outside_powers) * (1 if response.separable else channels[1])
    alone = terms(columns[:, : first if found.powers else 0], np.zeros(0), response.outside_powers)
    direct = {**dict.fromkeys(DIRECT), **response.named_terms(alone.terms, response.outside_powers)}
    return JointFit(
        np.asarray(shapes * outputs[:, None], complex), participation * inputs[: participation.shape[1]], found, direct
    )


def with_terms(response: Response, modes: ModalModel, fixed: Array, powers: tuple[int, ...]) -> ModalModel:
    """Return modes with residual terms fitted to what they leave of a response; their residues are kept.

    Participation in correlations, which no force made, is fitted together with the terms: shapes alone are kept.

    `fixed` (k,): poles of the terms, rad/s.
    """
    added, known = response.added_damping, modes.known_participation("residual terms")
    model = modes.poles - added, modes.shapes, fixed - added, powers
    if not response.ambient:
        fit = joint_fit(response, *model, participation=known)
        return replace(modes, residual_terms=(fit.terms,), **fit.direct)
    levels = np.maximum(root_mean_squares(response), np.finfo(float).tiny)
    fit = joint_fit(response, *model, shapes_fixed=True, sides=(levels, np.ones(known.shape[1])))
    return replace(modes, **fit.fields(response))


def for_judging(response: Response, modes: ModalModel) -> ModalModel:
    """Return modes with the residual terms that a list is judged with: without poles inside the band, the others fitted again.

    Modes that were missed or refused hide among the poles inside.
    """
    inside = [terms for terms in modes.residual_terms if len(terms.outside()) < len(terms.poles)]
    if len(modes.residual_terms) != 1 or not inside:
        return modes
    return with_terms(response, modes, inside[0].outside(), inside[0].powers or response.outside_powers)


def _span(columns: RealArray) -> RealArray:
    """Return an orthonormal basis of columns of any lengths, (K, r)."""
    U, d, _ = sla.svd(_unit(columns)[0], full_matrices=False, check_finite=False)
    return np.ascontiguousarray(U[:, : np.count_nonzero(d > _ROUNDING * d[:1])])


def _least_squares(columns: RealArray, target: RealArray) -> RealArray:
    """Return the least-squares coefficients of columns of any lengths, (k, channels); of those that are zero, zero."""
    unit, size = _unit(columns)
    x = np.linalg.lstsq(unit, target, rcond=_ROUNDING)[0]
    return np.asarray(x / np.where(size > 0, size, 1.0)[:, None])


def _unit(columns: RealArray) -> tuple[RealArray, RealArray]:
    """Return columns of length one, and their lengths; no unit of a drive counts, and zeros stay."""
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(columns / np.where(size > 0, size, 1.0)), size


def _with_ends(basis: ModalBasis, shapes: Array, participation: Array) -> ComplexArray:
    """Return participation with that of the ends of runs where it lacks, fitted with the terms free in every output."""
    if not isinstance(basis, DrivenBasis) or participation.shape[1] == basis.drives:
        return np.asarray(participation)
    U = basis.terms
    functions, data = (
        each - (U @ (U.T @ each.reshape(len(U), -1))).reshape(each.shape) for each in (basis.functions, basis.data)
    )
    alone = replace(basis, terms=np.zeros((len(U), 0)), functions=functions, data=data)
    ends = alone.fit_ends(shapes, participation, np.zeros((1, len(shapes), 0)))
    return np.hstack([participation, ends])


@singledispatch
def _compressed(
    response: Response, poles: Array, fixed: Array, powers: tuple[int, ...], rows: RealArray | None, level: RealArray
) -> tuple[RealArray, ModalBasis]:
    """Return the columns of powers and fixed poles, and the basis of the modes, on as many rows as there are columns.

    `rows`: what the rows are divided by. `level` (l, m) or (l, 1): what the channels are divided by.
    """
    k = 2 * len(fixed)
    whole = response.whole_basis(np.concatenate([fixed, poles]), powers)
    every, t = whole.columns, whole.terms.shape[1] + k
    if not every.shape[1]:  # there is nothing to fit
        return np.zeros((1, 0)), ModalBasis(np.zeros((1, 0)), np.zeros((1, 0)), np.zeros((1, *level.shape)))
    data = (whole.data / level).reshape(len(every), -1)
    if rows is not None:
        every, data = every / rows[:, None], data / rows[:, None]
    Q, R = (np.asarray(each, float) for each in sla.qr(every, mode="economic", check_finite=False))
    return R[:, :t], ModalBasis(R[:, :0], R[:, t:], (Q.T @ data).reshape(len(R), *level.shape))


@_compressed.register
def _(
    response: RecordSpectra,
    poles: Array,
    fixed: Array,
    powers: tuple[int, ...],
    rows: RealArray | None,
    level: RealArray,
) -> tuple[RealArray, ModalBasis]:
    """Return the same from products of some lines at a time."""
    k, drives, divisor = 2 * len(fixed), response.drives, np.ones(2 * response.count) if rows is None else rows

    def chunks() -> Iterator[RealArray]:
        first = 0
        for basis in response.pieces(np.concatenate([fixed, poles]), powers):
            count = len(basis.data) // 2
            lines = np.arange(first, first + count)
            own, others = basis.by_drive[:, :, k:], basis.by_drive[:, :, :k]
            flat = (each.reshape(2 * count, -1) for each in (others, own))
            columns = np.hstack([basis.terms, *flat, basis.data[:, :, 0] / level[:, 0]])
            yield columns / divisor[np.concatenate([lines, response.count + lines])][:, None]
            first += count

    t, f = next(chunks()).shape[1] - len(level) - 2 * len(poles) * drives, 2 * len(poles) * drives
    R = triangle_of(chunks, t + f + len(level))
    basis = DrivenBasis(terms=R[:, :0], functions=R[:, t : t + f], data=R[:, t + f :, None], drives=drives)
    return R[:, :t], basis
