"""Compute standard deviations of refined modes: from lines one by one, from parts in time, and from the scatter between groups."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modalscope.data.channels import Groups
from modalscope.data.response import Response
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.numerics.statistics import with_scatter
from modalscope.selection.likelihood.covariance import (
    LEAST_GROUPS,
    degrees_of_wider,
    deviations_of_poles,
    gradients_of_poles,
    joined,
    lower_damping,
    lower_damping_of_channels,
    parts_of,
    pole_blocks,
    sandwich,
    shape_deviations,
    steps_of_poles,
    wandering,
)
from modalscope.selection.likelihood.information import (
    by_channel,
    information_of_channels,
    inverse,
    normal,
    scores,
    window_noise,
)
from modalscope.selection.likelihood.likelihood import Fitted, Point, across
from modalscope.selection.likelihood.lines_told import ToldByLines, told_by_lines
from modalscope.selection.likelihood.settling import Settled

#: Standard deviation of a frequency in half bandwidths above which the data leave a mode open.
_MAX_OPEN = 0.3


@dataclass(frozen=True, eq=False, slots=True)
class Spread:
    """Standard deviations of refined modes.

    `frequency`, `damping` (n,): from the noise: Hz, ratio. `degrees` (n, 2): of freedom of the wider of these and those between groups;
    0 where the data leave a mode open.
    `lower` (n,): see `ModalModel.damping_ratios_lower`. `shapes` (l, n): of the shapes as they were fitted. `frequency_between`,
    `damping_between` (n,): between groups.
    """

    frequency: RealArray
    damping: RealArray
    degrees: RealArray
    lower: RealArray
    shapes: RealArray
    frequency_between: RealArray | None
    damping_between: RealArray | None


def spread_of(settled: Settled, poles: ComplexArray, response: Response, groups: Groups) -> Spread:
    """Return the deviations at an optimum.

    Errors of records are independent from line to line, whatever their spectrum and their coherence: lines left out one at a time tell
    the covariance. White noise of responses has one variance a channel; where their residual is coloured, the wider of this and of lines
    counts, and what outputs, inputs and channels differ by comes to it. Where lines have levels of their own, these are no channel's alone,
    and lines are asked, too. Parts in time show what correlates lines.

    `poles` (n,): rad/s, as the modes are to have them. `response`: that was refined. `groups`: one label per input, or a run.
    """
    point, fitted, variance, seen = settled.descent.point, settled.descent.fitted, settled.variance, settled.colour
    information = normal(point, fitted)[0]
    C = inverse(information, 0.0)
    lost = inverse(information) - C  # variance of what the data do not determine
    asked = point.problem.records or seen.coloured or settled.levelled
    rows = told_by_lines(point, fitted, C, response) if asked else None
    between = _between(point, fitted, C, groups, rows)
    own = variance * fitted.alone
    candidates: list[_Candidate] = []
    if not point.problem.records:
        noise = window_noise(point, fitted, response)
        meat = information_of_channels(point, fitted, variance, alike=response.variance is not None)
        found = C @ meat @ C if noise is None else variance * noise.covariance
        candidates.append(_Candidate(found, np.full((2, len(poles)), float(point.problem.freedom)), own))
    if rows is not None:
        free, parts = rows.told(gradients_of_poles(poles), C)
        candidates.append(_Candidate(rows.covariance(C), free, rows.own))
    variances = np.array([_of_poles(poles, each.covariance + lost, point) ** 2 for each in candidates])
    widest = np.argmax(variances, axis=0)[None]
    degrees = np.take_along_axis(np.array([each.degrees for each in candidates]), widest, axis=0)[0]
    variances = np.take_along_axis(variances, widest, axis=0)[0]
    opened = np.sqrt(variances[0]) > _MAX_OPEN * np.abs(poles.real) / (2 * np.pi)
    lower = np.full(len(poles), np.nan)
    if rows is not None:
        lower = lower_damping(poles, wandering(variances[0], degrees[0], parts[0]))
        both = [joined(*each) for each in zip(variances, degrees, parts, strict=True)]
        variances, degrees = (np.array(each) for each in zip(*both, strict=True))
    shapes = np.max([_of_shapes(point, fitted, each.covariance, each.own, lost) for each in candidates], axis=0)
    if seen.coloured and not point.problem.records:
        white = _of_poles(poles, candidates[0].covariance, point) ** 2, candidates[0].degrees
        seen_by = _by_channel(point, fitted, C, poles)
        by_output = [wandering(v, k, parts_of(*(x.sum(2) for x in s))) for v, k, s in zip(*white, seen_by, strict=True)]
        by_input = wandering(white[0][0], white[1][0], parts_of(*(x.sum(1) for x in seen_by[0])))
        lower = np.fmin(lower, lower_damping_of_channels(poles, by_output[0] + by_input))
        shapes = np.hypot(shapes, _of_shifts(point, fitted, poles, *by_output))
        variances, degrees = _with_scatter(poles, variances, degrees, seen_by)
    apart = (None, None) if between is None else tuple(_of_poles(poles, between, point))
    if between is not None and groups is not None:
        degrees = degrees_of_wider(np.sqrt(variances), degrees, np.array(apart), len(set(groups)))
    return Spread(variances[0] ** 0.5, variances[1] ** 0.5, np.where(opened, 0, degrees).T, lower, shapes, *apart)


def _by_channel(point: Point, fitted: Fitted, C: RealArray, poles: ComplexArray) -> list[tuple[RealArray, RealArray]]:
    """Return shares of channels in the information on frequencies, then on damping ratios, and what they add to their errors, (n, l, m)."""
    power, pull = by_channel(point, fitted, np.concatenate([steps_of_poles(g, C) for g in gradients_of_poles(poles)]))
    share = power / np.maximum(power.sum(axis=(1, 2), keepdims=True), 1e-300)
    return list(zip(np.split(share, 2), np.split(pull, 2), strict=True))


def _with_scatter(
    poles: ComplexArray, variances: RealArray, degrees: RealArray, seen: list[tuple[RealArray, RealArray]]
) -> tuple[RealArray, RealArray]:
    """Return variances and degrees of freedom of frequencies and damping ratios, (2, n) each, with what channels differ by."""
    scales = frequencies_and_damping(poles)
    both = [
        with_scatter(v, nu, scale, *own) for v, nu, scale, own in zip(variances, degrees, scales, seen, strict=True)
    ]
    return np.array([each[0] for each in both]), np.array([each[1] for each in both])


def _of_shifts(point: Point, fitted: Fitted, poles: ComplexArray, f: RealArray, zeta: RealArray) -> RealArray:
    """Return the deviations of shapes, (l, n), by poles that differ from output to output.

    A line at s fitted to one at s + d has a residue that is off by d <g', g> / <g, g> = d / (2 |Re s|) of itself, all lines counted.

    `f`, `zeta` (n,): variances of frequencies (Hz^2) and damping ratios from output to output.
    """
    shapes, _ = point.problem.scaled_back(point, fitted)
    apart = np.sqrt((2 * np.pi) ** 2 * f + np.abs(poles) ** 2 * zeta)
    return np.asarray(np.abs(shapes) * apart / (2 * np.abs(poles.real)))


class _Candidate(NamedTuple):
    """A covariance of the unknowns, its degrees of freedom (2, n), and the variance of the side that follows, all else held."""

    covariance: RealArray
    degrees: RealArray
    own: RealArray


def _of_poles(poles: ComplexArray, covariance: RealArray, point: Point) -> RealArray:
    """Return the deviations of frequencies and of damping ratios, (2, n)."""
    n, p = point.sides.shape
    return np.array(deviations_of_poles(poles, pole_blocks(covariance, 2 * p * np.arange(n))))


def _between(
    point: Point, fitted: Fitted, information: RealArray, groups: Groups, rows: ToldByLines | None
) -> RealArray | None:
    """Sandwich over the groups of inputs, or of runs by their lines; None without at least four."""
    labels = np.unique(groups) if groups is not None else np.zeros(0)
    if labels.size < LEAST_GROUPS:
        return None
    member = np.asarray(groups)[None, :] == labels[:, None]
    if rows is None or point.problem.parts is None:
        return sandwich(information, member.astype(float) @ scores(point, fitted).sum(axis=0))
    return sandwich(information, member.astype(float) @ rows.by_run)


# -------------------------------------------------------------------------------------------------------------- shapes


def _of_shapes(point: Point, fitted: Fitted, covariance: RealArray, own: RealArray, lost: RealArray) -> RealArray:
    """Return the deviations of all shapes, (l, n), their size taken off in levels of the channels, which no unit changes.

    `own` (n,) or (q, n): variance of the side that follows, all else held. `lost`: that of what is not determined. Sides of which nothing
    is known, as of inputs that never move, leave shapes that follow by least squares as they are.
    """
    shapes, _ = point.problem.scaled_back(point, fitted)
    turned = point.problem.turned
    scale = point.problem.varying if turned else point.problem.linear
    alone = np.zeros(shapes.shape) if turned else np.broadcast_to(own, shapes.shape)
    covariance = covariance + turned * lost
    moved = _among_unknowns(point) if turned else _by_substitution(point, fitted)
    each = [scale * shape_deviations(shapes[:, j] / scale, alone[:, j], A, covariance) for j, A in enumerate(moved)]
    return np.stack(each, axis=1)


def _among_unknowns(point: Point) -> Iterator[ComplexArray]:
    """Yield db / d theta of every mode, (p, 2 n p): the shapes themselves are the unknown unit vectors."""
    n, p = point.sides.shape
    bases = across(point.sides)
    for j in range(n):
        A = np.zeros((p, n, p, 2), dtype=complex)
        A[:, j, 1:, 0], A[:, j, 1:, 1] = bases[j], 1j * bases[j]
        yield A.reshape(p, -1)


def _by_substitution(point: Point, fitted: Fitted) -> Iterator[ComplexArray]:
    """Yield dc / d theta of every mode, (q, 2 n p), with c the least-squares solution (but for the sign)."""
    c = np.repeat(fitted.linear, point.sides.shape[1], axis=1)
    directions, X = point.directions(), np.empty((2 * len(point.poles), *c.shape), dtype=complex)
    for side in fitted.sides:
        X[:, side.channels] = (side.back @ (side.kept.T @ side.weighted(directions)))[:, None]
    for j in range(len(point.poles)):
        by_real, by_imag = (c * X[2 * j + k] for k in (0, 1))
        A = np.stack([by_real.real + 1j * by_imag.real, -by_real.imag - 1j * by_imag.imag], axis=-1)
        yield A.reshape(len(c), -1)
