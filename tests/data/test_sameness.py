"""Whether two modes are the same one: by closed forms, and by drawing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.sameness import log_ratios, same_modes
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import poles_from

F, ZETA = 10.0, 0.01


def made(f, zeta=ZETA, shape=(1.0, 1.0, 1.0, 1.0), std=None, **more):
    """Return a model of one mode; `std`: relative deviation of frequency and damping ratio."""
    values = np.atleast_1d(np.asarray(shape, dtype=complex))
    known = (
        {} if std is None else {"frequencies_std": np.array([std * f]), "damping_ratios_std": np.array([std * zeta])}
    )
    return ms.ModalModel(poles=poles_from([f], [zeta]), shapes=values[:, None], **known, **more)


def test_the_distance_is_in_deviations_of_the_difference():
    a, b = made(F, std=1e-3), made(F * np.exp(3e-3), std=1e-3)
    assert ms.same_mode(a, b).distance == pytest.approx(3 / np.sqrt(2), rel=1e-6)
    damped = made(F, zeta=ZETA * np.exp(4e-3), std=1e-3)
    assert ms.same_mode(a, damped).distance == pytest.approx(4 / np.sqrt(2), rel=1e-6)
    wide = replace(b, frequencies_repeatability=np.array([0.05]))
    assert ms.same_mode(a, wide).distance == pytest.approx(3e-3 / np.hypot(1e-3, 0.05 / b.frequencies[0]), rel=1e-6)


def test_one_number_without_a_shape_is_bayes_rule_with_decades():
    """Single outputs have no shapes to compare: p / (1 - p) is the product of two ratios of densities."""
    s, apart = 1e-3 * np.sqrt(2), 2e-3
    found = ms.same_mode(made(F, shape=1.0, std=1e-3), made(F * np.exp(apart), shape=1.0, std=1e-3))

    def ratio(x, decades):
        normal = [np.exp(-((x / d) ** 2) / 2) / d / np.sqrt(2 * np.pi) for d in (s, 10 * s)]
        return (0.95 * normal[0] + 0.05 * normal[1]) * decades * np.log(10)

    odds = ratio(apart, 1) * ratio(0.0, 2)
    assert found.probability == pytest.approx(odds / (1 + odds), rel=1e-9)
    assert np.isnan(found.mac)


def test_without_deviations_half_a_half_bandwidth_is_one():
    assert ms.same_mode(made(F), made(F * np.exp(ZETA / np.sqrt(2)))).distance == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(("shape", "same"), [((1.0, 1.0, 1.0, 1.0), True), ((1.0, -1.0, 1.0, -1.0), False)])
def test_of_two_at_one_frequency_the_shape_decides(shape, same):
    found = ms.same_mode(made(F), made(F, shape=shape))
    assert bool(found) is same
    assert (found.probability > 0.99) is same
    assert ("MAC 1.00" if same else "MAC 0.00") in str(found)


def test_of_modes_drawn_at_random_few_pass_for_the_same_and_few_of_the_same_do_not():
    rng = np.random.default_rng(0)
    wrong = missed = 0
    for _ in range(400):
        f, zeta = 10 ** rng.uniform(0, 1), 10 ** rng.uniform(-3, -1)
        u, v = rng.standard_normal((2, 5))
        first = made(f, zeta, u, std=0.01)
        again = [value * np.exp(0.01 * rng.standard_normal()) for value in (f, zeta)]
        missed += not ms.same_mode(first, made(*again, u + 0.02 * rng.standard_normal(5), std=0.01))
        wrong += bool(ms.same_mode(first, made(10 ** rng.uniform(0, 1), 10 ** rng.uniform(-3, -1), v, std=0.01)))
    assert wrong <= 4
    assert missed <= 4


def test_shapes_are_compared_on_the_labels_of_both():
    a = made(F, shape=(1.0, 2.0, 3.0), output_dofs=("1", "2", "3"))
    b = made(F, shape=(3.0, 2.0), output_dofs=("3", "2"))
    assert ms.same_mode(a, b).mac == pytest.approx(1.0)
    assert np.isnan(ms.same_mode(a, made(F, shape=(1.0, 2.0), output_dofs=("8", "9"))).mac)


def test_a_model_without_damping_tells_nothing_of_it():
    undamped = ms.ModalModel(poles=[2j * np.pi * F], shapes=np.ones((4, 1)))
    assert ms.same_mode(undamped, made(F, zeta=0.05))
    assert ms.same_mode(undamped, made(F * 1.001, zeta=0.05)).distance < 0.1


def list_of(f, shapes=None):
    n = len(f)
    return ms.ModalModel(poles=poles_from(f, np.full(n, ZETA)), shapes=np.ones((3, n)) if shapes is None else shapes)


def test_each_mode_has_one_partner_and_none_that_is_another_rather():
    # 10.05 is nearer to 10.02, which 10 would then lack
    first, second = same_modes(list_of([10.0, 10.05, 30.0]), list_of([10.02, 10.08, 50.0]))
    assert (first.tolist(), second.tolist()) == ([0, 1], [0, 1])
    assert [each.size for each in same_modes(list_of([10.0]), list_of([]))] == [0, 0]


def test_lists_are_compared_as_single_modes_are():
    rng = np.random.default_rng(4)
    a, b = (list_of(10 ** rng.uniform(0, 0.1, 4), rng.standard_normal((3, 4))) for _ in range(2))
    ratios = log_ratios(a, b)
    one_by_one = [[ms.same_mode(x, y).probability for y in b] for x in a]
    assert np.allclose(1 / (1 + np.exp(-ratios)), one_by_one)
    # a change that is expected makes what is apart less unlikely, and what is equal less likely
    wider = log_ratios(a, b, 0.1)
    far = np.abs(np.log(a.frequencies[:, None] / b.frequencies)) > 0.05
    assert np.all(wider[far] > ratios[far])
    assert log_ratios(a, a, 0.1)[0, 0] < log_ratios(a, a)[0, 0]


def test_modes_of_a_result_are_taken_one_by_one_and_a_model_of_several_is_refused():
    modes = ms.systems.chain5().modes()
    assert ms.same_mode(modes[1], modes.take([1]))
    with pytest.raises(DataError, match="a needs a single mode"):
        ms.same_mode(modes, modes[0])


def test_a_mode_has_its_grade_and_a_list_its_significance():
    modes = ms.analyze(ms.systems.chain5().impulse_response(300, noise=0.01, seed=0)).modes
    assert {mode.grade for mode in modes} == {"good"}
    assert modes[0].grade_reason.startswith("damping known within")
    assert np.array_equal(modes.significance, modes.gain)
