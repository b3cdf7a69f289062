"""Pieces of shapes put together by the outputs that they share: the shape, its deviations, and what they rest on."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.towers import tower
from modalscope.analysis.workflow.setups import glued
from modalscope.numerics.checks import Array
from modalscope.selection.judging import evidence
from modalscope.selection.likelihood.line_shapes import LineShapes

#: Two outputs stay, two rove.
PLACES = [[0, 1, 2 + 2 * j, 3 + 2 * j] for j in range(6)]
OUTPUTS = 14


def case(seed: int) -> tuple[Array, Array, list[Array]]:
    """Return a shape, the sizes of its pieces, and the deviations of their outputs."""
    rng = np.random.default_rng(seed)
    shape = rng.normal(size=OUTPUTS)
    shape[:2] += np.sign(shape[:2])
    sizes = rng.uniform(0.3, 3, len(PLACES)) * np.exp(2j * np.pi * rng.uniform(size=len(PLACES)))
    return shape, sizes, [rng.uniform(0.005, 0.02, 4) * abs(size) for size in sizes]


def test_pieces_without_errors_give_the_shape() -> None:
    shape, sizes, deviations = case(1)
    found, _ = glued([b * shape[p] for b, p in zip(sizes, PLACES, strict=True)], deviations, PLACES, OUTPUTS)
    assert found / found[0] == pytest.approx(shape / shape[0], abs=1e-9)


def test_deviations_are_those_of_many_draws() -> None:
    shape, sizes, deviations = case(2)
    rng = np.random.default_rng(3)
    squares, stated = np.zeros((2, OUTPUTS))
    for _ in range(400):
        noise = [s * rng.standard_normal(4) for s in deviations]
        pieces = [b * shape[p] + e * b / abs(b) for b, p, e in zip(sizes, PLACES, noise, strict=True)]
        found, std = glued(pieces, deviations, PLACES, OUTPUTS)
        across = found - shape * (shape @ found) / (shape @ shape)
        squares += np.abs(across / sizes[0]) ** 2 / 400
        stated += np.abs(std / sizes[0]) ** 2 / 400
    assert np.sqrt(squares) == pytest.approx(
        0.9 * np.sqrt(stated), rel=0.1
    )  # twelve per cent for misfits above one by chance


def test_pieces_that_disagree_by_more_than_stated_widen_all() -> None:
    shape, sizes, deviations = case(4)
    rng = np.random.default_rng(5)
    pieces = [b * shape[p] + 5 * s * rng.standard_normal(4) for b, p, s in zip(sizes, PLACES, deviations, strict=True)]
    own, wide = (glued(pieces, [k * s for s in deviations], PLACES, OUTPUTS)[1] for k in (1, 5))
    assert own == pytest.approx(wide, rel=0.5)
    assert np.all(
        own > 2 * glued([b * shape[p] for b, p in zip(sizes, PLACES, strict=True)], deviations, PLACES, OUTPUTS)[1]
    )


def test_the_size_that_was_taken_off_is_given_back() -> None:
    """Errors of one size across a shape of length one have sqrt(1 - u^2) of it each; an output that is nearly alone has some."""
    shape = np.array([[0.6], [0.8], [0.0]])
    found = LineShapes(shape.astype(complex), 0.1 * np.sqrt(1 - shape**2), np.ones(len(shape)))
    assert found.with_size == pytest.approx(0.1)
    alone = LineShapes(np.array([[1.0 + 0j], [1e-3]]), np.array([[1e-4], [0.1]]), np.ones(2))
    assert alone.with_size[0, 0] == pytest.approx(1e-4 / np.sqrt(0.05))


@pytest.mark.slow
def test_setups_that_agree_list_a_mode_of_few_signs_and_know_its_shape() -> None:
    """Without what the setups say of each other, the weaker of two neighbours is left out, and nothing is refined."""
    built = tower(93001, setups=5)
    setups = ms.Setups(parts=tuple(built.setups))
    with patch.object(evidence, "deviations_between", lambda *_: None):
        before = ms.analyze(setups).modes
    found = ms.analyze(setups).modes
    assert len(before) < len(found) == len(built.modes)
    true = built.modes.select(outputs=list(found.output_dofs))
    errors = 1 - np.diag(ms.mac(found.shapes, true.shapes))
    assert found.shapes_std is not None
    stated = np.sum(found.shapes_std**2, axis=0) / np.sum(np.abs(found.shapes) ** 2, axis=0)
    assert 0.4 < np.median(errors / stated) < 2.5
