"""Units: what one of each is in SI, and data whose channels are converted."""

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.units import FACTORS, in_si, si_form
from modalscope.systems import chain5


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [
        ("g", 9.80665, "m/s2"),
        ("mg", 9.80665e-3, "m/s2"),
        ("Gal", 0.01, "m/s2"),
        ("lbf", 4.4482216152605, "N"),
        ("kip", 4448.2216152605, "N"),
        ("in/s^2", 0.0254, "m/s2"),
        ("mils", 2.54e-5, "m"),
        ("psi", 6894.757293168361, "Pa"),
        ("lbf*in", 0.1129848290276167, "N*m"),
        ("100 mV/g", 0.0980665, "m/s2"),
        ("10.2 mV/lbf", 4.4482216152605 / 10.2, "N"),
        (".5V/(m/s^2)", 2.0, "m/s2"),
        ("g/lbf", 9.80665 / 4.4482216152605, "m/s2/N"),
    ],
)
def test_a_unit_in_si_is_what_the_definitions_say(unit, factor, si):
    found = in_si(unit)
    assert found is not None
    assert found.factor == pytest.approx(factor, rel=1e-12)
    assert found.unit == si


@pytest.mark.parametrize("unit", ["EU", "mV/EU", "degC", "counts", "", "dB", "0 mV/g", "/", "m//s", "a" * 1000])
def test_what_is_not_known_stays(unit):
    assert in_si(unit) is None


def test_the_unit_of_each_kind_in_si_is_one_of_its_own():
    for si, units in FACTORS.values():
        assert units[si] == 1


def test_records_in_g_and_pounds_are_converted_and_what_is_not_known_stays_with_a_word():
    rng = np.random.default_rng(0)
    y, u = rng.standard_normal((20, 3)), rng.standard_normal((20, 1))
    record = ms.Signals(outputs=y, inputs=u, sampling_rate=10.0, units=(["g", "EU", ""], ["lbf"]))
    turned, notes = si_form(record)
    assert turned.outputs == pytest.approx(y * [9.80665, 1, 1])
    assert turned.inputs == pytest.approx(4.4482216152605 * u)
    assert turned.units == (("m/s2", "EU", ""), ("N",))
    assert turned.quantities == ("acceleration", None, None)
    assert [note.kind for note in notes] == ["units", "units not known"]
    assert "y1 from g to m/s2 (times 9.80665); u1 from lbf to N" in str(notes[0])
    assert "the unit EU of y2 is not known" in str(notes[1])
    assert turned.in_si() is turned
    si = ms.Signals(outputs=y, sampling_rate=10.0, units="m/s^2")
    assert si.in_si() is si


def test_frequency_responses_of_g_over_pounds_have_the_modal_masses_of_si():
    lines = np.linspace(0.3, 8, 300)
    true = chain5().frequency_response(lines, quantity="acceleration")
    per = 9.80665 / 4.4482216152605
    given = ms.FrequencyResponse(
        values=true.values / per,
        variance=np.full(true.values.shape, 4.0),
        frequencies=lines,
        units=("g", "lbf"),
        output_dofs=true.output_dofs,
        input_dofs=true.input_dofs,
    )
    turned = given.in_si()
    assert turned.values == pytest.approx(true.values, rel=1e-12)
    assert turned.variance == pytest.approx(4 * per**2)
    assert turned.quantity == "acceleration"
    modes = ms.analyze(given, refine=False).modes
    scaled = modes.normalized("mass")
    exact = chain5().modes()
    assert np.abs(scaled.shapes) == pytest.approx(np.abs(exact.shapes), rel=1e-6)


def test_correlations_go_with_the_product_of_both_units():
    y = np.random.default_rng(1).standard_normal((400, 2))
    record = ms.Signals(outputs=y, sampling_rate=10.0, units=(["g", "mm/s2"], None))
    options = {"references": ["y2"], "lags": 20}
    first, second = (
        ms.estimate_correlation(record, **options).in_si(),
        ms.estimate_correlation(record.in_si(), **options),
    )
    assert first.values == pytest.approx(second.values, rel=1e-12)
    assert first.units == second.units == (("m/s2", "m/s2"), ("m/s2",))


def test_runs_and_setups_are_converted_part_by_part():
    y = np.random.default_rng(2).standard_normal((40, 2))
    parts = [ms.Signals(outputs=y, sampling_rate=1.0, units="cm", output_dofs=["1Z", dof]) for dof in ("2Z", "3Z")]
    assert ms.Setups(parts=parts).in_si().parts[1].outputs == pytest.approx(y / 100)
    assert ms.Records(runs=parts[:1]).in_si().units == (("m", "m"), ())


def test_an_input_that_is_a_motion_is_told_and_one_that_is_a_force_is_not() -> None:
    rest = {"outputs": np.zeros((3, 2)), "inputs": np.ones((3, 1)), "sampling_rate": 1.0, "input_dofs": ["table"]}
    for units, told in (
        (("m/s2", "m/s2"), "Input table is a motion: responses are dimensionless transmissibilities"),
        (("m/s2", "mm"), "Input table is a motion: responses are transmissibilities"),
        (("g", "g"), "structure held at that point"),
        (("m/s2", "N"), ""),
        (("m/s2", ""), ""),
    ):
        notes = [note.text for note in si_form(ms.Signals(units=units, **rest))[1] if note.kind == "motion"]
        assert len(notes) == bool(told)
        assert all(told in note for note in notes)
