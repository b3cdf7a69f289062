"""Files of one test: read by the evidence of all, on the lines that all have, what differs named by file, with options that work."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.sources import opened
from modalscope.interfaces.cli import main
from modalscope.signals.doctor.places import label_by_place
from modalscope.signals.doctor.responses import without_offset
from modalscope.signals.doctor.together import as_one_event, from_its_start, on_common_lines

_RNG = np.random.default_rng(4)
F = np.arange(1.0, 801)
MODES = ((60, 0.01), (170, 0.008), (410, 0.006))


def _response(x: float) -> np.ndarray:
    shapes = np.sin(np.pi * x * np.arange(1, 4))
    values = sum(a * 0.8 * F**2 / (f**2 - F**2 + 2j * z * f * F) for a, (f, z) in zip(shapes, MODES, strict=True))
    return np.asarray(values + 1e-3 * (_RNG.standard_normal(F.size) + 1j * _RNG.standard_normal(F.size)))


H = [_response(x) for x in (0.13, 0.31, 0.42, 0.66)]


def _table(path: Path, head: str, f: np.ndarray, values: np.ndarray) -> Path:
    rows = (f"{a:.4f}\t{b.real:.6e}\t{b.imag:.6e}" for a, b in zip(f, values, strict=True))
    path.write_text("\n".join([*([head] if head else []), *rows]) + "\n")
    return path


def test_a_file_that_is_doubtful_by_itself_is_read_as_its_brothers_are(tmp_path: Path) -> None:
    doubtful = H[3] * np.exp(2j * np.pi * _RNG.random(F.size))  # no causal response: noise
    files = [_table(tmp_path / f"P{k}.txt", "", F, h) for k, h in enumerate((*H[:3], doubtful))]
    with pytest.raises(ms.DataError, match="sampling_rate=HZ"):
        ms.read(files[3])
    merged, sources, _ = opened(files, {})
    assert isinstance(merged, ms.FrequencyResponse)
    assert sources[3].reading == {"content": "response"}  # so that a replay reads it so, too
    again, _, _ = opened(files, [source.reading for source in sources])
    np.testing.assert_array_equal(again.values, merged.values)


@pytest.mark.parametrize("lost", [2, 40])
def test_lines_that_nearly_agree_are_merged_on_what_all_have(lost: int, tmp_path: Path) -> None:
    cuts = (slice(None), slice(lost, None), slice(None, -lost))
    files = [
        _table(tmp_path / f"P{k}.txt", "f (Hz)\tRe\tIm", F[cut], h[cut])
        for k, (cut, h) in enumerate(zip(cuts, H, strict=False))
    ]
    merged, _, notes = opened(files, {})
    np.testing.assert_array_equal(merged.frequencies, F[lost:-lost])
    assert any("that all have are taken" in note.text and f"P0 {2 * lost}" in note.text for note in notes)


def test_lines_with_little_in_common_are_no_test(tmp_path: Path) -> None:
    parts = [
        ms.FrequencyResponse(values=H[0][cut, None, None], frequencies=F[cut])
        for cut in (slice(0, 500), slice(400, 800))
    ]
    assert on_common_lines(parts, ["a", "b"]) == (parts, ())
    other = ms.FrequencyResponse(values=H[0][:, None, None], frequencies=1.3 * F)
    assert on_common_lines([parts[0], other], ["a", "b"])[1] == ()


def _exported(path: Path, k: int, unit: str) -> Path:
    head = "Data Type:\tComplex\nX-Axis unit:\tHz\nX-Axis first value:\t1\nX-Axis delta:\t1\n"
    head += f"AmplitudeUnit:\t({unit})/N\nRef_Signal:\thammer\nSignal:\tACC{k}"
    return _table(path, head, F, H[k])


def test_a_sensor_left_in_volts_is_named_with_options_that_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [_exported(tmp_path / f"M{k}.txt", k, "V" if k == 2 else "m/s2") for k in range(4)]
    with pytest.raises(ms.DataError, match=r"3 of 4 files are in m/s2/N, others not: M2 \(V/N\)") as error:
        opened(files, {})
    ways = re.findall(r'--units "[^"]+"|--quantity \w+', error.value.change)
    assert len(ways) == 2
    for way in ways:
        capsys.readouterr()
        assert main(["info", *map(str, files), *shlex.split(way)]) == 0
        assert (
            "together: frequency responses (acceleration): 800 lines from 1 to 800 Hz, 4 outputs, 1 input"
            in capsys.readouterr().out
        )


def test_many_files_alike_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [_exported(tmp_path / f"M{k}.txt", k % 4, "m/s2") for k in range(4)]
    files += [_table(tmp_path / f"N{k}.txt", "f (Hz)\tRe\tIm", F, H[k]) for k in (0,)]
    for copy in range(3):
        files.append(_exported(tmp_path / f"O{copy}.txt", copy, "m/s2"))
    main(["info", *map(str, files[:4]), *map(str, files[5:])])
    assert "7 files alike (M0.txt to O2.txt): frequency responses (acceleration)" in capsys.readouterr().out


def test_channels_of_one_event_are_named_after_their_files_and_repeats_are_not() -> None:
    event = np.cumsum(_RNG.standard_normal(4000)) * np.hanning(4000)
    made = [
        ms.Signals(
            outputs=(event + 0.1 * _RNG.standard_normal(4000))[:, None], sampling_rate=100.0, output_dofs=["col1"]
        )
        for _ in range(3)
    ]
    named, notes = as_one_event(made, ["A", "B", "C"], [0.0] * 3)
    assert [part.output_dofs for part in named] == [("A",), ("B",), ("C",)]
    assert notes
    (said,) = as_one_event(made, ["run1", "run2", "run3"], [0.0] * 3, runs=True)[1]
    assert said.text == "3 files of one channel, taken as its runs; if sensors of one event: --output-dofs 1 2 3"
    alone = [
        ms.Signals(outputs=_RNG.standard_normal((4000, 1)), sampling_rate=100.0, output_dofs=["col1"]) for _ in range(3)
    ]
    assert as_one_event(alone, ["A", "B", "C"], [0.0] * 3)[1] == (said,)
    clocks = [replace(part, sampling_rate=100 + 0.001 * k) for k, part in enumerate(alone)]
    runs, (told,) = as_one_event(clocks, ["A", "B", "C"], [0.0] * 3)
    assert {run.sampling_rate for run in runs} == {100.001}  # runs of recorders with clocks of their own
    assert "taken as its runs at 100.001 Hz; if sensors" in told.text
    named = [replace(part, output_dofs=[name]) for part, name in zip(alone, "ABC", strict=True)]
    assert as_one_event(named, ["A", "B", "C"], [0.0] * 3)[1] == ()


def test_files_of_one_name_are_named_after_their_folders(tmp_path: Path) -> None:
    motion = np.cumsum(_RNG.standard_normal(4000)) * np.hanning(4000)
    files = [tmp_path / sensor / "000.CSV" for sensor in ("deck", "pier")]
    for file in files:
        file.parent.mkdir()
        rows = np.c_[np.arange(4000) / 100, motion + 0.1 * _RNG.standard_normal(4000)]
        np.savetxt(file, rows, fmt="%.6f", delimiter=",")
    assert opened(files, {})[0].output_dofs == ("deck", "pier")


def _recorder(path: Path, k: int, begin: float, millionths: float) -> Path:
    """Write what a recorder with a clock of its own takes of one motion."""
    own = 1.7e9 + begin + np.arange(6000) / 100 * (1 + 1e-6 * millionths)
    y = sum(np.sin(2 * np.pi * f * (own - 1.7e9) + f * f) * (1 + k * f) for f in (1.3, 2.1, 4.7)) + 0.01 * k
    path.write_text("t [s],acc [m/s2]\n" + "".join(f"{a:.5f},{b:.6e}\n" for a, b in zip(own, y, strict=True)))
    return path


def test_recorders_with_clocks_of_their_own_are_one_record_and_their_drift_is_said(tmp_path: Path) -> None:
    clocks = ((0.0, 0.0), (0.5, 40.0), (0.137, -60.0))
    files = [_recorder(tmp_path / f"node{k}.csv", k, *clock) for k, clock in enumerate(clocks)]
    merged, _, notes = opened(files, {})
    assert merged.output_dofs == ("node0", "node1", "node2")
    assert "node0 +0, node1 +40, node2 -60; starts differ by 0.5 s" in " ".join(map(str, notes))
    y = merged.outputs - merged.outputs.mean(axis=0)
    shapes = np.fft.rfft(y * np.hanning(len(y))[:, None], axis=0)[
        np.round(np.array((1.3, 2.1)) * len(y) / 100).astype(int)
    ]
    ratios = shapes[:, 1:] / shapes[:, :1]  # of one motion at one time: no phase between sensors
    assert np.abs(np.angle(ratios)).max() < 2e-3
    parts = [merged.select(outputs=[k]) for k in (0, 1)]
    assert as_one_event(parts, ["a", "b"], [1.7e9, 1.7e9 + 50])[1] == ()  # they share less than half


def test_files_of_several_structures_are_asked_about_and_those_of_one_are_not() -> None:
    def test_of(f: np.ndarray, gains: np.ndarray) -> ms.FrequencyResponse:
        lines = F[:, None]
        H = np.sum(gains * lines**2 / (f**2 - lines**2 + 0.016j * f * lines), axis=1)
        noise = 1e-3 * (_RNG.standard_normal(F.size) + 1j * _RNG.standard_normal(F.size))
        return ms.FrequencyResponse(values=(H + noise)[:, None, None], frequencies=F, quantity="acceleration")

    usual = np.array([60.0, 130.0, 240.0, 380.0, 610.0])
    gains = np.array([[1.0, -0.8, 0.6, 1.1, 0.9], [0.7, 1.2, -0.9, 0.5, 1.0], [1.3, 0.5, 0.8, -0.7, 1.1]])
    for spread, asked in ((0.003, False), (0.1, True)):
        parts = [test_of(usual * (1 + spread * np.roll([-1, 0.5, 1, -0.4, 0.2], k)), g) for k, g in enumerate(gains)]
        named, notes = label_by_place(parts, ["a", "b", "c"])
        assert [part.input_dofs for part in named] == [("a",), ("b",), ("c",)]
        assert ("if structures of their own (two files have" in str(notes[0])) == asked


def test_a_record_begins_where_its_recorder_does() -> None:
    y = _RNG.standard_normal((4000, 3))
    started = y.copy()
    started[:32, 1:] = -250.0
    cut, notes = from_its_start(ms.Signals(outputs=started, sampling_rate=2000.0))
    np.testing.assert_array_equal(cut.outputs, y[32:])
    assert "First 32 samples (16 ms)" in notes[0].text
    # a hit at the beginning, a channel that stands still within its range, and a long rest are motion
    hit, within, long = y.copy(), y.copy(), y.copy()
    hit[:6, 0] = (900, 700, 400, -200, 90, 40)
    within[:40, 0] = 2.0
    long[:200, 0] = -250.0
    for other in (y, hit, within, long):
        assert from_its_start(ms.Signals(outputs=other, sampling_rate=2000.0))[1] == ()


def test_whether_a_record_is_a_decay_is_asked_without_the_channels_that_are_excluded() -> None:
    t = np.arange(4000) / 200
    decay = np.stack([np.exp(-0.3 * t) * np.sin(2 * np.pi * f * t) for f in (4.0, 7.0)], 1)
    noisy = ms.Signals(outputs=np.column_stack([decay, _RNG.standard_normal(t.size)]), sampling_rate=200.0)
    assert isinstance(opened(noisy, {}, decays=True)[0], ms.Signals)
    found, _, notes = opened(noisy, {}, decays=True, exclude=("y3",))
    assert isinstance(found, ms.ImpulseResponse)
    assert any("free decay" in note.text for note in notes)
    modes = ms.analyze(noisy, exclude="y3").modes
    np.testing.assert_allclose(modes.frequencies, [4.0, 7.0], rtol=1e-3)


@pytest.mark.parametrize(("offset", "left"), [(29.0, 0), (31.0, 1)])
def test_an_offset_of_sensors_is_no_line_of_a_response(offset: float, left: int) -> None:
    response = ms.systems.chain5().frequency_response(np.linspace(0, 10, 400), quantity="displacement")
    values = np.array(response.values)
    values[0] = offset * values[1]
    cut, notes = without_offset(replace(response, values=values))
    assert len(cut.frequencies) == 400 - left
    assert [note.kind for note in notes] == ["offset"] * left
    free = (
        values / np.maximum(response.frequencies, 0.005)[:, None, None] ** 2
    )  # as rigid motion rises, but for the first line
    assert without_offset(replace(response, values=free, frequencies=response.frequencies + 1.0))[1] == ()


def test_a_force_in_a_file_of_its_own_is_the_input_by_the_name_of_the_file_or_by_the_option_that_is_printed(
    tmp_path: Path,
) -> None:
    force = np.random.default_rng(0).standard_normal(2000)
    moved = np.convolve(force, np.exp(-0.01 * np.arange(400)) * np.sin(0.3 * np.arange(400)))[:2000]

    def files(*names: str) -> list[Path]:
        made = [tmp_path / f"{name}.txt" for name in names]
        for path, values in zip(made, (force, moved), strict=True):
            path.write_text("".join(f"{k / 100:.2f} {value:.6f}\n" for k, value in enumerate(values)))
        return made

    named, _, notes = opened(files("hammer", "top"), {})
    assert (named.input_dofs, named.output_dofs) == (("hammer",), ("top",))
    np.testing.assert_allclose(named.inputs[:, 0], force, atol=1e-6)
    (said,) = [note.text for note in notes if "names of their files" in note.text]
    assert said == "Inputs by the names of their files: hammer. If they are sensors: --output-dofs 1 2"
    as_said, _, _ = opened(files("hammer", "top"), [{"output_dofs": ["1"]}, {"output_dofs": ["2"]}])
    assert as_said.inputs is None
    bare, _, notes = opened(files("one", "two"), {})
    assert bare.inputs is None
    (said,) = [note.text for note in notes if "If one is" in note.text]
    assert said == 'No file is a force by its name or unit: all are outputs. If one is: --units "one=N"'
    assert not any("--columns" in note.text for note in notes)  # of one channel it would say nothing
    told, _, _ = opened(files("one", "two"), {"units": {"one": "N"}})
    assert (told.input_dofs, told.units) == (("one",), (("",), ("N",)))
    np.testing.assert_array_equal(told.outputs, named.outputs)
