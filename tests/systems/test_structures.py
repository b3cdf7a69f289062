"""Structures: closed forms, two routes to every response, and the published numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope import systems
from modalscope.model import DataError
from tests.support import EPS, FIVE, match_poles, relative

QUANTITIES = ("displacement", "velocity", "acceleration")

#: Responses by two routes differ by rounding times the ratio of the stiffest to the softest pole, below 1e3 here.
ROUNDING = 1e4 * EPS


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", FIVE)
def test_modes_state_space_and_dynamic_stiffness_give_one_frequency_response(name: str, quantity: str) -> None:
    structure, f = FIVE[name](), np.linspace(0.2, 9, 60)
    expected = structure.frequency_response(f, quantity=quantity)
    model = structure.state_space(quantity=quantity).frequency_response(f)
    modal = structure.modes(quantity=quantity).frequency_response(f)
    assert relative(model.values, expected.values) < ROUNDING
    assert relative(modal.values, expected.values) < ROUNDING
    assert modal.output_dofs == expected.output_dofs
    assert modal.quantity == quantity


@pytest.mark.parametrize("name", FIVE)
def test_poles_of_the_modes_are_those_of_the_state_space_model(name: str) -> None:
    structure = FIVE[name]()
    match = match_poles(structure.state_space().poles, structure.modes().poles)
    # damping ratios down to .25 %: 400 times the rounding of a pole
    assert match.frequency_error < ROUNDING
    assert match.damping_error < 1e2 * ROUNDING


def test_the_five_structures_have_the_modes_they_are_named_after() -> None:
    modes = {name: build().modes() for name, build in FIVE.items()}
    assert 0.0024 < modes["chain5"].damping_ratios.min() < modes["chain5"].damping_ratios.max() < 0.0161
    ring = modes["ring5"].frequencies
    np.testing.assert_allclose(ring[[1, 3]], ring[[2, 4]], rtol=1e-12)
    gaps = np.diff(modes["close4"].frequencies) / modes["close4"].frequencies[:-1]
    np.testing.assert_allclose(gaps[[0, 2]], [0.028, 0.0016], rtol=0.05)  # given as 2.8 % and .16 %
    np.testing.assert_allclose(modes["heavy4"].damping_ratios, [0.01, 0.35, 0.02, 0.015], rtol=1e-12)
    real = modes["over4"].poles[np.array(modes["over4"].kinds) == "real"].real
    np.testing.assert_allclose(np.sort(real), [-57, -8.4], rtol=0.01)  # given as 8.4 and 57 1/s


def test_five_structures_are_seen_by_four_outputs_and_two_inputs_every_0_05_s() -> None:
    for build in FIVE.values():
        structure = build()
        assert (len(structure.outputs), len(structure.inputs), structure.dt) == (4, 2, 0.05)


@given(n=st.integers(1, 40), m=st.floats(0.1, 100), k=st.floats(1, 1e6), zeta=st.floats(0.001, 0.5))
@settings(max_examples=25, deadline=None)
def test_spring_chain_of_any_length_has_the_closed_form_modes(n: int, m: float, k: float, zeta: float) -> None:
    numeric = systems.spring_chain(n, mass=m, stiffness=k, damping_ratio=zeta).modes(quantity="acceleration")
    exact = systems.spring_chain_modes(n, mass=m, stiffness=k, damping_ratio=zeta, quantity="acceleration")
    # the lowest of n frequencies is pi / 4n of the highest: its square loses (4n / pi)^2 of the digits
    tolerance = 100 * (1 + n) ** 2 * EPS
    np.testing.assert_allclose(numeric.frequencies, exact.frequencies, rtol=tolerance)
    np.testing.assert_allclose(numeric.damping_ratios, zeta, rtol=tolerance)
    np.testing.assert_allclose(np.abs(numeric.shapes), np.abs(exact.shapes), atol=tolerance / np.sqrt(m))
    assert exact.feedthrough is not None
    np.testing.assert_allclose(exact.feedthrough, np.eye(n) / m)


def test_spring_chain_has_the_published_five_storey_frequencies() -> None:
    published = [0.889952, 2.597758, 4.095108, 5.260697, 6.000096]
    np.testing.assert_allclose(systems.spring_chain().modes().frequencies, published, atol=5e-7)


def test_closed_form_modes_of_a_hundred_thousand_masses_need_no_matrix() -> None:
    n = 100_000
    modes = systems.spring_chain_modes(n, modes=12, outputs=[0, n // 2, n - 1], inputs=[n - 1])
    assert modes.shapes.shape == (3, 12)
    assert modes.participation is not None
    # modal mass one: m sum phi^2 = 1 over all masses
    every = systems.spring_chain_modes(n, modes=2).shapes.real
    np.testing.assert_allclose(25.91 * np.sum(every**2, axis=0), 1, rtol=1e-10)


def test_three_masses_have_the_published_truth() -> None:
    modes = systems.three_masses().modes()
    np.testing.assert_allclose(modes.frequencies, [1.33603, 7.39083, 13.79671], atol=5e-6)
    np.testing.assert_allclose(modes.damping_ratios, [0.02, 0.075, 0.05], atol=5e-8)


def test_three_masses_record_starts_at_one_metre_per_second_and_repeats_its_noise() -> None:
    clean, noisy = systems.three_masses_record(noisy=False), systems.three_masses_record()
    np.testing.assert_array_equal(clean.values[0, :, 0], np.ones(3))
    assert (clean.samples, clean.kind, clean.quantity) == (100, "free decay", "velocity")
    np.testing.assert_array_equal(noisy.values, systems.three_masses_record().values)
    scatter = (noisy.values - clean.values).std()
    assert abs(scatter / 0.05 - 1) < 4 / np.sqrt(
        2 * 300
    )  # four standard deviations of a standard deviation of 300 numbers


def test_free_decay_from_a_displacement_is_the_sum_of_its_modes() -> None:
    structure = systems.chain([2.0], [200.0], [0.8], dt=0.01)
    decay = structure.free_decay(50, displacement=[0.3])
    t, w, zeta = np.arange(50) * 0.01, 10.0, 0.02
    wd = w * np.sqrt(1 - zeta**2)
    exact = 0.3 * np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t))
    np.testing.assert_allclose(decay.values[:, 0, 0], exact, atol=1e-13)


def test_iasc_asce_has_the_published_frequencies() -> None:
    published = [9.41, 11.79, 16.38, 25.54, 32.01, 38.66, 48.01, 60.15]
    found = systems.iasc_asce().modes()
    assert set(published) <= set(found.frequencies.round(2))
    np.testing.assert_allclose(found.damping_ratios, 0.01, rtol=1e-10)


def test_iasc_asce_storey_stiffness_is_that_of_its_members() -> None:
    # nine columns of 12 E I / h^3 and braces of E A cos^2 / L, member by member about the axis: published to 4-5 digits
    E, h, b = 2e11, 0.9, 1.25
    column = {"x": 12 * E * 1.97e-6 / h**3, "y": 12 * E * 0.664e-6 / h**3}
    brace = E * 0.141e-3 / np.hypot(b, h) ** 3 * b**2
    turned = sum(column["x"] * y**2 + column["y"] * x**2 for x in (-b, 0, b) for y in (-b, 0, b)) + 8 * brace * b**2
    structure = systems.iasc_asce()
    top = structure.stiffness[-3:, -3:]
    np.testing.assert_allclose(
        np.diag(top), [9 * column["x"] + 4 * brace, 9 * column["y"] + 4 * brace, turned], rtol=1e-4
    )


def test_iasc_asce_without_braces_has_the_frequencies_of_its_damage_patterns() -> None:
    for storeys, published in (((1,), [6.24, 21.53, 37.37, 47.83]), ((1, 3), [5.82, 14.89, 36.06, 41.35])):
        frequencies = systems.iasc_asce(without_braces=storeys).modes().frequencies
        # weak direction; the members' stiffness is published to four digits
        assert all(np.min(np.abs(frequencies - f)) < 0.01 for f in published)
    with pytest.raises(DataError, match=r"storeys \[5\] without braces were asked, but the storeys are 1 to 4"):
        systems.iasc_asce(without_braces=[5])


@pytest.mark.parametrize("far_end", ["free", "pinned", "clamped"])
def test_beam_frequencies_converge_from_above_with_the_fourth_power_of_the_element(far_end: str) -> None:
    exact = systems.clamped_beam_frequencies(3, far_end=far_end)
    coarse, fine = (systems.clamped_beam(e, far_end=far_end).modes().frequencies[:3] / exact - 1 for e in (6, 12))
    assert np.all(fine > 0)
    np.testing.assert_allclose(coarse / fine, 16, rtol=0.1)  # h^4, with the next power still felt


def test_clamped_beam_roots_are_the_textbook_ones() -> None:
    # Blevins, Formulas for Natural Frequency and Mode Shape, table 8-1
    for far_end, roots in (
        ("free", [1.87510407, 4.69409113, 7.85475744]),
        ("clamped", [4.73004074, 7.85320462, 10.9956078]),
        ("pinned", [3.92660231, 7.06858275, 10.21017612]),
    ):
        f = systems.clamped_beam_frequencies(3, far_end=far_end, bending_stiffness=1, mass_per_length=1)
        np.testing.assert_allclose(np.sqrt(2 * np.pi * f), roots, atol=5e-8)


def test_rigid_motion_stands_in_the_lower_residual() -> None:
    free = systems.Structure(mass=np.diag([1.0, 2.0]), stiffness=[[8, -8], [-8, 8]], damping=[[0.1, -0.1], [-0.1, 0.1]])  # type: ignore[arg-type]
    f = np.linspace(0.1, 2, 20)
    for quantity in QUANTITIES:
        modes = free.modes(quantity=quantity)
        assert len(modes) == 1
        expected = free.frequency_response(f, quantity=quantity)
        assert relative(modes.frequency_response(f).values, expected.values) < ROUNDING


def test_critical_damping_is_refused_by_name() -> None:
    critical = systems.chain([1.0], [100.0], [20.0])
    with pytest.raises(DataError, match="repeated without an eigenvector"):
        critical.modes()
    blocks = critical.state_space().modal_form().blocks
    assert [block.separate for block in blocks] == [False]


def test_repeated_modes_under_coupled_damping_keep_their_residues() -> None:
    # two equal oscillators coupled through a damper only: repeated frequencies that classical shapes must be turned for
    damping = np.array([[0.5, -0.3], [-0.3, 0.5]])
    twins = systems.Structure(mass=np.eye(2), stiffness=100 * np.eye(2), damping=damping)
    f = np.linspace(0.5, 3, 30)
    assert relative(twins.modes().frequency_response(f).values, twins.frequency_response(f).values) < ROUNDING
    np.testing.assert_allclose(np.sort(twins.modes().damping_ratios), [0.01, 0.04], rtol=1e-12)


@pytest.mark.parametrize("input", ["held", "dirac"])
def test_impulse_response_says_what_its_input_was(input: str) -> None:
    structure = systems.chain5()
    response = structure.impulse_response(30, quantity="acceleration", input=input)
    assert response.kind == {"held": "pulse", "dirac": "dirac"}[input]
    assert (response.feedthrough is None) == (input == "dirac")
    assert response.sampling_rate == 20
    assert response.units == (("m/s2",) * 4, ("N",) * 2)


def test_channels_are_chosen_by_label_or_number_and_appear_in_that_order() -> None:
    structure = systems.chain5()
    by_label = structure.frequency_response([1.0, 2.0], outputs=["5:+X", "1:+X"], inputs="3:+X")
    by_number = structure.frequency_response([1.0, 2.0], outputs=[4, 0], inputs=[2])
    np.testing.assert_array_equal(by_label.values, by_number.values)
    assert by_label.output_dofs == ("5:+X", "1:+X")


def test_geometry_knows_every_degree_of_freedom() -> None:
    for build in systems.catalog().values():
        structure = build()
        assert structure.geometry is not None
        translations = [dof for dof in structure.dofs if not dof.endswith("RY")]
        assert all(structure.geometry.motion_of(dof) for dof in translations)


def test_catalog_builds_by_name_and_names_the_nearest() -> None:
    assert {*FIVE, "spring_chain", "three_masses", "iasc_asce", "clamped_beam"} == set(systems.names())
    assert systems.build("over4").name == "over4"
    with pytest.raises(DataError, match="Did you mean 'ring5'"):
        systems.build("rng5")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass": [[1, 0], [0, -1]]}, "mass needs a positive definite matrix"),
        ({"stiffness": [[1, 2], [3, 4]]}, "stiffness needs a symmetric matrix"),
        ({"stiffness": [[1]]}, r"stiffness needs shape \(2, 2\), but it has \(1, 1\)"),
        ({"damping": [[np.nan, 0], [0, 1]]}, "damping needs finite numbers"),
        ({"outputs": [2]}, "output '2' was asked"),
        ({"dofs": ["1:X", "1:X"]}, "dofs needs different labels"),
        ({"dt": 0}, "dt needs a positive number"),
    ],
)
def test_structures_that_do_not_fit_are_refused(change: dict, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(DataError, match=message):
        systems.Structure(**{"mass": np.eye(2), "stiffness": np.eye(2), **change})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.state_space(quantity="force"), "quantity='force' was asked"),
        (lambda s: s.modes(outputs=["9:+X"]), "output '9:\\+X' was asked"),
        (lambda s: s.impulse_response(10), "chain has no sampling interval of its own.*\nGive sampling_rate"),
        (lambda s: s.free_decay(10, velocity=[1], sampling_rate=10), "velocity needs 2 entries"),
        (lambda s: s.frequency_response([1.0], noise=-1), "noise needs a fraction"),
        (lambda s: s.simulate(sampling_rate=10), "its length is not given"),
        (lambda s: s.simulate(samples=10, inputs="pink", sampling_rate=10), "inputs='pink' was asked"),
        (lambda s: s.simulate(inputs=np.ones((9, 1)), sampling_rate=10), "inputs has 1 columns"),
        (lambda s: s.simulate(inputs=np.ones((9, 2)), samples=5, sampling_rate=10), "the forces have 1 of 9"),
        (lambda s: s.simulate(inputs="ambient", samples=9, sampling_rate=10), "a stationary start was asked"),
    ],
)
def test_calls_that_cannot_be_met_say_why(call, message: str) -> None:  # type: ignore[no-untyped-def]
    undamped = systems.chain([1, 1], [10, 10])
    with pytest.raises(DataError, match=message):
        call(undamped)


def test_chain_refuses_links_that_do_not_fit() -> None:
    with pytest.raises(DataError, match="3 masses in a row need 3 dampings, or 4"):
        systems.chain([1, 1, 1], [1, 1, 1], [1, 1])
    with pytest.raises(DataError, match="one excludes the other"):
        systems.chain([1], [1], [1], damping_ratios=0.1)
    fixed = systems.chain([1, 1], [5, 5, 5])
    np.testing.assert_array_equal(fixed.stiffness, [[10, -5], [-5, 10]])


def test_an_undamped_structure_at_resonance_has_no_response() -> None:
    single = systems.chain([1.0], [(2 * np.pi) ** 2])
    with pytest.raises(
        DataError, match="frequency response at 1 Hz was asked, but the structure has an undamped pole there"
    ):
        single.frequency_response([1.0])
