"""Ambient setups with common references: their correlations carried over to one, whatever the wind did in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modalscope.model.checks import Array, DataError, RealArray, check_count
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.robust import noise_threshold

__all__ = ["merge_setups"]

#: Consecutive lags of the references that stand for the state: times the references, more than the states.
_DEPTH = 20


@named()
def merge_setups(parts: Sequence[ImpulseResponse], *, depth: int = _DEPTH) -> ImpulseResponse:
    """Merge correlations of roving setups with the same references into one of all outputs.

    The forces differ from setup to setup, mode by mode: R_j(k) = C A^(k-1) G_j. The common references give the state: with
    X_j(k) = [R_j,ref(k); ...; R_j,ref(k + depth - 1)], every other output obeys R_j,rov(k) = M_j X_j(k) for all k, whatever
    G_j is. M_j is the least-squares solution, with the singular values of X_j above the noise; M_j X(k), X of
    the references' mean over all setups, is that output's correlation under common forces. Without noise it is exact when
    depth times the references is at least the number of states.

    Parameters
    ----------
    parts : sequence of ImpulseResponse
        Correlations with the same references, each of which is among the outputs of every part.
    depth : int
        Consecutive lags that stand for the state.

    Raises
    ------
    DataError
        Different references or sampling rates, references that a part does not hold as outputs, too few lags.

    References
    ----------
    The idea of Doehler, Andersen and Mevel, "Data merging for multi-setup operational modal analysis with data-driven SSI",
    IMAC 2010, applied to correlations; the threshold is `modalscope.model.robust.noise_threshold`.
    """
    first = parts[0]
    _check(parts, depth)
    lags = min(part.samples for part in parts) - depth + 1
    references = first.input_dofs
    of_references = [part.values[:, [part.output_dofs.index(dof) for dof in references]] for part in parts]
    common = _mean([R[: lags + depth - 1] for R in of_references])
    state = _stacked(common, depth, lags)
    names, columns, units = list(references), [common[:lags]], []
    for part, R in zip(parts, of_references, strict=True):
        roving = [i for i, dof in enumerate(part.output_dofs) if dof not in references]
        repeated = [part.output_dofs[i] for i in roving if part.output_dofs[i] in names]
        if repeated:
            raise DataError(
                "setups that share their references only were asked",
                f"{repeated[0]} is in several of them and no reference",
                "Add it to the references, or select it out of all setups but one.",
            )
        names += [part.output_dofs[i] for i in roving]
        if roving:
            M = _transfer(part.values[:lags, roving], _stacked(R, depth, lags))
            columns.append(np.einsum("ia,kar->kir", M, state, optimize=True))
    unit = {dof: u for part in parts for dof, u in zip(part.output_dofs, part.units[0], strict=True)}
    units = [unit[name] for name in names]
    merged = np.concatenate(columns, axis=1)
    order = list(first.output_dofs) + [name for name in names if name not in first.output_dofs]
    place = [names.index(name) for name in order]
    return replace(
        first,
        values=np.ascontiguousarray(merged[:, place]),
        feedthrough=None,
        output_dofs=tuple(order),
        units=(tuple(units[i] for i in place), first.units[1]),
        geometry=next((part.geometry for part in parts if part.geometry is not None), None),
        processing=(
            *first.processing,
            f"{len(parts)} setups merged over the references {', '.join(references)}, {depth} lags deep; R(0) is not carried over",
        ),
    )


def _check(parts: Sequence[ImpulseResponse], depth: int) -> None:
    check_count("depth", depth)
    if not parts:
        raise DataError("setups to merge were asked", "parts is empty", "Give the correlations of two setups or more.")
    first = parts[0]
    for number, part in enumerate(parts, 1):
        if part.input_dofs != first.input_dofs or part.sampling_rate != first.sampling_rate:
            raise DataError(
                "setups with the same references and sampling rate were asked",
                f"setup 1 has {', '.join(first.input_dofs)} at {first.sampling_rate:g} Hz, setup {number} "
                f"{', '.join(part.input_dofs)} at {part.sampling_rate:g} Hz",
                "Correlate all setups with the same references.",
            )
        missing = [dof for dof in first.input_dofs if dof not in part.output_dofs]
        if missing:
            raise DataError(
                "setups that hold all references as outputs were asked",
                f"setup {number} lacks {', '.join(missing)}",
                "Keep the references among the outputs of every setup.",
            )
        if part.samples < 3 * depth:
            raise DataError(
                f"setups with at least {3 * depth} lags were asked",
                f"setup {number} has {part.samples}",
                "Estimate the correlations with more lags.",
            )


def _mean(parts: Sequence[RealArray]) -> RealArray:
    """Return the mean of the references' correlations at the level of the first; weak setups count as much as strong ones."""
    scales = [float(np.sqrt(np.mean(R**2))) or 1.0 for R in parts]
    return np.asarray(np.mean([R / s for R, s in zip(parts, scales, strict=True)], axis=0) * scales[0])


def _stacked(R: Array, depth: int, lags: int) -> RealArray:
    """Return X(k) = [R(k); ...; R(k + depth - 1)], (lags, depth r, r)."""
    return np.concatenate([R[i : i + lags] for i in range(depth)], axis=1)


def _transfer(R: Array, X: Array) -> RealArray:
    """Return M with R(k) = M X(k) for all k, from the singular values of X above the noise."""
    wide = X.transpose(1, 0, 2).reshape(X.shape[1], -1)
    U, d, V = np.linalg.svd(wide, full_matrices=False)
    kept = d > max(noise_threshold(d, min(wide.shape) / max(wide.shape)), 1e-12 * d[0])
    flat = R.transpose(1, 0, 2).reshape(R.shape[1], -1)
    return np.asarray((flat @ V[kept].T / d[kept]) @ U[:, kept].T)
