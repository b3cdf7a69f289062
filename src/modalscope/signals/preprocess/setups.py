"""Merge ambient setups with common references: transfer their correlations to common forces, or stack them as groups of inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data.channels import source_of
from modalscope.data.responses import ImpulseResponse
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_size
from modalscope.numerics.arguments import COUNT, named
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.statistics import noise_threshold
from modalscope.signals.preprocess.correlation import estimate_correlation

#: Maximum number of columns of joined setups, and the energy of a significant correlation over that of its last quarter.
_MAX_COLUMNS, _SIGNIFICANT_ENERGY = 48, 3.0

#: By default the state spans the lags over this number: a good part of a period of the slowest mode, short against the fitted lags. It has
#: at most so many rows, one lag in several.
_LAGS_OVER_SPAN, _MAX_STATE_ROWS = 5, 300


def correlations(setups: Setups, **options: Any) -> tuple[ImpulseResponse, ...]:
    """Return the correlation of every setup with the references, by `estimate_correlation` with options."""
    return tuple(estimate_correlation(part, **{"references": setups.references, **options}) for part in setups.parts)


def joined_setups(setups: Setups) -> ImpulseResponse:
    """Stack the correlations of all setups as columns (lags, l, columns), each setup a group of inputs, with the outputs that it lacks.

    R_j(k) = C A^(k-1) G_j in every setup j, with rows for its outputs alone. M_i of a setup i that has an output gives its row in all
    others, M_i X_j(k) (see `merge_setups`), so that all are columns of one Markov sequence. The lags are the significant ones; the columns
    are all channels of every setup, or, where these would be more than 48, the common references alone.
    """
    references, outputs = setups.references, setups.output_dofs
    few = sum(len(part.output_dofs) for part in setups.parts) <= _MAX_COLUMNS
    parts = correlations(setups, references=None if few else references)
    count = significant_lags(parts)
    parts = tuple(replace(part, values=part.values[:count] / _level(part, references) ** 2) for part in parts)
    span, step = _span(parts, None, len(references))
    lags = count - span
    states = [_stacked(_rows(part, references), span, step) for part in parts]
    blocks = [np.zeros((lags, len(outputs), len(part.input_dofs))) for part in parts]
    having = {dof: [i for i, part in enumerate(parts) if dof in part.output_dofs] for dof in outputs}
    for i, part in enumerate(parts):
        roving = [dof for dof in part.output_dofs if dof not in references]
        M = _transfer(_rows(part, roving)[:lags], states[i])
        places = [outputs.index(dof) for dof in roving]
        for j, block in enumerate(blocks):
            if j != i:
                weights = np.array([0.0 if j in having[dof] else 1 / len(having[dof]) for dof in roving])
                block[:, places] += np.einsum("ia,kar->kir", M * weights[:, None], states[j], optimize=True)
        blocks[i][:, [outputs.index(dof) for dof in part.output_dofs]] = part.values[:lags]
    return _as_one(setups, parts, np.concatenate(blocks, axis=2), lags)


def _as_one(setups: Setups, parts: Sequence[ImpulseResponse], values: RealArray, lags: int) -> ImpulseResponse:
    """Return the columns of all setups as one correlation, with inputs labelled by setup."""
    groups = setups.groups and tuple(setups.groups[j] for j, part in enumerate(parts) for _ in part.input_dofs)
    note = f"{len(parts)} setups merged through reference channels {', '.join(setups.references)}, {lags} lags"
    return ImpulseResponse(
        values=values,
        sampling_rate=setups.sampling_rate,
        kind="correlation",
        quantity=setups.quantity,
        output_dofs=setups.output_dofs,
        input_dofs=tuple(f"{dof} in setup {j + 1}" for j, part in enumerate(parts) for dof in part.input_dofs),
        units=(setups.units[0], None),  # type: ignore[arg-type]
        groups=groups,
        geometry=setups.geometry,
        source_path=setups.source_path,
        processing=(*setups.processing, note),
    )


def significant_lags(parts: Sequence[ImpulseResponse]) -> int:
    """Return the lags up to which correlations exceed their scatter, which has a constant level once the modes have decayed.

    There the energy of all pairs, each normalized, in windows of a twentieth of the lags exceeds three times that of the last quarter. All
    lags are returned where it never does.
    """
    count = min(part.samples for part in parts)
    energy = np.zeros(count)
    for part in parts:
        size = np.abs(part.values[:count]).max(axis=0)
        energy += np.sum((part.values[:count] / np.where(size > 0, size, 1)) ** 2, axis=(1, 2))
    width = max(count // 20, 1)
    smooth = np.convolve(energy, np.full(width, 1 / width), mode="valid")
    significant = np.flatnonzero(smooth > _SIGNIFICANT_ENERGY * np.median(smooth[-max(len(smooth) // 4, 1) :]))
    return int(significant[-1] + width) if significant.size else count


@named(depth=COUNT)
def merge_setups(parts: Sequence[ImpulseResponse], *, depth: int | None = None) -> ImpulseResponse:
    """Merge correlations of roving setups with the same references into one of all outputs.

    The forces differ from setup to setup, mode by mode: R_j(k) = C A^(k-1) G_j. The common references give the state: with
    X_j(k) = [R_j,ref(k); R_j,ref(k + s); ...; R_j,ref(k + (depth - 1) s)], every other output obeys R_j,rov(k) = M_j X_j(k) for all k,
    whatever G_j is. M_j is the least-squares solution, with the singular values of X_j above the noise; M_j X(k), X of
    the references' mean over all setups, is that output's correlation under common forces. Without noise it is exact when
    depth times the references is at least the number of states. With noise the span of X_j should be a good part of the slowest mode's
    period, whatever the sampling rate. An output that several setups have is their mean.

    Parameters
    ----------
    parts : sequence of ImpulseResponse
        Correlations with the same references, each of which is among the outputs of every part.
    depth : int, optional
        Consecutive lags that make the state (s = 1); by default a fifth of the lags, with the s that gives 300 rows of X_j.

    Raises
    ------
    DataError
        Different references or sampling rates, references missing among the outputs of a part, too few lags.

    References
    ----------
    The idea of Doehler, Andersen and Mevel, "Data merging for multi-setup operational modal analysis with data-driven SSI",
    IMAC 2010, applied to correlations; the threshold is `modalscope.numerics.statistics.noise_threshold`.
    """
    first = parts[0]
    _check(parts, depth)
    span, step = _span(parts, depth)
    lags = min(part.samples for part in parts) - span
    of_references = [_rows(part, first.input_dofs)[: lags + span] for part in parts]
    # the mean at the level of the first: weak setups count as much as strong ones
    scales = [float(np.sqrt(np.mean(R**2))) or 1.0 for R in of_references]
    common = np.mean([R / s for R, s in zip(of_references, scales, strict=True)], axis=0) * scales[0]
    state = _stacked(common, span, step)
    transferred: dict[str, list[RealArray]] = {}
    for part, R in zip(parts, of_references, strict=True):
        roving = [dof for dof in part.output_dofs if dof not in first.input_dofs]
        if roving:
            M = _transfer(_rows(part, roving)[:lags], _stacked(R, span, step))
            for row, dof in zip(M, roving, strict=True):
                transferred.setdefault(dof, []).append(np.einsum("a,kar->kr", row, state))
    names = [*first.input_dofs, *transferred]
    columns = [common[:lags], *(np.mean(rows, axis=0)[:, None] for rows in transferred.values())]
    units = {dof: unit for part in parts for dof, unit in zip(part.output_dofs, part.units[0], strict=True)}
    merged = np.concatenate(columns, axis=1)
    order = list(first.output_dofs) + [name for name in names if name not in first.output_dofs]
    note = f"{len(parts)} setups merged through reference channels {', '.join(first.input_dofs)}, {span + 1} lags deep; R(0) is dropped"
    return replace(
        first,
        values=np.ascontiguousarray(merged[:, [names.index(name) for name in order]]),
        feedthrough=None,
        output_dofs=tuple(order),
        units=(tuple(units[dof] for dof in order), first.units[1]),
        geometry=next((part.geometry for part in parts if part.geometry is not None), None),
        source_path=source_of(parts),
        processing=(*first.processing, note),
    )


def _check(parts: Sequence[ImpulseResponse], depth: int | None) -> None:
    least = 3 * (2 if depth is None else depth)
    if not parts:
        raise DataError(
            "merging needs the correlations of two setups or more",
            "the list is empty",
            "Give the correlations of two setups or more.",
        )
    first = parts[0]
    for number, part in enumerate(parts, 1):
        check_size(part)
        if part.input_dofs != first.input_dofs or part.sampling_rate != first.sampling_rate:
            own = (f"{', '.join(p.input_dofs)} at {p.sampling_rate:g} Hz" for p in (first, part))
            have = f"setup 1 has {next(own)}, setup {number} {next(own)}"
            change = "Correlate all setups with the same references."
            raise DataError("setups need the same references and sampling rate", have, change)
        missing = ", ".join(dof for dof in first.input_dofs if dof not in part.output_dofs)
        if missing:
            change = "Keep the references among the outputs of every setup."
            raise DataError(
                "every setup needs all references among its outputs", f"setup {number} lacks {missing}", change
            )
        if part.samples < least:
            asked, change = f"setups with at least {least} lags:", "Estimate more lags."
            raise DataError(asked, f"setup {number} has {part.samples}", change)


def _rows(part: ImpulseResponse, dofs: Sequence[str]) -> RealArray:
    """Return the correlations of some outputs, (lags, outputs, inputs)."""
    return part.values[:, [part.output_dofs.index(dof) for dof in dofs]]


def _level(part: ImpulseResponse, references: Sequence[str]) -> float:
    """Return the RMS of the references."""
    assert part.feedthrough is not None
    power = [part.feedthrough[part.output_dofs.index(dof), part.input_dofs.index(dof)] for dof in references]
    return float(np.sqrt(np.mean(power))) or 1.0


def _span(parts: Sequence[ImpulseResponse], depth: int | None, references: int | None = None) -> tuple[int, int]:
    """Return the lags from the first to the last row of X, and the step between two."""
    if depth is not None:
        return depth - 1, 1
    lags = min(part.samples for part in parts)
    step = -(-lags * (references or parts[0].values.shape[2]) // (_LAGS_OVER_SPAN * _MAX_STATE_ROWS))
    return max(lags // (_LAGS_OVER_SPAN * step), 2) * step - step, step


def _stacked(R: Array, span: int, step: int) -> RealArray:
    """Return X(k) = [R(k); R(k + step); ...; R(k + span)], (lags - span, rows, r)."""
    lags = len(R) - span
    return np.concatenate([R[i : i + lags] for i in range(0, span + 1, step)], axis=1)


def _transfer(R: Array, X: Array) -> RealArray:
    """Return M with R(k) = M X(k) for all k, from the singular values of X above the noise."""
    wide = X.transpose(1, 0, 2).reshape(X.shape[1], -1)
    U, d, V = np.linalg.svd(wide, full_matrices=False)
    kept = d > max(noise_threshold(d, min(wide.shape) / max(wide.shape)), 1e-12 * d[0])
    flat = R.transpose(1, 0, 2).reshape(R.shape[1], -1)
    return np.asarray((flat @ V[kept].T / d[kept]) @ U[:, kept].T)
