"""Weights of columns and readings of a table: what values say of each other, and what is read, asked or left."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.columns.weights import likeliest_force, weigh
from tests.support import refused

_RNG = np.random.default_rng(3)
#: Two responses of one mode over 300 lines, 1 Hz apart.
_LINES = np.arange(1.0, 301.0)
_H = np.stack([a / (90.0**2 - _LINES**2 + 4j * _LINES) for a in (1e3, -2e3)], axis=1)


def _table(*values: np.ndarray, names: str = "") -> Table:
    heads = names.split(",") if names else [""] * len(values)
    columns = tuple(Column(number=k, name=n, values=v) for k, (n, v) in enumerate(zip(heads, values, strict=True), 1))
    return Table(where="a.csv", columns=columns)


def _left(table: Table, **options: object) -> dict[str, str]:
    findings = contents_from_table(table, options).found
    return {finding.part: finding.reason for finding in findings if not finding.taken}


@pytest.mark.parametrize("of", [(0,), (0, 2), (0, 1, 2)])
def test_a_magnitude_of_any_of_the_others_is_left(of: tuple[int, ...]) -> None:
    a = _RNG.standard_normal((200, 3))
    size = np.sqrt(np.sum(a[:, of] ** 2, axis=1))
    table = _table(np.arange(200) / 100, *a.T, size, names="t,a,b,c,d")
    assert _left(table) == {"column 5": "it is the magnitude of the others"}
    rough = _table(np.arange(200) / 100, *a.T, size * np.linspace(1, 1.01, 200), names="t,a,b,c,d")
    assert not _left(rough)


def test_two_channels_that_are_never_negative_are_no_magnitudes_of_each_other() -> None:
    a = np.abs(_RNG.standard_normal(200)) + 1
    assert not _left(_table(np.arange(200) / 100, a, a, names="t,a,b"))


def test_of_two_columns_that_count_the_first_from_one_is_the_counter() -> None:
    lines = contents_from_table(_table(np.arange(1.0, 301.0), 40 + 2 * np.arange(300.0), _H[:, 0]), {}).thing
    assert lines.frequencies[:2].tolist() == [40, 42]
    alone = contents_from_table(_table(np.arange(1.0, 301.0), _H[:, 0], names="f,H"), {}).thing
    assert alone.frequencies[:2].tolist() == [1, 2]


_COHERENCES = _RNG.uniform(0.9, 0.99, (300, 2))
_PARTS = (_H[:, 0].real, _H[:, 0].imag, _H[:, 1].real, _H[:, 1].imag)


@pytest.mark.parametrize(
    "columns",
    [
        (*_PARTS, *_COHERENCES.T),
        (*_PARTS[:2], _COHERENCES[:, 0], *_PARTS[2:], _COHERENCES[:, 1]),
        (*_PARTS[::2], *_PARTS[1::2]),
        (np.abs(_H[:, 0]), np.angle(_H[:, 0]), np.abs(_H[:, 1]), np.angle(_H[:, 1], deg=False), *_COHERENCES.T),
    ],
    ids=["coherences behind", "triples", "parts behind each other", "polar"],
)
def test_parts_and_coherences_without_names_are_found_by_their_places(columns: tuple[np.ndarray, ...]) -> None:
    found = contents_from_table(_table(_LINES, *columns), {}).thing
    assert isinstance(found, ms.FrequencyResponse)
    assert np.allclose(found.values[:, :, 0], _H)
    if len(columns) > 4:
        assert np.array_equal(found.coherence[:, :, 0], _COHERENCES)


def test_pairs_that_are_no_causal_responses_are_refused() -> None:
    spectra = np.abs(_RNG.uniform(0, 6.2, (300, 2)))  # the second might be angles by its size
    refused("complex values with its frequencies", contents_from_table, _table(_LINES, *spectra.T, names="Hz,a,b"), {})


def test_times_beside_frequencies_are_left() -> None:
    table = _table(_LINES, *_PARTS[:2], _LINES / 100, names="Frequency,H Real,H Imag,Time")
    assert _left(table) == {"column 4": "times beside frequencies"}


def test_a_magnitude_beside_parts_that_ends_early_cuts_nothing() -> None:
    size = np.abs(_H[:, 0])
    size[-5:] = np.nan
    table = _table(_LINES, *_PARTS[:2], size, names="Frequency,H Real,H Imag,|a|")
    assert len(contents_from_table(table, {}).thing.frequencies) == 300


def test_of_two_columns_of_times_the_one_without_holes_is_the_axis() -> None:
    second = np.arange(200) / 100
    second[-9:] = np.nan
    stamps = Column(number=1, name="Timestamp", values=1.6e9 + np.arange(200) / 100)
    others = (Column(number=2, values=_RNG.standard_normal(200)), Column(number=3, name="t2", unit="s", values=second))
    assert len(contents_from_table(Table(where="a", columns=(stamps, *others)), {}).thing.outputs) == 200


@pytest.mark.parametrize(("step", "asked"), [(0.199 / 299, False), (0.201 / 299, True)])
def test_no_band_of_lines_ends_below_a_fifth_of_a_hertz(step: float, asked: bool) -> None:
    held = weigh([Column(number=1, values=step * np.arange(300))])[1]
    assert bool(held.of("frequency") > 0) is asked


def test_a_record_that_may_be_lines_is_offered_with_the_force_that_others_follow() -> None:
    force = _RNG.standard_normal(600)
    decay = np.exp(-0.05 * np.arange(60)) * np.sin(0.7 * np.arange(60))
    answers = [np.convolve(force, scale * decay)[:600] for scale in (1.0, -0.7, 0.4)]
    columns = [Column(number=k, values=v) for k, v in enumerate((*answers[:2], force, answers[2]), 1)]
    assert (likeliest_force(columns)[0].number, likeliest_force(columns)[1]) == (3, True)
    assert not likeliest_force(columns[:2])[1]


def _struck() -> tuple[np.ndarray, np.ndarray]:
    """A hit, and what rings on from it."""
    hit = np.zeros(400)
    hit[50:54] = (1, 5, 4, 1)
    ring = np.convolve(hit, np.exp(-0.02 * np.arange(300)) * np.sin(0.5 * np.arange(300)))[:400]
    return hit, ring + 1e-3 * _RNG.standard_normal(400)


def test_a_short_motion_that_is_called_one_as_the_others_are_is_no_force() -> None:
    hit, ring = _struck()
    for names, forces in (("Acc 1,Acc 2", None), ("ch1,ch2", ("ch2",))):
        columns = [
            Column(number=k, name=n, values=v)
            for k, (n, v) in enumerate(zip(names.split(","), (ring, hit), strict=True), 1)
        ]
        record = contents_from_table(Table(where="a", columns=tuple(columns), rate=1e3), {}).thing
        assert record.input_dofs == (forces or ())


def test_a_hit_adds_to_a_name_of_a_force_in_an_odd_unit() -> None:
    hit, ring = _struck()
    columns = (Column(number=1, name="F", unit="g", values=hit), Column(number=2, name="m_1", unit="g", values=ring))
    record = contents_from_table(Table(where="a", columns=columns, rate=1e3), {}).thing
    assert record.input_dofs == ("F",)


_PULSE = """Header Size:\t 79\t 
Data Type:\t{form}\t 
X-Axis size:\t{rows}\t 
X-Axis unit:\t{unit}\t 
X-Axis first value:\t  {first:.10e}\t 
X-Axis delta:\t  {step:.10e}\t 
InputSampleFrequency:\t  2.6214400000e+05\t 
Signal:\t{signal}\t 
SignalUnit:\tm/s2\t 
Time:\t \t15:40:50:041
{body}
TagsBegin:\t \t 
OverLoad:\t \tFalse
TagsEnd:\t \t 
"""  # noqa: W291 - as the program writes it


def _pulse(path: Path, x: np.ndarray, *columns: np.ndarray, **words: str) -> Path:
    """Write a signal as PULSE LabShop does: a count of rows, the axis and the values, below keys with their colons."""
    rows = zip(x, *columns, strict=True)
    body = "\n".join(f"{k}\t  " + "\t ".join(f"{value: .10e}" for value in row) for k, row in enumerate(rows, 1))
    path.write_text(_PULSE.format(rows=len(x), first=x[0], step=x[1] - x[0], body=body, **words))
    return path


def test_an_axis_that_the_header_states_by_first_value_step_and_unit(tmp_path: Path) -> None:
    path = _pulse(
        tmp_path / "h.txt", 39 + _LINES, *_PARTS[:2], form="Complex", unit="Hz", signal="H1(Acc,Force) - Mark 1"
    )
    found = ms.read(path)
    assert isinstance(found, ms.FrequencyResponse)
    assert np.allclose(found.frequencies, 39 + _LINES)
    assert np.allclose(found.values[:, 0, 0], _H[:, 0])
    assert found.units[0] == ("m/s2",)
    times = np.arange(300) / 512
    record = ms.read(_pulse(tmp_path / "t.txt", times, _RNG.standard_normal(300), form="Real", unit="s", signal="Left"))
    assert isinstance(record, ms.Signals)
    assert record.sampling_rate == pytest.approx(512, rel=1e-9)
    spectrum = _pulse(tmp_path / "s.txt", _LINES, np.abs(_H[:, 0]), form="Real", unit="Hz", signal="Autospectrum(Acc)")
    refused("complex values with its frequencies", ms.read, spectrum)


def test_values_that_the_header_calls_complex_are_parts_whatever_they_are(tmp_path: Path) -> None:
    noise = _RNG.standard_normal((300, 2))
    path = _pulse(tmp_path / "n.txt", 39 + _LINES, *noise.T, form="Complex", unit="Hz", signal="Noise")
    assert np.allclose(ms.read(path).values[:, 0, 0], noise[:, 0] + 1j * noise[:, 1])


def test_text_that_is_said_to_be_measured_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Time,Acc,Comment\n" + "".join(f"{k / 100},{np.sin(k):.4f},word\n" for k in range(50)))
    refused("holds text", ms.read, path, columns="time=1,out=2-3")
    assert ms.read(path).outputs.shape == (50, 1)


def test_times_that_are_written_twice_are_a_clock_and_no_channel(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    times = np.r_[0.0, 0.002, np.arange(1, 300) * 0.002]
    path.write_text("".join(f"{t:.4f};{a:.5f}\n" for t, a in zip(times, _RNG.standard_normal(301), strict=True)))
    refused("evenly sampled times in column 1", ms.read, path)


def test_a_constant_in_seconds_is_no_axis() -> None:
    constant = Column(number=1, name="delay", unit="s", values=np.zeros(200))
    others = (
        Column(number=2, name="t", unit="s", values=np.arange(200) / 100),
        Column(number=3, values=_RNG.standard_normal(200)),
    )
    found = contents_from_table(Table(where="a", columns=(constant, *others)), {}).thing
    assert found.sampling_rate == 100


def test_no_record_is_offered_of_complex_values() -> None:
    notes = contents_from_table(_table(_LINES, _H[:, 0], _H[:, 1]), {}).notes
    assert any("taken as frequency in Hz" in note for note in notes)
    assert not any("--columns" in note for note in notes)


@pytest.mark.parametrize(
    ("names", "inputs"),
    [
        ("Input [m/s2],Floor 1 [m/s2],Floor 2 [m/s2]", 1),
        ("Anregung [mm],Spitze [m/s2],Mitte [m/s2]", 1),
        ("Input 1 [m/s2],Input 2 [m/s2],Input 3 [m/s2]", 0),  # inputs of the recorder
        ("Input 1 [N],Input 2 [m/s2],Floor [m/s2]", 1),  # the force
        ("Table [m/s2],Floor 1 [m/s2],Floor 2 [m/s2]", 0),
    ],
)
def test_a_motion_is_an_input_where_it_alone_is_called_so(tmp_path: Path, names: str, inputs: int) -> None:
    rows = np.column_stack([np.arange(200) / 100, np.random.default_rng(0).standard_normal((200, 3))])
    np.savetxt(tmp_path / "moved.csv", rows, delimiter=",", header=f"Time [s],{names}", comments="")
    data = ms.read(tmp_path / "moved.csv")
    assert len(data.input_dofs) == inputs
    assert not inputs or data.input_dofs[0] == names.split(" [")[0]


def test_a_spectrum_over_uneven_lines_is_not_offered_as_a_record(tmp_path: Path) -> None:
    f = np.arange(10, 4000, 1.0)  # above 1000 Hz by steps of 10, ten times each
    np.savetxt(tmp_path / "psd.txt", np.column_stack([f, 1 / f]), fmt="%.3g")
    said = refused("lines of a spectrum hold no phases", ms.read, tmp_path / "psd.txt")
    assert "--sampling-rate" not in said.args[0]
    noise = np.random.default_rng(0).standard_normal((4000, 2))
    np.savetxt(tmp_path / "noise.txt", noise)
    refused("sampling_rate=HZ", ms.read, tmp_path / "noise.txt")
