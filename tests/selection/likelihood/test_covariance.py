"""Covariances carried on: against differences, and against samples drawn from them."""

from __future__ import annotations

import numpy as np

from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.selection.likelihood.covariance import deviations_of_poles, pole_blocks, sandwich, shape_deviations

RNG = np.random.default_rng(0)


def test_frequencies_and_damping_ratios_vary_as_their_poles_do():
    poles = np.array([-1 + 100j, -30 + 40j, -0.1 + 5j])
    root = 1e-4 * RNG.standard_normal((3, 2, 2))
    blocks = root @ root.transpose(0, 2, 1)
    draws = np.einsum("nab,kbn->kan", root, RNG.standard_normal((40000, 2, 3)))
    f, zeta = frequencies_and_damping(poles + draws[:, 0] + 1j * draws[:, 1])
    # 40000 draws tell a deviation to .35 %
    for told, seen in zip(deviations_of_poles(poles, blocks), (f.std(axis=0), zeta.std(axis=0)), strict=True):
        assert np.allclose(told, seen, rtol=0.02)


def test_blocks_stand_where_they_are_asked_for():
    covariance = np.arange(36.0).reshape(6, 6)
    assert np.array_equal(pole_blocks(covariance, [0, 4]), [covariance[:2, :2], covariance[4:, 4:]])


def test_the_sandwich_of_a_mean_is_the_variance_of_the_mean():
    """One unknown, G numbers: J'J = G, the scores are their distances from the mean, and the sandwich is s^2 / G."""
    y = RNG.standard_normal(7)
    found = sandwich(np.array([[1 / 7]]), (y - y.mean())[:, None])
    assert np.isclose(found[0, 0], y.var(ddof=1) / 7)


def test_a_pull_that_all_parts_share_is_no_disagreement():
    scores = np.random.default_rng(3).standard_normal((6, 2))
    C = np.diag([2.0, 3.0])
    assert np.allclose(sandwich(C, scores + np.array([5.0, -7.0])), sandwich(C, scores), rtol=1e-12)


def test_with_informations_it_is_the_jackknife_over_parts():
    """Least squares without one part after the other: (G - 1) / G times the squares of their distances from their mean."""
    rng = np.random.default_rng(5)
    J = rng.standard_normal((5, 8, 3)) * rng.lognormal(0, 1, (5, 1, 1)) * [1.0, 1e4, 1e-3]
    y = rng.standard_normal((5, 8))
    fit = np.linalg.lstsq(J.reshape(-1, 3), y.ravel(), rcond=None)[0]
    each = [
        np.linalg.lstsq(np.delete(J, g, 0).reshape(-1, 3), np.delete(y, g, 0).ravel(), rcond=None)[0] for g in range(5)
    ]
    away = np.array(each) - np.mean(each, axis=0)
    H = np.einsum("gka,gkb->gab", J, J)
    scores = np.einsum("gka,gk->ga", J, y - J @ fit)
    assert np.allclose(sandwich(np.linalg.inv(H.sum(axis=0)), scores, H), away.T @ away * 4 / 5, rtol=1e-8)


def test_students_interval_holds_the_truth_though_parts_tell_unlike_much():
    rng, held, plain = np.random.default_rng(6), [], []
    for _ in range(300):
        H = rng.lognormal(0, 2, (6, 1, 1))
        error = np.sqrt(H[:, 0]) * rng.standard_normal((6, 1))
        C = 1 / H.sum(axis=0)
        off = C @ error.sum(axis=0)
        scores = error - H[:, 0] * off
        t = 2.571  # of five degrees of freedom, 95 %
        held.append(abs(off[0]) < t * np.sqrt(sandwich(C, scores, H)[0, 0]))
        plain.append(abs(off[0]) < t * np.sqrt(sandwich(C, scores)[0, 0]))
    assert np.mean(held) > 0.88  # 300 cases leave 1.5 %
    assert np.mean(plain) < np.mean(held) - 0.05


def test_shapes_scatter_as_their_parts_do_with_the_scale_taken_out():
    shape = np.array([1, -2 + 1j, 0.5j])
    alone, A = np.array([0.3, 0.1, 0.2]) * 1e-6, 1e-3 * (RNG.standard_normal((3, 2)) + 1j * RNG.standard_normal((3, 2)))
    root = RNG.standard_normal((2, 2))
    noise = np.sqrt(alone / 2) * (RNG.standard_normal((40000, 3)) + 1j * RNG.standard_normal((40000, 3)))
    moved = noise + RNG.standard_normal((40000, 2)) @ root.T @ A.T
    across = moved - np.outer(moved @ shape.conj(), shape) / np.vdot(shape, shape)
    told = shape_deviations(shape, alone, A, root @ root.T)
    assert np.allclose(told, np.sqrt(np.mean(np.abs(across) ** 2, axis=0)), rtol=0.02)
