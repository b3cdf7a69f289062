"""M^-1 K and M^-1 D from responses (Eq. 107), the first-order form (Eqs. 108-109), and their conditions on the sensors."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import DataError, StateSpace, identify
from modalscope.data.sensors import equations_of_motion, first_order_form
from modalscope.identification.modal.state_space import from_modes
from modalscope.systems import chain
from tests.support import FIVE, match_poles, relative

LINES = np.linspace(0.3, 8, 200)


@pytest.mark.parametrize("method", ["era", "polyreference", "alternate", "least_squares"])
@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_stiffness_and_damping_over_mass_from_every_method(method: str, quantity: str) -> None:
    s = FIVE["chain5"]()
    frf = s.frequency_response(LINES, outputs=range(5), quantity=quantity)
    modes = identify(
        frf, method=method, domain="s", order=10
    ).modes  # without what a canonical form has beyond the rank
    model = from_modes(modes.poles, modes.shapes, modes.participation, modes.feedthrough, None)
    found = equations_of_motion(model)
    assert relative(found.stiffness, np.linalg.solve(s.mass, s.stiffness)) < 1e-8
    assert relative(found.damping, np.linalg.solve(s.mass, s.damping)) < 1e-6


def test_two_block_rows_of_the_polyreference_method_are_equation_107() -> None:
    """With r = 2 and as many sensors as degrees of freedom there is nothing extraneous: the companion is [C; CA] A [C; CA]^-1."""
    s = FIVE["chain5"]()
    frf = s.frequency_response(LINES, outputs=range(5))
    found = identify(frf, method="polyreference", domain="s", order=10, block_rows=2)
    assert len(found.extraneous) == 0
    assert match_poles(found.modes.poles, s.modes().poles).damping_error < 1e-8
    assert relative(equations_of_motion(found.state_space).stiffness, s.stiffness) < 1e-8


def test_the_remedy_for_too_many_states_works() -> None:
    """The companion form of polyreference has more states than its order by default."""
    s = FIVE["chain5"]()
    frf = s.frequency_response(LINES, outputs=range(5))
    with pytest.raises(DataError, match=r"order=10; .*block_rows=2"):
        equations_of_motion(identify(frf, method="polyreference", domain="s", order=10).state_space)
    found = identify(frf, method="polyreference", domain="s", order=10, block_rows=2)
    assert relative(equations_of_motion(found.state_space).stiffness, s.stiffness) < 1e-8


def test_undamped_real_modes_come_from_stiffness_alone() -> None:
    """Frequencies without the damping matrix: those of the structure, not |s| of its non-proportionally damped modes."""
    s = FIVE["chain5"]()
    e = equations_of_motion(identify(s.frequency_response(LINES, outputs=range(5)), order=10).state_space)
    w, phi = s.undamped_modes()
    assert np.allclose(e.frequencies, w / (2 * np.pi), rtol=1e-10)
    assert relative(np.abs(e.shapes), np.abs(phi / np.linalg.norm(phi, axis=0))) < 1e-7


def test_more_sensors_than_degrees_of_freedom_give_the_projection() -> None:
    """C_d M^-1 K C_d#: five degrees of freedom seen by seven combinations."""
    s = FIVE["chain5"]()
    mix = np.random.default_rng(1).standard_normal((7, 5))
    ss = s.state_space(outputs=range(5))
    seen = StateSpace(A=ss.A, B=ss.B, C=mix @ ss.C)
    e = equations_of_motion(seen)
    assert relative(e.stiffness, mix @ s.stiffness @ np.linalg.pinv(mix)) < 1e-9
    assert np.allclose(e.frequencies, s.undamped_modes()[0] / (2 * np.pi), rtol=1e-9)


def test_too_few_sensors_and_sensors_that_see_the_same() -> None:
    s = FIVE["chain5"]()
    with pytest.raises(DataError, match=r"3 sensors give 6 rows of \[C; CA\], at least 10 are needed"):
        equations_of_motion(s.state_space(outputs=[0, 1, 2]))
    ss = s.state_space(outputs=[0, 1, 2, 3])
    twice = StateSpace(A=ss.A, B=ss.B, C=ss.C[[0, 1, 2, 3, 3]])
    with pytest.raises(DataError, match="do not separate the degrees of freedom"):
        equations_of_motion(twice)
    with pytest.raises(DataError, match="sampled every"):
        equations_of_motion(s.state_space(dt=0.05))


def test_first_order_form_needs_displacements_and_velocities() -> None:
    s = chain(np.ones(3), np.full(3, 400.0), [0.3, 0.1, 0.2])
    d, v = (s.state_space(quantity=q) for q in ("displacement", "velocity"))
    both = StateSpace(A=d.A, B=d.B, C=np.vstack([d.C, v.C]))
    form = first_order_form(both)
    assert relative(form.transfer([3j, 20j]), both.transfer([3j, 20j])) < 1e-10
    assert np.array_equal(form.C, np.eye(6))
    many = StateSpace(A=d.A, B=d.B, C=np.random.default_rng(0).standard_normal((8, 3)) @ d.C)
    with pytest.raises(DataError, match="the 8 outputs reach 3 of them"):
        first_order_form(many)


def test_one_block_row_is_the_first_order_form() -> None:
    """Eq. 109: the polyreference method with r = 1, exact with mixed outputs, refused with displacements alone."""
    s = chain(np.ones(3), np.full(3, 400.0), [0.3, 0.1, 0.2])
    d, v = (s.frequency_response(LINES, quantity=q) for q in ("displacement", "velocity"))
    both = type(d)(values=np.concatenate([d.values, v.values], axis=1), frequencies=LINES)
    found = identify(both, method="polyreference", domain="s", order=6, block_rows=1)
    assert match_poles(found.modes.poles, s.modes().poles).damping_error < 1e-8
    mix = np.random.default_rng(0).standard_normal((8, 3))
    alone = type(d)(values=np.einsum("ij,fjk->fik", mix, d.values), frequencies=LINES)
    with pytest.raises(DataError, match="fewer than the observability index"):
        identify(alone, method="polyreference", domain="s", order=6, block_rows=1)
