"""Compute standard deviations of refined modes: from white or coloured noise, and from the scatter between groups."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modalscope.data.channels import Groups
from modalscope.data.response import Response
from modalscope.likelihood.covariance import deviations_of_poles, pole_blocks, sandwich, shape_deviations
from modalscope.likelihood.descent import inverse, normal, scores, scores_of_rows, window_noise
from modalscope.likelihood.likelihood import Fitted, Point, across
from modalscope.likelihood.whitening import Colour, blocks_of
from modalscope.numerics.checks import ComplexArray, RealArray

#: Fewer groups say too little about how far they disagree.
LEAST_GROUPS = 4


@dataclass(frozen=True, eq=False, slots=True)
class Spread:
    """Standard deviations of refined modes.

    `frequency`, `damping` (n,): from the noise: Hz, ratio. `shapes` (l, n): of the shapes as they were fitted. `frequency_between`,
    `damping_between` (n,): between groups.
    """

    frequency: RealArray
    damping: RealArray
    shapes: RealArray
    frequency_between: RealArray | None
    damping_between: RealArray | None


def spread_of(
    point: Point, fitted: Fitted, poles: ComplexArray, variance: float, response: Response, groups: Groups, seen: Colour
) -> Spread:
    """Return the deviations at an optimum.

    `poles` (n,): rad/s, as the modes are to have them. `variance`: of a row of the whitened noise. `response`: that was refined.
    `groups`: one label an input, or a run. `seen`: of the residual.
    """
    information = inverse(normal(point, fitted)[0])
    between = _between(point, fitted, information, groups)
    noise = window_noise(point, fitted, response)
    candidates = [(variance * (information if noise is None else noise.covariance), 1.0)]
    if seen.coloured:
        longer = (1 + max(seen.correlation, 0)) / max(1 - max(seen.correlation, 0), 0.01)
        parts = [scores_of_rows(point, fitted, blocks_of(len(point.problem.rows), response.count, seen.correlation))]
        parts += [] if between is not None else _by_channels(point, fitted)
        candidates += [(sandwich(information, part), longer) for part in parts if len(part) >= LEAST_GROUPS]
    found = [_of_poles(poles, covariance, point) for covariance, _ in candidates]
    shapes = [_of_shapes(point, fitted, covariance, variance * longer) for covariance, longer in candidates]
    apart = (None, None) if between is None else _of_poles(poles, between, point)
    return Spread(
        np.max([f for f, _ in found], axis=0),
        np.max([zeta for _, zeta in found], axis=0),
        np.max(shapes, axis=0),
        *apart,
    )


def _of_poles(poles: ComplexArray, covariance: RealArray, point: Point) -> tuple[RealArray, RealArray]:
    n, p = point.sides.shape
    return deviations_of_poles(poles, pole_blocks(covariance, 2 * p * np.arange(n)))


def _by_channels(point: Point, fitted: Fitted) -> list[RealArray]:
    """Return the scores of outputs, of inputs and of channels: where no groups are known, model error may lie in any of them."""
    each = scores(point, fitted)
    return [each.sum(axis=1), each.sum(axis=0), each.reshape(-1, each.shape[2])]


def _between(point: Point, fitted: Fitted, information: RealArray, groups: Groups) -> RealArray | None:
    """Sandwich over the groups of inputs, or of runs; None without at least four."""
    labels = np.unique(groups) if groups is not None else np.zeros(0)
    if labels.size < LEAST_GROUPS:
        return None
    member = np.asarray(groups)[None, :] == labels[:, None]
    runs = point.problem.parts
    each = scores(point, fitted).sum(axis=0) if runs is None else scores_of_rows(point, fitted, runs)
    return sandwich(information, member.astype(float) @ each)


def _of_shapes(point: Point, fitted: Fitted, covariance: RealArray, variance: float) -> RealArray:
    """Return the deviations of all shapes, (l, n)."""
    shapes, _ = point.problem.scaled_back(point, fitted)
    turned = point.problem.turned
    scale = point.problem.varying if turned else point.problem.linear
    own = np.zeros(len(point.poles)) if turned else np.diag(fitted.spread).reshape(-1, 2).sum(axis=1)
    moved = _among_unknowns(point) if turned else _by_substitution(point, fitted)
    each = [
        shape_deviations(shapes[:, j], variance * own[j] * scale**2, scale[:, None] * A, covariance)
        for j, A in enumerate(moved)
    ]
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
    X = fitted.back @ (fitted.kept.T @ point.directions())  # (2 n, n p)
    c = np.repeat(fitted.linear, point.sides.shape[1], axis=1)
    for j in range(len(point.poles)):
        by_real, by_imag = (c * (X[2 * j + k]) for k in (0, 1))
        A = np.stack([by_real.real + 1j * by_imag.real, -by_real.imag - 1j * by_imag.imag], axis=-1)
        yield A.reshape(len(c), -1)
