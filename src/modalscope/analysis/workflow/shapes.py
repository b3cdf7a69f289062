"""Fit shapes, residuals and modal masses to frequency responses, given poles (least-squares frequency domain, LSFD)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import known_quantity
from modalscope.data.indicators import OF_SHAPES, clusters
from modalscope.data.modes import ModalModel
from modalscope.data.responses import FrequencyResponse
from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredResponse
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, ComplexArray, RealArray, optional_array
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import ModalBasis, residual_powers, scaled_least_squares, scaled_terms
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.numerics.orthonormal import most_real


def free_residues(basis: ModalBasis) -> ComplexArray:
    """Return residues (n, l, m) of every channel by least squares, not of rank one."""
    columns = np.hstack([basis.terms, basis.functions])
    rows, outputs, inputs = basis.data.shape
    coefficients = scaled_least_squares(columns, basis.data.reshape(rows, -1))
    real, imaginary = coefficients[basis.terms.shape[1] :].reshape(-1, 2, outputs, inputs).swapaxes(0, 1)
    return np.asarray(real + 1j * imaginary)


#: Share of an output's energy below which the residual energy, a difference of sums, is computed from the rebuilt samples instead.
_MIN_SHARE_OF_DIFFERENCE = 1e-10


class Fitted(NamedTuple):
    """Shapes of some outputs.

    `outputs`: which. `shapes` (c, n). `left`, `whole` (c,): residual and total energy.
    """

    outputs: slice
    shapes: ComplexArray
    left: RealArray
    whole: RealArray


def fitted_shapes(stored: StoredResponse, modes: ModalModel) -> Iterator[Fitted]:
    """Yield shapes phi of all outputs, some at a time: y(k) = 2 Re sum_j phi_j z_j^k l_j' by least squares over samples and inputs.

    All outputs share one matrix, (N m, 2 n) real, so that its pseudo-inverse serves them all.

    `modes`: with participation in the inputs of the responses.

    Raises `DataError`: modes without participation, or in other inputs.
    """
    basis = _field_basis(stored, modes)
    size = np.linalg.norm(basis, axis=0)
    size = np.where(size > 0, size, 1.0)
    Q, d, turn = np.linalg.svd(basis / size, full_matrices=False)
    kept = d > len(Q) * np.finfo(float).eps * d[0]
    back = (turn[kept].T / d[kept]).T / size
    for part, X in stored.parts():
        found = X @ Q[:, kept]
        whole = np.einsum("lk,lk->l", X, X)
        left = whole - np.einsum("lk,lk->l", found, found)
        if not np.all(left > _MIN_SHARE_OF_DIFFERENCE * whole):
            X -= found @ Q[:, kept].T
            left = np.einsum("lk,lk->l", X, X)
        yield Fitted(part, (found @ back).view(np.complex128), left, whole)


def _field_basis(stored: StoredResponse, modes: ModalModel) -> RealArray:
    """Return what Re phi_j and Im phi_j of each mode give in all samples and inputs, (N m, 2 n)."""
    participation = modes.known_participation("shapes of all outputs")
    inputs = len(stored.input_dofs)
    if participation.shape[1] != inputs:
        raise DataError(
            f"shapes of responses to {inputs} inputs:",
            f"the inputs of the modes are {participation.shape[1]}",
            "Give the modes that were identified from these responses.",
        )
    first = stored.part(0, 1)
    g = first.basis(modes.poles - stored.added_damping).by_pole[:, None]  # (N, 1, n, 2)
    re, im = participation.real.T[None], participation.imag.T[None]  # (1, m, n)
    of_real, of_imaginary = g[..., 0] * re + g[..., 1] * im, g[..., 1] * re - g[..., 0] * im
    return np.stack([of_real, of_imaginary], axis=3).reshape(stored.samples * inputs, -1)


#: Maximum relative distance of repeated poles, which are one pole with several shapes.
_MAX_DISTANCE_OF_REPEATED = 1e-6


@named(response=FrequencyResponse, modes=ModalModel, kind=("complex", "real"), participation=("given", "free"))
def fit_residues(
    response: FrequencyResponse,
    modes: ModalModel,
    *,
    kind: str = "complex",
    residuals: bool = True,
    participation: str = "free",
    weights: ArrayLike | None = None,
) -> ModalModel:
    """Fit residues of rank one per mode, and residuals of the modes outside the band, to all lines; poles are kept.

    Complex modes: H = sum_j phi_j l_j' / (j w - s_j) + conjugates + L (j w)^(p-2) + U (j w)^p. Real modes of proportional damping:
    H = (j w)^p sum_j psi_j psi_j' / (m_j (w_j^2 - w^2 + 2 j zeta_j w_j w)) + the same residuals. p = 0, 1, 2 for displacement, velocity and
    acceleration.

    Parameters
    ----------
    response : FrequencyResponse
        Lines of any band.
    modes : ModalModel
        Its poles, and its participation where it is to be kept.
    kind : {"complex", "real"}
    residuals : bool
        Whether modes below and above the band are allowed for, by the response's quantity; without, a constant stands in their place.
    participation : {"free", "given"}
        "free": residue matrices first, of which the leading singular vectors are kept: one for a mode, for repeated modes as many as
        there are, or as many as references can tell. "given": the rows of `modes`, and shapes by one linear fit; rows that
        were read off one order of a model may belong to two halves of a mode and then fit badly.
    weights : array, (F,), optional
        Weights of the lines.

    Returns
    -------
    ModalModel
        Of unit modal mass where a driving point is measured and the quantity known, else with shapes of length one: `scaling` says
        which, `processing` how.

    Raises
    ------
    DataError
        Real modes or residuals of an unknown quantity, a residual at 0 Hz, fewer lines than unknowns, participation that is not there.

    Examples
    --------
    >>> import numpy as np
    >>> from modalscope.systems import chain5
    >>> s = chain5()
    >>> frf = s.frequency_response(np.linspace(0.3, 7, 400))
    >>> fit_residues(frf, s.modes()).scaling
    'unit modal mass, driving point 2:+X, 5:+X'
    """
    check_size(response)
    powers = _powers(response, residuals, kind)
    if len(modes) == 0:
        raise DataError("a fit of residues:", "there are no modes", "Identify modes first.")
    unknowns = 2 * len(modes) + len(powers)
    if 2 * response.lines < unknowns:
        raise DataError(
            f"residues of {len(modes)} modes and {len(powers)} residual terms need {-(-unknowns // 2)} lines",
            f"there are {response.lines}",
            "Widen the band or leave modes out.",
        )
    w = optional_array("weights", weights, "(lines,)", (response.lines,))
    poles = modes.poles - response.added_damping
    groups = clusters(poles, _MAX_DISTANCE_OF_REPEATED)
    poles = np.array([poles[group].mean() for group in groups])
    basis = _basis(response, poles, kind, powers, w)
    if participation == "given":
        basis = _repeat(basis, groups, [group.size for group in groups])
        index = np.concatenate(groups)
        rows = _given_rows(modes, response, kind)[index]
    else:
        ranks, rows = _free_rows(basis, groups)
        basis = _repeat(basis, groups, ranks)
        index = np.concatenate([group[:rank] for group, rank in zip(groups, ranks, strict=True)])
    shapes, terms = basis.fit_shapes(rows)
    back = np.argsort(index, kind="stable")
    kept, shapes, rows = index[back], shapes[:, back], rows[back]
    model = _model(
        response, modes.take(kept), shapes, rows, scaled_terms(terms, powers, response.frequencies), powers, kind
    )
    lost = len(modes) - kept.size
    told = (
        [f"{lost} repeated modes beyond what {response.values.shape[2]} references can tell left out"] if lost else []
    )
    how = f"{kind} modes, rank one each, participation {participation}, residuals {'of the quantity' if len(powers) > 1 else 'constant'}"
    said = f"shapes by least squares over {response.lines} lines ({'; '.join([how, *told])})"
    return _scaled(replace(model, processing=(*modes.processing, said)))


def _powers(response: FrequencyResponse, residuals: bool, kind: str) -> tuple[int, ...]:
    quantity = response.quantity
    if response.sampling_rate is not None:
        if kind == "real":
            raise DataError("real modes:", "the response is that of a sampled system", "Use kind='complex'.")
        return (0,)
    if kind == "real":
        known_quantity(quantity, "real modes:")
    elif residuals:
        outside = "residuals of modes outside the band:"
        known_quantity(quantity, outside, otherwise=", or residuals=False for a constant")
    return () if kind == "real" and not residuals else residual_powers(quantity, residuals)


def _basis(
    response: FrequencyResponse, poles: ComplexArray, kind: str, powers: tuple[int, ...], weights: Array | None
) -> ModalBasis:
    basis = response.basis(poles, powers, weights)
    if kind == "complex":
        return basis
    if np.any(poles.imag == 0):
        raise DataError("real modes:", "there are real poles", "Leave them out with take().")
    s = 2j * np.pi * response.frequencies[:, None]
    power = QUANTITIES[response.quantity or ""]
    one = s**power / (s**2 - 2 * poles.real * s + np.abs(poles) ** 2)
    if weights is not None:
        one = one * weights[:, None]
    functions = np.zeros((2 * response.lines, 2 * poles.size))
    functions[:, ::2] = np.vstack([one.real, one.imag])
    return replace(basis, functions=functions)


def _repeat(basis: ModalBasis, groups: list[Array], counts: list[int]) -> ModalBasis:
    """Return the basis with the functions of each group once for every shape it has."""
    columns = np.repeat(np.arange(len(groups)), counts)
    both = np.stack([2 * columns, 2 * columns + 1], axis=1).ravel()
    return replace(basis, functions=basis.functions[:, both])


def _given_rows(modes: ModalModel, response: FrequencyResponse, kind: str) -> ComplexArray:
    if modes.participation is None or modes.participation.shape[1] != response.values.shape[2]:
        found = "none" if modes.participation is None else f"that of {modes.participation.shape[1]} inputs"
        raise DataError(
            "participation='given':",
            f"the modes have {found}, the response has {response.values.shape[2]} inputs",
            "Use participation='free'.",
        )
    if kind == "complex":
        return modes.participation
    # turned to the real axis, where a mode of proportional damping has it but for a common factor
    return np.asarray(most_real(modes.participation.T).T.real, dtype=complex)


def _free_rows(basis: ModalBasis, groups: list[Array]) -> tuple[list[int], ComplexArray]:
    """Return how many shapes each group has and their participation rows, the leading right vectors of its residue matrix."""
    ranks, kept = [], []
    for group, residue in zip(groups, free_residues(basis), strict=True):
        rank = min(group.size, *residue.shape)
        ranks.append(rank)
        kept.append(np.linalg.svd(residue, full_matrices=False)[2][:rank])
    return ranks, np.concatenate(kept)


def _model(
    response: FrequencyResponse,
    modes: ModalModel,
    shapes: ComplexArray,
    rows: ComplexArray,
    terms: RealArray,
    powers: tuple[int, ...],
    kind: str,
) -> ModalModel:
    direct = terms[0] if powers == (0,) else None
    if kind == "real":
        p = QUANTITIES[response.quantity or ""]
        s = modes.poles
        if p == 2:  # the accelerance's own direct term
            direct = np.einsum("lj,jm->lm", shapes, rows).real
        rows = rows * (s**p / (2j * s.imag))[:, None]
    lower, upper = (terms[0], terms[1]) if len(powers) == 2 else (None, None)
    indicators = {**modes.indicators, **{name: of(shapes) for name, of in OF_SHAPES.items()}}
    if "emac" in modes.indicators:
        indicators["cmi"] = modes.indicators["emac"] * indicators["mpc"]
    held = modes.held_input if response.sampling_rate is not None else False
    return replace(
        modes,
        shapes=shapes,
        shapes_std=None,
        participation=rows,
        feedthrough=direct,
        lower_residual=lower,
        upper_residual=upper,
        residual_terms=(),
        quantity=response.quantity,
        dt=modes.dt if held else None,
        held_input=held,
        indicators=indicators,
        scaling="as identified",
        **response.labelled(),
    )


def _scaled(model: ModalModel) -> ModalModel:
    """Return unit modal mass where a driving point and the quantity are known, else shapes of length one."""
    driving = set(model.output_dofs) & set(model.input_dofs)
    return model.normalized("mass" if driving and model.quantity is not None and not model.held_input else "unit")
