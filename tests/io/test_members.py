"""Cells and arrays of structures: what their members are together, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import modalscope as ms
from modalscope.io import survey
from modalscope.io.members import lists_of
from tests.io.ordinary import HITS, RATE, cells, structures


def test_runs_of_other_lengths_are_cut_as_the_message_says(tmp_path: Path) -> None:
    path = tmp_path / "runs.mat"
    savemat(path, {"fs": RATE, "runs": cells([HITS[0], HITS[1, :40], HITS[2]])})
    with pytest.raises(ms.DataError, match=r"(?s)40 to 50 samples.*rows='1-40'"):
        ms.read(path)
    assert ms.read(path, rows="1-40", columns="in=1").outputs.shape == (3, 40, 2)


def test_one_member_may_be_left_and_a_whole_list(tmp_path: Path) -> None:
    path = tmp_path / "runs.mat"
    savemat(path, {"fs": RATE, "runs": cells(list(HITS)), "other": cells([HITS[0], HITS[1]])})
    with pytest.raises(ms.DataError, match=r"ignore=\['other'\]"):
        ms.read(path)
    assert ms.read(path, ignore=["other"]).runs == 3
    assert ms.read(path, ignore=["other", "runs{2}"]).runs == 2


def test_vectors_become_columns_and_one_of_another_length_is_named(tmp_path: Path) -> None:
    path = tmp_path / "channels.mat"
    vectors = [HITS[0, :, k] for k in range(3)]
    savemat(path, {"fs": RATE, "acc": cells(vectors)})
    assert np.array_equal(ms.read(path).outputs, HITS[0])
    savemat(path, {"fs": RATE, "acc": cells([*vectors, np.ones(7)])})
    with pytest.raises(ms.DataError, match=r"(?s)7 to 50 entries, most of them 50.*ignore=\['acc\{4\}'\]"):
        ms.read(path)
    assert np.array_equal(ms.read(path, ignore="acc{4}").outputs, HITS[0])


def test_fields_of_channels_become_lists_of_texts_and_numbers() -> None:
    made = {
        "a(1).name": np.array("x"),
        "a(2).name": np.array("y"),
        "a(1).gain": np.array(2.0),
        "a(2).gain": np.array(3.0),
    }
    lists = lists_of("f.mat", made)
    assert lists is not None
    assert not lists.runs
    assert lists.arrays["a.name"].tolist() == ["x", "y"]
    assert lists.arrays["a.gain"].tolist() == [2.0, 3.0]
    same = lists_of("f.mat", {"a(1).t": np.arange(3.0), "a(2).t": np.arange(3.0)})
    assert same is not None
    assert same.arrays["a.t"].shape == (3,)


def test_runs_of_other_channels_or_rates_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "runs.mat"
    savemat(path, {"test": structures(fs=[RATE, 2 * RATE], acc=[HITS[0], HITS[1]])})
    with pytest.raises(ms.DataError, match="differ in sampling rate"):
        ms.read(path)
    savemat(path, {"fs": RATE, "runs": cells([HITS[0], HITS[1, :, :2]])})
    with pytest.raises(ms.DataError, match="differ in output dofs"):
        ms.read(path)


def test_lists_of_lists_and_responses_as_runs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep.mat"
    savemat(path, {"fs": RATE, "runs": cells([cells(list(HITS)), cells(list(HITS))])})
    with pytest.raises(ms.DataError, match=r"(?s)lists of lists.*ignore=\['runs'\]"):
        ms.read(path)
    lines = np.ones((60, 2)) * (1 + 1j)
    savemat(path, {"test": structures(f=[np.arange(1.0, 61.0)] * 2, H=[lines, lines])})
    with pytest.raises(ms.DataError, match="not all of them are records"):
        ms.read(path)


def test_a_member_that_is_empty_or_lacks_a_field_is_named_and_may_be_left_out(tmp_path: Path) -> None:
    path = tmp_path / "gap.mat"
    vectors = [HITS[0, :, 0], np.zeros((0, 0)), HITS[0, :, 2]]
    savemat(path, {"fs": RATE, "y": cells(vectors)})
    with pytest.raises(ms.DataError, match=r"(?s)y\{2\} is empty.*ignore=\['y\{2\}'\]"):
        ms.read(path)
    assert np.array_equal(ms.read(path, ignore="y{2}").outputs, HITS[0][:, [0, 2]])
    savemat(
        path, {"test": structures(fs=[RATE] * 3, force=[*HITS[:2, :, :1], np.zeros((0, 0))], acc=list(HITS[:, :, 1:]))}
    )
    with pytest.raises(ms.DataError, match=r"(?s)test\(3\) has no test.force.*ignore=\['test\(3\)'\]"):
        ms.read(path)
    assert ms.read(path, ignore="test(3)").runs == 2
    assert ms.read(path, ignore="test.force").inputs is None


def test_what_was_left_of_lists_is_told_and_fields_may_be_renamed(tmp_path: Path) -> None:
    path = tmp_path / "runs.mat"
    savemat(path, {"fs": RATE, "junk": np.ones(3), "runs": cells(list(HITS))})
    told = ms.io.survey(path, ignore=["runs{2}", "junk"])
    assert {part.part for part in told.left} == {"runs{2}", "junk"}
    savemat(path, {"test": structures(sampling_rate=[RATE] * 2, sig=[HITS[0], HITS[1]])})
    assert ms.read(path, rename={"test.sig": "outputs", "test.sampling_rate": "sampling_rate"}).outputs.shape == (
        2,
        50,
        3,
    )


def test_names_with_brackets_are_lists_in_files_of_matlab_alone_and_counts_are_no_axis(tmp_path: Path) -> None:
    np.savez(tmp_path / "plain.npz", **{"sampling_rate": RATE, "acc(1)": HITS[0]})
    assert ms.read(tmp_path / "plain.npz", rename={"acc(1)": "outputs"}).runs == 1
    whole = np.abs(HITS[:2] * 100).astype(np.uint16)
    savemat(tmp_path / "counts.mat", {"fs": RATE, "test": structures(a=list(whole[:, :, 0]), b=list(whole[:, :, 1]))})
    assert ms.read(tmp_path / "counts.mat").outputs.shape == (2, 50, 2)


def test_names_and_units_of_channels_beside_runs_are_those_of_all(tmp_path: Path) -> None:
    path = tmp_path / "runs.mat"
    channels = structures(name=["Force", "A", "B"], unit=["N", "g", "g"])
    for count in (2, 3):  # three runs of three channels are no names one a run
        savemat(path, {"fs": RATE, "runs": cells(list(HITS[:count])), "channels": channels})
        record = ms.read(path)
        assert (record.runs, record.output_dofs, record.input_dofs) == (count, ("A", "B"), ("Force",))
        assert record.units == (("g", "g"), ("N",))


def test_what_is_measured_for_each_run_goes_with_it(tmp_path: Path) -> None:
    path = tmp_path / "runs.mat"
    forces = cells(list(HITS[:, :, 0]))
    savemat(path, {"fs": cells([RATE] * 3), "force": forces, "acc": cells(list(HITS[:, :, 1:]))})
    record = ms.read(path)
    assert (record.runs, record.sampling_rate) == (3, RATE)
    assert np.array_equal(record.inputs[:, :, 0], HITS[:, :, 0])
    savemat(path, {"fs": RATE, "force": forces, "acc": cells(list(HITS[:2, :, 1:]))})
    with pytest.raises(ms.DataError, match=r"(?s)force 1, 2, 3; acc 1, 2.*ignore=\['force'\]"):
        ms.read(path)


def test_channels_of_other_times_or_rates_are_told(tmp_path: Path) -> None:
    path = tmp_path / "channels.mat"
    vectors, times = cells([HITS[0, :, 0], HITS[0, :, 1]]), np.arange(50) / RATE
    savemat(path, {"t": cells([times, times + 1.5]), "y": vectors})
    with pytest.raises(
        ms.DataError, match=r"(?s)times differ: t begins with 0, 1\.5.*ignore=\['t'\], sampling_rate=HZ"
    ):
        ms.read(path)
    assert ms.read(path, ignore="t", sampling_rate=RATE).outputs.shape == (50, 2)
    savemat(path, {"fs": cells([RATE, 2 * RATE]), "y": vectors})
    with pytest.raises(ms.DataError, match=r"(?s)rates differ: fs is .*ignore=\['fs'\], sampling_rate=HZ"):
        ms.read(path)
    assert ms.read(path, ignore="fs", sampling_rate=RATE).outputs.shape == (50, 2)
    lines = [np.ones(50) * (1 + 1j), np.ones(50) * (2 + 1j)]
    savemat(path, {"f": cells([np.arange(1.0, 51), np.arange(2.0, 52)]), "H": cells(lines)})
    with pytest.raises(ms.DataError, match="frequencies differ: f begins with 1, 2, and ends with 50, 51"):
        ms.read(path)


@pytest.mark.parametrize("labels", [("run1", "run2"), ("Test_3", "Test_4"), ("exp01", "exp02")])
def test_arrays_that_are_called_runs_are_asked_for(tmp_path: Path, labels: tuple[str, str]) -> None:
    path = tmp_path / "runs.mat"
    acc = np.random.default_rng(1).standard_normal((2, 300, 3))
    savemat(path, {f"acc_{label}": values for label, values in zip(labels, acc, strict=True)} | {"fs": RATE})
    with pytest.raises(ms.DataError, match=f"sheet='{labels[0]}' or sheet='{labels[1]}'"):
        ms.read(path)
    np.testing.assert_array_equal(ms.read(path, sheet=labels[1]).outputs, acc[1])
    savemat(path, {"acc_1": acc[0], "acc_2": acc[1], "fs": RATE})  # channels of two sensors
    assert ms.read(path).outputs.shape == (300, 6)


@pytest.mark.parametrize(("rows", "asked"), [(299, True), (300, False)])
def test_structures_of_several_channels_are_tests_where_their_lengths_differ(
    tmp_path: Path, rows: int, asked: bool
) -> None:
    path = tmp_path / "two.mat"
    acc = np.random.default_rng(1).standard_normal((2, 300, 3))
    held = [{"t": np.arange(n) / RATE, "acc": a[:n]} for n, a in zip((300, rows), acc, strict=True)]
    savemat(path, {"deck": held[0] | {"names": "acc"}, "tower": held[1]})  # texts may differ
    if not asked:  # triaxial sensors of one test, or specimens: it is said, and one can be taken
        assert ms.read(path).outputs.shape == (300, 6)
        assert "taken as sensors of one test; if tests: --test deck" in " ".join(survey(path).notes)
        np.testing.assert_array_equal(ms.read(path, sheet="tower").outputs, acc[1])
        with pytest.raises(ms.DataError, match="its experiments are deck, tower"):
            ms.read(path, sheet="roof")
        return
    with pytest.raises(ms.DataError, match="sheet='deck' or sheet='tower'"):
        ms.read(path)
    np.testing.assert_array_equal(ms.read(path, sheet="tower").outputs, acc[1, :rows])
