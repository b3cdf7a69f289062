"""What polynomials leave of 1 / (x - s) by two sums: the projection of its definition, made with more digits."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.blocks.polynomials import energy, leftover, orthogonal_basis

DEGREE = 9


def projected(x: np.ndarray, w: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """g less p_0 ... p_9 on the lines and their conjugates, (k, 2 F), by the Arnoldi process in extended precision."""
    both = np.concatenate([x, x.conj()]).astype(np.clongdouble)
    weights = np.tile(w, 2).astype(np.longdouble)
    p = [weights.astype(np.clongdouble)]
    for _ in range(DEGREE + 1):
        for _ in range(3):
            for q in p[:-1]:
                p[-1] = p[-1] - q * np.vdot(q, p[-1])
            p[-1] = p[-1] / np.sqrt(np.vdot(p[-1], p[-1]).real)
        p.append(both * p[-1])
    g = weights / (both - poles[:, None])
    for _ in range(3):
        for q in p[: DEGREE + 1]:
            g = g - np.multiply.outer(g @ q.conj(), q)
    return g


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("plane", ["axis", "circle"])
def test_two_sums_give_what_is_left_to_rounding_of_itself(plane: str, weighted: bool) -> None:
    """Near the lines, on the other side of them and so far away that 1e-9 is left: the digits of what is left stay."""
    f = np.linspace(0.2, 0.9, 60)
    x = 1j * f if plane == "axis" else np.exp(2j * f)
    w = np.linspace(0.5, 2, 60) if weighted else np.ones(60)
    poles = np.array([-0.01 + 0.5j, 0.02 + 0.31j, -0.4 + 0.7j, -2.0, 4 - 9j])
    poles = poles if plane == "axis" else np.append(np.exp(2 * poles[:-1]), 9 - 9j)
    left = leftover(x, orthogonal_basis(x, DEGREE, w)[0], w if weighted else None)
    ahead, behind = (w / (line - poles[:, None]) for line in (x, x.conj()))
    sums = left.sums(np.concatenate([ahead + behind, (ahead - behind) / 1j], axis=1).T / 2)
    own, whole = left.of_functions(poles)
    np.testing.assert_allclose(own, sums, rtol=1e-13, atol=1e-14 * np.abs(sums).max())
    np.testing.assert_allclose(whole, np.sum(np.abs(np.concatenate([ahead, behind], axis=1)) ** 2, axis=1))
    found = left.of_poles(poles, sums, slice(None))
    exact = projected(x, w, poles)
    size = np.sqrt(np.sum(np.abs(exact) ** 2, axis=1))
    assert size[-1] < 1e-7 * np.linalg.norm(ahead[-1])
    error = np.abs(np.concatenate([*found], axis=1) - exact).max(axis=1) / size
    rounding = 1e-13 * np.linalg.norm(np.concatenate([ahead, behind], axis=1), axis=1) / size  # of the sums
    assert np.all(error < rounding)
    np.testing.assert_allclose(energy(found) / size**2, 1, atol=float(rounding.max()))
