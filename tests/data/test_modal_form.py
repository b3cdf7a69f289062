"""Modal form (Eqs. 15-16), with repeated and defective poles, and what sensors can tell apart."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
from hypothesis import given, settings

from modalscope import systems
from modalscope.data import StateSpace
from tests.support import EPS, FIVE, random_systems, relative

ROUNDING = 24 * 100 * EPS


def jordan_pair(decay: float, w: float, size: int) -> np.ndarray:
    """Return a real block with one conjugate pair `size` times and a single eigenvector pair."""
    return np.kron(np.eye(size), [[-decay, w], [-w, -decay]]) + np.diag(np.ones(2 * size - 2), 2)


@given(model=random_systems(sampled=False, direct=True))
@settings(max_examples=25, deadline=None)
def test_modal_form_is_the_same_model_in_blocks_of_two(model: StateSpace) -> None:
    form = model.modal_form()
    assert relative(form.T @ form.state_space.A, model.A @ form.T) < ROUNDING
    x = 1j * np.linspace(0.05, 3, 30)
    assert relative(form.state_space.transfer(x), model.transfer(x)) < 1e3 * form.condition * ROUNDING
    assert all(block.separate for block in form.blocks)
    for block in form.blocks:
        inner = form.state_space.A[block.states, block.states]
        s, w = inner[0, 0], inner[0, 1]
        np.testing.assert_array_equal(inner, [[s, w], [-w, s]])
    outside = np.array(form.state_space.A)
    for block in form.blocks:
        outside[block.states, block.states] = 0
    assert not outside.any()
    rising = [abs(block.poles[0]) for block in form.blocks]
    assert rising == sorted(rising)


def test_repeated_poles_with_eigenvectors_of_their_own_are_taken_apart() -> None:
    form = FIVE["ring5"]().state_space().modal_form()
    assert [block.poles.size for block in form.blocks] == [2] * 5
    assert form.condition < 100  # orthogonal shapes: what is left is the units of displacement and velocity


def test_real_poles_stand_alone() -> None:
    form = FIVE["over4"]().state_space().modal_form()
    assert sorted(block.poles.size for block in form.blocks) == [1, 1, 2, 2, 2]


def test_defective_poles_share_a_block_and_the_others_do_not() -> None:
    rng = np.random.default_rng(0)
    J = sla.block_diag(jordan_pair(0.1, 3, 2), jordan_pair(0.2, 5, 1), [[-4.0]])
    R = rng.standard_normal(J.shape)
    model = StateSpace(A=R @ J @ np.linalg.inv(R), B=rng.standard_normal((7, 2)), C=rng.standard_normal((2, 7)))
    form = model.modal_form()
    (cluster,) = (block for block in form.blocks if not block.separate)
    assert sorted(block.poles.size for block in form.blocks) == [1, 2, 4]
    # the cluster's mean keeps all digits where its members lose half of them
    np.testing.assert_allclose(cluster.poles.real, -0.1, atol=1e-5)
    assert abs(cluster.poles.real.mean() + 0.1) < 1e-12
    x = 1j * np.linspace(0.1, 6, 50)
    assert relative(form.state_space.transfer(x), model.transfer(x)) < 1e-10
    assert form.condition < 1e3


def test_nearly_defective_poles_are_a_cluster_until_their_eigenvectors_are_sound() -> None:
    for gap, separate in ((1e-15, False), (1e-2, True)):
        # eigenvectors of [[-1, 1], [0, -1 - gap]] have the condition 2 / gap
        model = StateSpace(A=[[-1, 1], [0, -1 - gap]], B=[[0], [1]], C=[[1, 0]])
        assert all(block.separate for block in model.modal_form().blocks) is separate


def test_stiff_units_cost_the_modal_form_nothing() -> None:
    # slopes, deflections and their rates span nine decades in these units
    form = systems.clamped_beam(8).state_space().modal_form()
    assert form.condition < 1e4
    assert all(block.separate for block in form.blocks)
