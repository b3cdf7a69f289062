"""Files of one test: the user's labels of places stay, and a file that cannot be used is left out by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.sources import opened
from modalscope.interfaces.cli import main
from modalscope.systems import chain5
from tests.signals.doctor.test_places import hits


def written(folder: Path, *records: ms.Signals) -> list[Path]:
    paths = [folder / f"point{k + 1}.npz" for k in range(len(records))]
    for path, record in zip(paths, records, strict=True):
        ms.write(path, record)
    return paths


def told(notes: tuple[ms.data.Note, ...]) -> str:
    return "; ".join(note.text for note in notes)


def test_labels_of_places_that_a_user_gives_stay(tmp_path: Path) -> None:
    paths = written(tmp_path, hits(0), hits(2), hits(4))
    data, sources, notes = opened(paths, {})
    assert (data.input_dofs, len(sources)) == (("point1", "point2", "point3"), 3)
    assert "names of the files say, inputs point1, point2, point3 (amplitudes at" in told(notes)
    data, _, notes = opened(paths, {"input_dofs": ["P"]})
    assert (data.input_dofs, data.runs) == (("P",), 6)
    assert "3 files named 'P' are averaged as one place, but amplitudes at" in told(notes)
    data, _, notes = opened(paths, [{"input_dofs": [label]} for label in "abc"])
    assert (data.input_dofs, notes) == (("a", "b", "c"), ())


def test_hits_on_one_place_are_averaged_unless_the_user_says_otherwise(tmp_path: Path) -> None:
    paths = written(tmp_path, *(hits(0, seed=k) for k in range(3)))
    data, _, notes = opened(paths, {})
    assert (len(data.input_dofs), data.runs) == (1, 6)
    assert "If places: --input-dofs point1 point2 point3" in told(notes)
    data, _, notes = opened(paths, [{"input_dofs": [label]} for label in "123"])
    assert data.input_dofs == ("1", "2", "3")
    assert "3 drive points as asked, but amplitudes at" in told(notes)


def test_a_file_without_a_hit_is_left_out_by_name(tmp_path: Path) -> None:
    first = hits(0)
    silent = 1e-3 * np.random.default_rng(0).standard_normal(first.by_run()[1].shape)
    empty = ms.Signals(outputs=first.outputs, inputs=silent, sampling_rate=first.sampling_rate)
    paths = written(tmp_path, first, empty, hits(0, seed=1))
    data, sources, notes = opened(paths, {})
    assert (data.runs, len(sources)) == (4, 3)
    assert "point2: left out, no usable hit" in told(notes)
    assert "--input-dofs 1 2 3" in told(notes)  # the file that is left out has a label, too


@pytest.mark.slow
def test_remedies_that_are_printed_read_the_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [*map(str, written(tmp_path, *(hits(0, seed=k) for k in range(3))))]
    few = ["--orders", "10:20:5", "--no-refine", "-o", str(tmp_path / "modes.json")]
    assert main(["identify", *paths, *few]) == 0
    assert "If places: --input-dofs point1 point2 point3" in capsys.readouterr().out
    assert main(["identify", *paths, "--input-dofs", "1", "2", "3", *few]) == 0
    assert "as those of one place" in capsys.readouterr().out
    assert main(["identify", *paths, "--input-dofs", "in1", *few]) == 0
    assert "places" not in capsys.readouterr().out


def test_a_force_that_never_changes_is_left_out_whatever_the_route() -> None:
    driven = chain5().simulate(inputs="white", duration=20, sampling_rate=20.0, seed=0)
    resting = replace(driven, inputs=np.ones((400, 2)))
    for data in (resting, ms.Records(runs=(resting, resting))):
        alone, _, notes = opened(data, {})
        assert alone.input_dofs == ()
        assert [note.kind for note in notes] == ["dead force"]
