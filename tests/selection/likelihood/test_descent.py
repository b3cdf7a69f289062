"""Levenberg and Marquardt's steps: what a linear model promises of them, the damping that follows, poles that leave, and inverses."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import FrequencyResponse
from modalscope.numerics.checks import Array, ComplexArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.descent import Astray, _lessening, _Step, astray, descend
from modalscope.selection.likelihood.information import inverse, residual
from modalscope.selection.likelihood.likelihood import unit_vectors, whitened


@pytest.mark.parametrize("apart", [True, False])
def test_the_fall_of_a_step_is_that_of_the_linear_model(apart: bool) -> None:
    rng = np.random.default_rng(3)
    J, r = rng.standard_normal((40, 6)), rng.standard_normal(40)
    if not apart:
        J[:, 5] = J[:, 4]
    step = _Step(J.T @ J, J.T @ r)
    assert step.apart is apart
    for damping in (1e-6, 1e-2, 1.0):
        moved = step.damped(damping)
        h = np.stack([moved.real, moved.imag], axis=1).reshape(-1)
        assert step.fall(moved) == pytest.approx(r @ r - np.sum((r - J @ h) ** 2), rel=1e-9)
    # the whole of what is promised is had without damping
    assert step.fall(step.damped(1e-13)) == pytest.approx(step.promised, rel=1e-6)


def test_damping_falls_to_a_third_where_the_misfit_falls_as_promised_and_holds_at_half_of_it() -> None:
    assert _lessening(1.0, 1.0) == _lessening(5.0, 1.0) == pytest.approx(1 / 3)
    assert _lessening(0.5, 1.0) == pytest.approx(1)
    assert _lessening(0.0, 1.0) == pytest.approx(2)
    # what a shortened step promises may be nothing: the misfit fell all the same
    assert _lessening(1.0, 0.0) == _lessening(1.0, -1.0) == pytest.approx(1 / 3)


def test_a_pole_that_may_not_stay_leaves_and_the_others_end_where_they_do_without_it() -> None:
    f = np.linspace(5, 25, 300)
    poles = poles_from(np.array([9.0, 12.0, 18.0]), np.array([0.01, 0.02, 0.012]))
    x, rng = 2j * np.pi * f[:, None, None], np.random.default_rng(2)
    H = sum(1 / (x - s) + 1 / (x - np.conj(s)) for s in poles) + 0.01 * rng.standard_normal((f.size, 1, 1))
    problem = whitened(
        FrequencyResponse(values=H, frequencies=f), np.zeros(0), (0,), np.ones(2 * f.size), np.ones(1), np.ones(1)
    )
    start, sides = poles * np.exp(0.003j), np.ones((4, 1), complex)
    asked: list[ComplexArray] = []

    def stays(at: ComplexArray) -> Array:
        asked.append(at)
        return np.asarray(np.abs(at.imag - 2 * np.pi * 15) > 10)

    found = descend(problem, np.insert(start, 1, poles_from(15.0, 0.1)), sides, stays=stays)
    alone = descend(problem, start, sides[:3])
    assert found.kept.tolist() == [0, 2, 3]
    assert len(asked[0]) == 4  # asked after a step, when there is somewhere that it walked
    assert len(asked[1]) == 3
    assert found.converged
    assert found.cost == pytest.approx(alone.cost, rel=1e-9)
    assert np.allclose(found.point.poles, alone.point.poles, rtol=1e-7)
    assert descend(problem, start, sides[:3], stays=stays).kept.tolist() == [0, 1, 2]


def test_a_direction_without_information_leaves_only_its_own_unknowns_undetermined() -> None:
    J = np.random.default_rng(5).standard_normal((30, 5))
    J[:, 4] = J[:, 3]  # only the sum of both is known
    found, three = inverse(J.T @ J), np.linalg.inv(J[:, :4].T @ J[:, :4])
    assert np.allclose(found[:3, :3], three[:3, :3], rtol=1e-9)
    assert np.all(np.sqrt(np.diag(found)[3:]) > 1e10)
    assert np.all(np.isfinite(found @ J.T @ J @ found))


def test_what_is_known_of_columns_that_depend_on_each_other_projects_on_their_span() -> None:
    J = np.random.default_rng(6).standard_normal((30, 4))
    J = np.column_stack([J, J[:, 1] + J[:, 2], J[:, 0] - 2 * J[:, 3]])
    projection = J @ inverse(J.T @ J, 0.0) @ J.T
    assert np.allclose(projection @ J, J)
    assert np.trace(projection) == pytest.approx(4)


@pytest.mark.parametrize(("part", "lost"), [(0.99, True), (1.01, False)])
def test_directions_below_the_rounding_of_products_are_undetermined(part: float, lost: bool) -> None:
    # eigenvalues 2 - e and e, and the limit is 1e-12 of the largest; the last unknown stands by itself
    e = part * 2e-12
    information = np.array([[1, 1 - e, 0], [1 - e, 1, 0], [0, 0, 4]])
    found = np.sqrt(np.diag(inverse(information)))
    assert found[2] == pytest.approx(0.5)
    assert bool(np.all(found[:2] > 1e10)) is lost
    # not determined is not zero either where the data say nothing at all
    assert inverse(np.diag([1.0, 0.0]))[1, 1] > 1e20


@pytest.mark.parametrize(("part", "burdened"), [(0.99, False), (1.01, True)])
def test_a_direction_belongs_to_the_unknowns_that_have_a_hundredth_of_it(part: float, burdened: bool) -> None:
    # the null direction of I - v v', of length one, is sqrt(1 - v^2) v once its columns have length one
    first = np.linspace(0.05, 0.2, 1000)
    rest = np.sqrt((1 - first**2) / 2)
    shares = (1 - first**2) * first**2
    shares /= shares + 2 * (1 - rest**2) * rest**2
    v = np.interp(0.01 * part, shares, first) * np.array([1.0, 0.0, 0.0])
    v[1:] = np.sqrt((1 - v[0] ** 2) / 2)
    assert bool(inverse(np.eye(3) - np.outer(v, v))[0, 0] > 1e20) is burdened


@pytest.mark.parametrize(("off", "leaves"), [(0.8, False), (1.25, True)])
def test_a_descent_ends_as_soon_as_a_pole_is_further_from_its_home_than_its_decay_rate(
    off: float, leaves: bool
) -> None:
    f, homes = np.linspace(5, 25, 300), poles_from(np.array([9.0, 18.0]), np.array([0.01, 0.02]))
    x, poles = 2j * np.pi * f[:, None, None], homes - np.array([0, off * homes[1].real]) * 1j
    H = sum(1 / (x - s) + 1 / (x - np.conj(s)) for s in poles)
    problem = whitened(
        FrequencyResponse(values=H, frequencies=f), np.zeros(0), (0,), np.ones(2 * f.size), np.ones(1), np.ones(1)
    )
    assert astray(homes, poles).tolist() == [False, leaves]
    sides = np.ones((2, 1), complex)
    if leaves:
        with pytest.raises(Astray) as away:
            descend(problem, homes, sides, home=homes)
        assert away.value.homes.tolist() == [homes[1]]
    else:
        assert np.allclose(descend(problem, homes, sides, home=homes).point.poles, poles)


def test_a_joint_fit_leaves_the_part_of_white_noise_that_it_says_on_every_row() -> None:
    """Squares of the residual, over 12 draws of 240 channels, which know each row's to 2.6 %."""
    f, left, (q, p) = np.linspace(1, 4, 60), 0.0, (120, 2)
    rng = np.random.default_rng(2)
    s = 2 * np.pi * np.array([2.0, 2.9]) * (-0.01 + 1j)
    functions = 1 / (2j * np.pi * f[:, None] - s) + 1 / (2j * np.pi * f[:, None] - s.conj())
    sides = rng.standard_normal((2, p)) + 0j
    clean = np.einsum("fj,qj,jp->fqp", functions, rng.standard_normal((q, 2)), sides)
    for _ in range(12):
        noise = 0.02 * (rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape))
        response = FrequencyResponse(values=clean + noise, frequencies=f)
        problem = whitened(response, np.zeros(0, complex), (0,), np.full(120, 0.02), np.ones(q), np.ones(p))
        descent = descend(problem, s, unit_vectors(sides), tolerance=1e-9, most=60)
        left = left + np.mean(residual(descent.point, descent.fitted) ** 2, axis=(1, 2)) / 12
    kept = descent.point.kept()
    assert kept.min() < 0.75
    assert np.std(left / kept - 1) < 0.035
    assert np.mean(left / kept) == pytest.approx(1, abs=0.01)


def test_without_modes_the_terms_alone_take_up_noise() -> None:
    values = np.random.default_rng(0).standard_normal((20, 2, 1)) + 0j
    response = FrequencyResponse(values=values, frequencies=np.linspace(1, 2, 20))
    problem = whitened(response, np.zeros(0, complex), (0,), np.ones(40), np.ones(2), np.ones(1))
    point = problem.at(np.zeros(0, complex), np.zeros((0, 1), complex))
    assert point.kept() == pytest.approx(1 - np.sum(problem.terms**2, axis=1))
    assert point.kept().sum() == pytest.approx(40 - problem.terms.shape[1])
