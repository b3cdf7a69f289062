"""Modal models: synthesis, scaling and choice of channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope import systems
from modalscope.data import DataError, ModalModel
from modalscope.data.mode_fields import joined
from modalscope.data.notes import Candidate, Harmonic
from tests.support import EPS, FIVE, relative

QUANTITIES = ("displacement", "velocity", "acceleration")


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", FIVE)
def test_impulse_response_of_the_modes_is_that_of_the_model(name: str, quantity: str) -> None:
    structure = FIVE[name]()
    modes = structure.modes(quantity=quantity)
    expected = structure.impulse_response(60, quantity=quantity, input="dirac")
    found = modes.impulse_response(60, 20.0)
    assert relative(found.values, expected.values) < 1e4 * EPS
    assert found.kind == expected.kind == "dirac"
    later = modes.impulse_response(10, 20.0, first_sample=50)
    np.testing.assert_allclose(later.values, found.values[50:], atol=1e-14)


def held(modes: ModalModel, dt: float) -> ModalModel:
    """Return the modes of the exactly sampled structure: participation times (exp(s dt) - 1) / s."""
    assert modes.participation is not None
    gain = np.expm1(modes.poles * dt) / modes.poles
    return ModalModel(
        poles=modes.poles,
        shapes=modes.shapes,
        participation=modes.participation * gain[:, None],
        feedthrough=modes.feedthrough,
        dt=dt,
        held_input=True,
    )


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", FIVE)
def test_modes_of_a_sampled_model_give_its_responses(name: str, quantity: str) -> None:
    structure = FIVE[name]()
    model = structure.state_space(dt=0.05, quantity=quantity)
    modes = held(structure.modes(quantity=quantity), 0.05)
    expected = model.impulse_response(40)
    found = modes.impulse_response(40)
    assert relative(found.values, expected.values) < 1e4 * EPS
    assert found.kind == "pulse"
    f = np.linspace(0, 10, 50)
    response = modes.frequency_response(f)
    assert relative(response.values, model.frequency_response(f).values) < 1e5 * EPS  # near 0 Hz accelerations cancel
    assert response.sampling_rate == 20


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", ["chain5", "close4", "heavy4", "spring_chain"])
def test_unit_modal_mass_is_found_again_from_a_driving_point(name: str, quantity: str) -> None:
    modes = systems.build(name).modes(quantity=quantity)
    scrambled = modes.normalized("max")
    assert relative(scrambled.residues, modes.residues) < 1e3 * EPS
    again = scrambled.normalized("mass")
    # shapes up to their sign
    signs = np.sign(np.sum(again.shapes * modes.shapes.conj(), axis=0).real)
    np.testing.assert_allclose(again.shapes * signs, modes.shapes, atol=1e-10)
    assert relative(again.residues, modes.residues) < 1e3 * EPS


def test_mass_normalised_shapes_diagonalise_the_mass_matrix() -> None:
    structure = systems.chain([1, 2, 3], [300, 200, 100], damping_ratios=0.02)
    shapes = structure.modes().normalized("unit").normalized("mass").shapes.real
    np.testing.assert_allclose(shapes.T @ structure.mass @ shapes, np.eye(3), atol=1e-12)


def test_unit_and_max_scale_what_they_say() -> None:
    modes = FIVE["chain5"]().modes()
    unit, largest = modes.normalized("unit"), modes.normalized("max")
    np.testing.assert_allclose(np.linalg.norm(unit.shapes, axis=0), 1)
    peak = unit.shapes[np.argmax(np.abs(unit.shapes), axis=0), np.arange(5)]
    np.testing.assert_allclose(peak.imag, 0, atol=1e-15)
    assert np.all(peak.real > 0)
    np.testing.assert_allclose(np.abs(largest.shapes).max(axis=0), 1)
    np.testing.assert_allclose(largest.shapes[np.argmax(np.abs(largest.shapes), axis=0), np.arange(5)], 1)
    assert modes.normalized("none") is modes


def test_a_shape_without_motion_is_left_as_it_is() -> None:
    modes = ModalModel(poles=[-1 + 9j], shapes=[[0.0], [0.0]], participation=[[1.0]])  # type: ignore[arg-type]
    for scale in ("unit", "max"):
        np.testing.assert_array_equal(modes.normalized(scale).shapes, 0)


def test_residuals_stand_for_the_modes_outside_the_band() -> None:
    structure = systems.spring_chain()
    f = np.linspace(2.0, 4.6, 40)
    whole = structure.modes().frequency_response(f).values
    middle = structure.modes().take([1, 2])
    first, last = structure.modes().take([0]), structure.modes().take([3, 4])
    # below the band a mode is mass, phi phi' / s^2, and above it stiffness, phi phi' / w^2
    lower = (first.shapes @ first.shapes.T).real
    upper = ((last.shapes / np.abs(last.poles) ** 2) @ last.shapes.T).real
    with_residuals = ModalModel(
        poles=middle.poles,
        shapes=middle.shapes,
        participation=middle.participation,
        lower_residual=lower,
        upper_residual=upper,
        quantity="displacement",
    )
    plain = relative(middle.frequency_response(f).values, whole)
    better = relative(with_residuals.frequency_response(f).values, whole)
    assert better < plain / 2
    assert relative(with_residuals.frequency_response(f, residuals=False).values, whole) == plain


def test_taking_modes_takes_all_that_belongs_to_them() -> None:
    modes = FIVE["chain5"]().modes()
    full = ModalModel(
        poles=modes.poles,
        shapes=modes.shapes,
        participation=modes.participation,
        frequencies_spread=np.arange(5.0),
        frequencies_repeatability=np.arange(5.0) / 2,
        shapes_std=np.ones((4, 1)) * np.arange(5.0),
        gain=np.arange(5.0) + 7,
        unrefined=modes,
        indicators={"mpc": np.arange(5.0) / 5},
        reasons=tuple({"mode": i} for i in range(5)),
    )
    for choice in ([3, 1], np.array([3, 1])):
        some = full.take(choice)
        np.testing.assert_array_equal(some.poles, modes.poles[[3, 1]])
        assert some.frequencies_spread is not None
        np.testing.assert_array_equal(some.frequencies_spread, [3, 1])
        np.testing.assert_array_equal(some.indicators["mpc"], [0.6, 0.2])
        assert some.gain is not None
        assert some.shapes_std is not None
        assert some.unrefined is not None
        np.testing.assert_array_equal(some.gain, [10, 8])
        np.testing.assert_array_equal(some.shapes_std[0], [3, 1])
        np.testing.assert_array_equal(some.unrefined.poles, some.poles)
        assert [reason["mode"] for reason in some.reasons] == [3, 1]
    assert len(full.take(modes.frequencies > 5)) == 2


def test_selecting_channels_cuts_shapes_participation_and_direct_terms() -> None:
    modes = FIVE["chain5"]().modes(quantity="acceleration")
    some = modes.select(outputs=["5:+X", "1:+X"], inputs="2:+X")
    f = np.linspace(1, 5, 7)
    whole = modes.frequency_response(f).select(outputs=["5:+X", "1:+X"], inputs="2:+X")
    np.testing.assert_allclose(some.frequency_response(f).values, whole.values, atol=1e-12)


def test_the_table_shows_what_is_known() -> None:
    text = FIVE["over4"]().modes().table()
    assert " ".join(text.splitlines()[0].split()) == "mode f [Hz] ± 95 % damping [%] ± 95 % grade MPC reason"
    assert text.count("pole is real: no decaying oscillation") == 2
    frame = pytest.importorskip("pandas") and FIVE["over4"]().modes().to_dataframe()
    assert list(frame.columns) == ["frequency_hz", "damping_ratio", "kind", "mpc", "grade", "reason"]


def test_what_is_not_known_of_one_mode_is_a_dash() -> None:
    modes = FIVE["chain5"]().modes()
    known = np.arange(len(modes)) > 0
    values = np.where(known, 0.5, np.nan)
    table = replace(modes, indicators={"emac": values}, gain=100 * values).table(wide=True)
    rows = [row.partition("uncertainty")[0].split() for row in table.splitlines()[1:]]
    assert [row[-2:] for row in rows] == [["50.0", "0.500"] if each else ["-", "-"] for each in known]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shapes": np.ones((2, 3))}, r"shapes needs shape \(any, 2\), \(outputs, modes\), but it has \(2, 3\)"),
        ({"participation": np.ones((3, 1))}, r"participation needs shape \(2, any\)"),
        ({"feedthrough": np.ones((1, 1))}, r"feedthrough needs shape \(3, 1\)"),
        ({"frequencies_std": [0.1]}, r"frequencies_std needs shape \(2\), \(modes,\), but it has \(1,\)"),
        ({"indicators": {"mpc": [1.0]}}, r"mpc needs shape \(2\)"),
        ({"reasons": ({},)}, "reasons needs one entry per mode, 2, but it has 1"),
        ({"poles": [np.nan, 1]}, "poles needs finite numbers"),
        ({"quantity": "strain"}, "quantity='strain'"),
        ({"output_dofs": ["1:X", "2:X"]}, "output_dofs needs 3 labels, one per channel, but 2 are given"),
    ],
)
def test_modal_models_that_do_not_fit_are_refused(change: dict, message: str) -> None:  # type: ignore[type-arg]
    good = {"poles": [-1 + 9j, -2 + 20j], "shapes": np.ones((3, 2)), "participation": np.ones((2, 1))}
    with pytest.raises(DataError, match=message):
        ModalModel(**{**good, **change})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.normalized("mass"), "there is no driving point"),
        (lambda m: m.normalized("sum"), "scale='sum'"),
        (lambda m: m.impulse_response(5), "the system is continuous.*\nGive sampling_rate"),
        (lambda m: held(m, 0.1).impulse_response(5, 20.0), "an input held at 10 Hz"),
        (lambda m: ModalModel(poles=m.poles, shapes=m.shapes).residues, "participation is not known"),
    ],
)
def test_what_modes_do_not_know_they_say(call, message: str) -> None:  # type: ignore[no-untyped-def]
    modes = ModalModel(poles=[-1 + 9j], shapes=np.ones((3, 1)), participation=np.ones((1, 1)))  # type: ignore[arg-type]
    with pytest.raises(DataError, match=message):
        call(modes)


def test_mass_scaling_needs_a_known_quantity() -> None:
    modes = ModalModel(
        poles=[-1 + 9j],
        shapes=[[1.0]],
        participation=[[1.0]],
        output_dofs=["1:X"],
        input_dofs=["1:X"],  # type: ignore[arg-type]
    )
    with pytest.raises(DataError, match="quantity of the response is not known"):
        modes.normalized("mass")


def full() -> ModalModel:
    """Three modes of two outputs and one input with every field known."""
    return ModalModel(
        poles=[-1 + 10j, -2 + 20j, -3 + 30j],
        shapes=[[1, 2j, 3], [2, 1, -4]],
        shapes_std=np.full((2, 3), 0.1),
        participation=[[1], [2], [3j]],
        frequencies_spread=[0.1, 0.2, 0.3],
        frequencies_std=[0.1, np.nan, 0.3],
        frequencies_repeatability=[0.2, 0.2, 0.2],
        gain=[10, 20, 30],
        indicators={"mpc": [0.9, 0.8, 0.7]},
        reasons=[{"text": name} for name in "abc"],
        left_out=[Candidate(frequency=4.0, damping_ratio=0.5, reason="too damped")],
        harmonics=[Harmonic(frequency=25.0, order=1)],
        unrefined=ModalModel(
            poles=[-1 + 11j, -2 + 21j, -3 + 31j], shapes=np.ones((2, 3)), participation=np.ones((3, 1))
        ),
        converged=True,
        notes=["one note"],
    )  # type: ignore[arg-type]


def test_one_mode_is_a_view_and_several_are_modes() -> None:
    modes = full()
    second = modes[1]
    assert second.pole == -2 + 20j
    assert (second.frequency, second.damping_ratio) == (modes.frequencies[1], modes.damping_ratios[1])
    assert np.shares_memory(second.shape, modes.shapes)
    np.testing.assert_array_equal(second.shape, [2j, 1])
    np.testing.assert_array_equal(second.participation, [2])
    assert (second.kind, second.indicators, second.reason) == ("mode", {"mpc": 0.8}, {"text": "b"})
    assert [mode.index for mode in modes] == [0, 1, 2]
    assert modes[-1].pole == -3 + 30j
    assert str(modes[0]) == "1.5995 Hz, 9.950 %"  # |-1 + 10j| / 2 pi and 1 / |-1 + 10j|
    for some in (modes[1:], modes[[1, 2]], modes[modes.frequencies > 2], modes[[-2, -1]]):
        assert isinstance(some, ModalModel)
        np.testing.assert_array_equal(some.poles, modes.poles[1:])
    assert len(modes[3:]) == len(modes[[]]) == 0
    bare = ModalModel(poles=[-1 + 10j], shapes=[[1.0]])  # type: ignore[arg-type]
    assert (bare[0].participation, bare[0].reason) == (None, {})


@pytest.mark.parametrize("which", [3, -4, [0, 3], [0.5], "first", [[0]], [True, False]])
def test_modes_that_are_not_there_are_an_error(which: object) -> None:
    with pytest.raises(DataError, match=r"(?s)mode.*counted from 0"):
        full()[which]  # type: ignore[call-overload]


def test_scaling_keeps_deviations_relative_to_the_shapes() -> None:
    modes = full()
    scaled = modes.normalized("max")
    assert scaled.shapes_std is not None
    np.testing.assert_allclose(scaled.shapes_std / np.abs(scaled.shapes), modes.shapes_std / np.abs(modes.shapes))
    assert scaled.unrefined is not None
    assert scaled.unrefined.scaling == scaled.scaling == "largest component 1"
    assert (scaled.left_out, scaled.harmonics, scaled.converged) == (modes.left_out, modes.harmonics, True)


def test_fewer_channels_are_fewer_for_deviations_and_for_the_modes_before_refinement() -> None:
    some = full().select(outputs=[1])
    assert some.shapes_std is not None
    assert some.unrefined is not None
    assert some.shapes_std.shape == some.unrefined.shapes.shape == (1, 3)


def test_joined_modes_hold_what_is_known_of_all() -> None:
    modes = full()
    both = joined([modes[:1], modes[1:]])
    for name in ("poles", "shapes", "shapes_std", "participation", "frequencies_spread", "gain"):
        np.testing.assert_array_equal(getattr(both, name), getattr(modes, name))
    assert both.reasons == modes.reasons
    assert both.notes == modes.notes
    assert both.unrefined is not None
    np.testing.assert_array_equal(both.unrefined.poles, modes.unrefined.poles)
    assert both.harmonics == modes.harmonics  # the same line of the same machine
    assert both.converged is True
    other = joined([modes[:1], ModalModel(poles=[-1 + 5j], shapes=[[1], [1]], participation=[[1]])])  # type: ignore[arg-type]
    assert (other.gain, other.unrefined, other.converged, other.reasons) == (None, None, None, ())


def test_an_interval_takes_the_wider_deviation_and_withholds_what_is_withheld() -> None:
    modes = full()
    frequency = modes.interval(0.95)["frequency"]
    half = 1.959963984540054 * np.array([0.2, np.nan, 0.3])  # the 97.5 % point of the normal distribution
    np.testing.assert_allclose(frequency.mean(axis=1)[[0, 2]], modes.frequencies[[0, 2]])
    np.testing.assert_allclose(np.diff(frequency)[:, 0] / 2, half)
    assert np.isnan(modes.interval()["damping_ratio"]).all()
    plain = ModalModel(poles=[-1 + 10j], shapes=[[1.0]], damping_ratios_repeatability=[0.01])  # type: ignore[arg-type]
    # one standard deviation on either side holds erf(1 / sqrt 2)
    ends = plain.interval(0.6826894921370859)["damping_ratio"]
    np.testing.assert_allclose(np.log(ends / plain.damping_ratios[:, None]) * plain.damping_ratios, [[-0.01, 0.01]])


@pytest.mark.parametrize(
    ("modes", "level", "message"),
    [
        (ModalModel(poles=[-1 + 9j], shapes=[[1.0]]), 0.95, "no standard deviation of these modes is known"),  # type: ignore[arg-type]
        (full(), 1.0, "level needs a number above 0 and below 1, but it is 1"),
        (full(), "high", "level needs a finite number"),
    ],
)
def test_intervals_that_cannot_be_told(modes: ModalModel, level: float, message: str) -> None:
    with pytest.raises(DataError, match=message):
        modes.interval(level)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shapes_std": np.ones((3, 2))}, r"shapes_std needs shape \(2, 3\), \(outputs, modes\), but it has \(3, 2\)"),
        ({"gain": [1.0]}, r"gain needs shape \(3\)"),
        ({"left_out": [4.0]}, "each of left_out"),
        ({"harmonics": "25 Hz"}, "harmonics needs a list of Harmonic"),
        ({"unrefined": "before"}, "unrefined"),
        ({"unrefined": full()[:1]}, "unrefined needs one entry per mode, 3, but it has 1"),
        ({"converged": "yes"}, "converged"),
    ],
)
def test_fields_of_a_result_that_do_not_fit_are_refused(change: dict, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(DataError, match=message):
        replace(full(), **change)


def test_references_are_no_forces_and_give_no_modal_mass() -> None:
    record = systems.chain5().simulate(
        inputs="ambient", samples=4000, sampling_rate=20.0, quantity="acceleration", seed=1
    )
    correlation = ms.estimate_correlation(record)
    for response in (correlation, ms.preprocess.half_spectra(correlation)):
        modes = ms.identify(response, order=10, deviations=False).modes
        with pytest.raises(DataError, match=r"no force was measured.*\n.*scale_by_mass"):
            modes.normalized("mass")


def test_intervals_follow_student_and_damping_multiplies():
    modes = ms.ModalModel(
        poles=[-1 + 100j, -2 + 300j],
        shapes=[[1.0, 1.0]],
        frequencies_std=[0.1, 0.2],
        damping_ratios_std=[0.005, 0.001],
        frequencies_repeatability=[0.3, 0.1],
        damping_ratios_lower=[0.004, np.nan],
        degrees=[[5, 7], [np.nan, 10]],
    )
    t5, t7, t10 = 2.5705818, 2.3646243, 2.2281389  # Student's quantiles at .975
    ends, f, zeta = modes.interval(), modes.frequencies, modes.damping_ratios
    np.testing.assert_allclose(np.ptp(ends["frequency"], axis=1) / 2, [t5 * 0.3, 1.959964 * 0.2], rtol=1e-6)
    part = np.array([t7 * 0.005, t10 * 0.001]) / zeta
    np.testing.assert_allclose(ends["damping_ratio"][:, 1], zeta * np.exp(part), rtol=1e-6)
    np.testing.assert_allclose(ends["damping_ratio"][:, 0], [0.004, zeta[1]] * np.exp(-part), rtol=1e-6)
    assert np.all(ends["damping_ratio"] > 0)
    assert modes.take([1]).degrees.shape == (1, 2)
    opened = replace(modes, degrees=[[0, 0], [5, 5]]).interval()
    assert np.array_equal(np.isnan(opened["frequency"][:, 0]), [True, False])
    assert np.array_equal(np.isnan(opened["damping_ratio"]), [[True, True], [False, False]])
    np.testing.assert_allclose(ends["frequency"].mean(axis=1), f)
