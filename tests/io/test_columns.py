"""Evidence on columns: rates of times, what names and units say, and options that say what they do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import modalscope as ms
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.columns.axis import grain_of, roundest, sampling_of
from modalscope.io.columns.weights import role_by_words
from modalscope.io.columns.words import UNITS, is_unit, kind_of_unit, plain_unit, roles_of_option
from modalscope.io.text.cells import Dialect, complex_of, is_value, number_of, split
from tests.support import refused

ROWS = np.arange(400)


def table(*heads: tuple[str, str], **given: object) -> Table:
    rng = np.random.default_rng(0)
    columns = [
        Column(
            number=k, name=name, unit=unit, values=ROWS / 100 if name.lower() == "time" else rng.standard_normal(400)
        )
        for k, (name, unit) in enumerate(heads, 1)
    ]
    return Table(where="a.csv", columns=tuple(columns), **given)


@pytest.mark.parametrize("rate", [50.0, 100.0, 256.0, 1000.0, 1024.0, 2560.0, 12800.0, 51200.0])
@pytest.mark.parametrize("digits", [4, 6, 9])
def test_rounded_times_give_the_rate_that_was_meant_or_say_how_far_it_is_open(rate: float, digits: int) -> None:
    """Over N steps rounding to q leaves q / (N T) of the rate open."""
    times = np.round(np.arange(20_000) / rate, digits)
    found = sampling_of(times)
    assert abs(found.rate - rate) <= max(found.doubt, 1e-6 * rate)
    assert found.doubt <= 10.0**-digits * rate**2 / 19_999 * 1.01


@pytest.mark.parametrize("form", ["%.3f", "%.4f", "%.3g", "%.2e"])
@pytest.mark.parametrize("rate", [100.0, 256.0, 1000.0, 1000 / 3, 2048.0, 4000.0, 48000.0, 51200.0, 1652.8926])
def test_of_the_rates_that_few_digits_leave_it_is_that_of_samplers(rate: float, form: str) -> None:
    """Three significant digits are worth more at the end than at the start: a tick lies halfway between what is printed."""
    for count in (200, 1000, 4000):
        found = sampling_of(np.array([float(form % (k / rate)) for k in range(count)]))
        assert found.rate == pytest.approx(rate, rel=1e-15) or rate == 1652.8926
        assert abs(found.rate - rate) <= 2 * found.doubt + 1e-6 * rate


def test_a_rate_of_samplers_is_taken_as_far_as_the_doubt_goes_and_no_further() -> None:
    for rate in (4000.0, 1024.0, 102.4, 1.5, 48000.0, 625.0, 1000 / 3):
        for side in (-1, 1):
            assert roundest(rate + side * 0.0019 * rate, 0.002 * rate) == pytest.approx(rate, rel=1e-15)
            assert abs(roundest(rate + side * 0.0021 * rate, 0.002 * rate) - rate) > 1e-4 * rate
    assert roundest(4008.2, 8.0) == 4008.0


def test_what_digits_leave_of_a_rate_is_told_and_the_option_that_is_printed_works(tmp_path) -> None:
    def written(count: int, form: str) -> str:
        rng = np.random.default_rng(0)
        rows = "".join(f"{form % (k / 4000)},{rng.standard_normal():.3f}\n" for k in range(count))
        (tmp_path / "a.csv").write_text("time (s),acc (m/s^2)\n" + rows)
        return str(tmp_path / "a.csv")

    notes = ms.io.survey(written(5000, "%.3f")).told
    assert any(
        "4000 Hz by the times of column 1, the roundest of what their digits leave (±0.8" in n.text for n in notes
    )
    error = refused("too few digits: 4000 Hz, give or take 8", ms.read, written(200, "%.4f"))
    assert error.change == "Give it in samples per second: --sampling-rate 4000, if that is the one"
    assert ms.read(tmp_path / "a.csv", sampling_rate=4000).sampling_rate == 4000


def test_a_lost_sample_is_found_and_a_coarse_clock_is_none() -> None:
    times = np.delete(np.arange(1000) / 100, 500)
    refused("longest at row 501", sampling_of, times)
    coarse = np.floor(np.arange(3000) / 1024 * 100) / 100  # ten samples share a time
    found = sampling_of(coarse)
    assert abs(found.rate - 1024) < found.doubt < 4
    refused("they do not increase", sampling_of, np.array([0.0, 1.0, 0.5, 2.0]))
    refused("there is one sample", sampling_of, np.array([0.0]))


def test_times_a_hundredth_off_a_multiple_are_no_multiples() -> None:
    # 3 is 300 hundredths, 0.0123 and 1.0004 are none: the latter are 123 and 10 004 parts of 1e-4
    assert grain_of(np.array([0.0, 0.01, 3.0])) == 0.01
    assert grain_of(np.array([0.0, 0.0123, 1.0004])) == 1e-4
    # 0.005 and 0.009 are nearly 0, and 1.005 nearly 1, in whole seconds
    assert grain_of(np.array([0.0, 0.005, 0.009, 1.005])) == 1e-3


def test_commas_pair_cells_only_where_their_number_is_even() -> None:
    both = Dialect(delimiter=",", decimal=",", paired=True)
    assert split("1,5,-2,25", both) == ["1,5", "-2,25"]
    assert split("1,5,-2", both) == ["1", "5", "-2"]


@given(st.floats(1, 1e5), st.floats(0, 1))
def test_the_roundest_number_lies_within_the_doubt(value: float, doubt: float) -> None:
    assert abs(roundest(value, doubt) - value) <= doubt


def test_every_unit_is_known_in_every_writing() -> None:
    for kind, units in UNITS.items():
        for unit in units:
            assert kind_of_unit(unit) == kind
            assert kind_of_unit(f"[{unit}]") == kind
    assert {plain_unit(text) for text in ("m/s²", "m/s^2", "m / s2", "[m/s**2]", "m/(s2)")} == {"m/s2"}
    assert is_unit("(m/s²)/N")
    assert not is_unit("Force")


@pytest.mark.parametrize("unit", ["(m/s²)/(N)", "((m/s^2)/N)", "[m/s2/N]", "[m/s2]/[N]", "m/(s^2)/N"])
def test_brackets_around_both_sides_of_a_ratio_are_none_around_all(unit: str, tmp_path: Path) -> None:
    rows = "".join(f"{k}\t{1 / k:.6g}\t{-0.1 * k:.6g}\n" for k in range(1, 40))
    (tmp_path / "a.txt").write_text(f"Frequency\tReal\tImaginary\nHz\t{unit}\t \n{rows}", encoding="utf-8")
    found = ms.read(tmp_path / "a.txt")
    assert found.quantity == "acceleration"
    assert found.units[1] == ("N",)


@pytest.mark.parametrize(
    ("name", "unit", "role"),
    [
        ("Hammer", "", "in"), ("Channel 3", "lbf", "in"), ("Input force", "N", "in"), ("Exc 1", "", "in"), ("In 1", "", "in"),
        ("Time", "", "time"), ("Elapsed time", "s", "time"), ("t", "", "time"), ("X_Value", "", "time"), ("Zeit", "", "time"),
        ("Frequency", "", "frequency"), ("f", "Hz", "frequency"), ("omega", "rad/s", "frequency"),
        ("AccA", "", "out"), ("Ch 4", "m/s^2", "out"), ("Displacement", "mm", "out"), ("SG1", "um/m", "out"), ("p", "Pa", "out"),
        ("Temp", "°C", "ignore"), ("Speed", "rpm", "ignore"), ("Sample", "", "index"), ("#", "", "index"),
        ("Ch 4", "", ""), ("ai0", "V", "out"), ("Sample force", "", "in"), ("Response time", "", "out"),
    ],
)  # fmt: skip
def test_names_and_units_say_what_a_column_is(name: str, unit: str, role: str) -> None:
    assert role_by_words(name, unit) == role


@pytest.mark.parametrize(
    ("step", "stated", "rate"),
    [
        (1 / 512 * (1 + 2e-4), 512.0, 512 / (1 + 2e-4)),  # a clock of its own, whose header says what it was set to
        (0.001953, 512.0, 512.0),  # the step of the stated rate, rounded
        (1 / 512, 512.0, 512.0),
        (0.01, 100.05, 100.05),
    ],
)
def test_times_of_a_clock_say_its_rate_and_rounded_ones_that_of_the_header(
    step: float, stated: float, rate: float
) -> None:
    times = Column(number=1, name="Time", unit="s", values=step * np.arange(2000))
    values = Column(number=2, name="a", unit="g", values=np.random.default_rng(0).standard_normal(2000))
    held = Table(where="a.csv", columns=(times, values), rate=stated, rate_from="line 1")
    assert contents_from_table(held, {}).thing.sampling_rate == pytest.approx(rate, rel=1e-6)
    assert contents_from_table(held, {"sampling_rate": stated}).thing.sampling_rate == stated


def test_what_is_said_goes_before_what_is_seen() -> None:
    held = table(("Time", "s"), ("A", "V"), ("B", "V"), ("Temp", "degC"))
    seen = contents_from_table(held, {})
    assert (seen.thing.inputs, seen.thing.output_dofs) == (None, ("A", "B"))
    assert any('--columns "in=2"' in note for note in seen.notes)
    said = contents_from_table(held, {"columns": "in=2"}).thing
    assert (said.input_dofs, said.output_dofs) == (("A",), ("B",))
    assert contents_from_table(held, {"columns": "time=Time,out=B,Temp"}).thing.output_dofs == ("B", "Temp")
    assert contents_from_table(held, {"ignore": "B"}).thing.output_dofs == ("A",)
    by_unit = contents_from_table(held, {"units": {"A": "N", "3": "g"}}).thing
    assert (by_unit.input_dofs, by_unit.units, by_unit.quantity) == (("A",), (("g",), ("N",)), "acceleration")
    left = {finding.part: finding.reason for finding in seen.found if not finding.taken}
    assert left == {"column 4": "degC is no vibration"}


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"columns": "x=2"}, "not of the form ROLE=COLUMNS"),
        ({"columns": "in=9"}, "column '9' of columns"),
        ({"columns": "in=2-9"}, "column '2-9' of columns"),
        ({"columns": "in=A,out=A"}, "has two roles"),
        ({"ignore": "Z"}, "column 'Z' of ignore"),
        ({"ignore": ["A", "B"]}, "needs a column of measured values"),
        ({"sampling_rate": 50.0}, "the times of column 1, 'Time' .s. say 100 Hz"),
    ],
)
def test_options_that_cannot_be_met_are_named(options: dict[str, object], text: str) -> None:
    refused(text, contents_from_table, table(("Time", "s"), ("A", ""), ("B", "")), options)


def test_a_rising_column_is_time_beside_a_force_and_asked_for_otherwise() -> None:
    values = np.random.default_rng(1).standard_normal((2, 50))
    rising = Column(number=1, values=np.arange(50) * 0.25)
    beside = [Column(number=2, name="Force", values=values[0]), Column(number=3, values=values[1])]
    assert contents_from_table(Table(where="a", columns=(rising, *beside)), {}).thing.sampling_rate == 4
    bare = (rising, Column(number=2, values=values[0]), Column(number=3, values=values[1]))
    refused(
        "columns='time=1,out=2-3', or columns='frequency=1,real=2,imag=3'",
        contents_from_table,
        Table(where="a", columns=bare),
        {},
    )
    lines = contents_from_table(Table(where="a", columns=bare), {"columns": "frequency=1,real=2,imag=3"}).thing
    assert isinstance(lines, ms.FrequencyResponse)


def test_roles_go_on_until_the_next() -> None:
    columns = [Column(number=k, name=f"c{k}", values=np.zeros(2)) for k in range(1, 7)]
    assert roles_of_option(columns, "time=1,in=2,4,out=5-") == {1: "time", 2: "in", 4: "in", 5: "out", 6: "out"}


@settings(max_examples=200, deadline=None)
@given(
    st.floats(allow_nan=False, allow_infinity=False, width=64),
    st.sampled_from([(".", ""), (",", ""), (",", "."), (".", ","), (".", "'")]),
)
def test_numbers_come_back_from_every_writing(value: float, signs: tuple[str, str]) -> None:
    decimal, thousands = signs
    text = repr(value)
    if thousands and "e" not in text:
        text = f"{int(value):,}".replace(",", "_") + "." + text.partition(".")[2] if value >= 0 else text
    text = text.replace(".", "#").replace("_", thousands).replace("#", decimal)
    assert is_value(text)
    assert number_of(text, Dialect(delimiter=";", decimal=decimal, thousands=thousands)) == value


@given(st.complex_numbers(allow_nan=False, allow_infinity=False), st.sampled_from("ij"), st.booleans())
def test_complex_numbers_come_back(value: complex, letter: str, brackets: bool) -> None:
    text = f"{value.real!r}{value.imag:+}{letter}"
    assert complex_of(f"({text})" if brackets else text, Dialect(delimiter=";")) == value


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("a,b", 'all are outputs (else: --columns "in=2")'),
        ("roof,ground", 'ground may be a base that drives the rest: --columns "in=3"'),
        ("ShakeTable,top", 'ShakeTable may be a base that drives the rest: --columns "in=2"'),
    ],
)
def test_a_base_that_moves_is_asked_for_by_name(names: str, said: str) -> None:
    seen = contents_from_table(table(("time", "s"), *((name, "m/s2") for name in names.split(","))), {})
    assert any(said in note for note in seen.notes)
