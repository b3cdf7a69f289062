"""Setups as a user has them: files of one structure, from the command line, together and apart."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.towers import Tower, tower
from modalscope.interfaces.cli import main
from modalscope.signals.preprocess.setups import joined_setups, significant_lags
from tests.studies import Study
from tests.support import stored_list


def as_files(built: Tower, folder: Path) -> list[str]:
    paths = [str(folder / f"setup{k:02d}.npz") for k in range(len(built.setups))]
    for path, record in zip(paths, built.setups, strict=True):
        ms.write(path, record)
    return paths


def paired(found: ms.ModalModel, true: ms.ModalModel) -> tuple[np.ndarray, np.ndarray]:
    """Return relative errors of the frequencies and the likeness of the shapes, mode by mode."""
    assert len(found) == len(true)
    return found.frequencies / true.frequencies - 1, np.diag(
        ms.mac(found.shapes, true.select(outputs=list(found.output_dofs)).shapes)
    )


@pytest.mark.slow
@pytest.mark.parametrize("how", [[], ["--apart"]])
def test_a_tower_in_four_setups_from_the_command_line(how: list[str], tmp_path: Path) -> None:
    built = tower(1, setups=4, minutes=20)
    out = tmp_path / "modes.json"
    assert main(["identify", *as_files(built, tmp_path), *how, "-q", "-o", str(out)]) == 0
    found = ms.read(out)
    away, alike = paired(found, built.modes)
    # the deviation of f / f, sqrt(zeta / (4 pi f T)), is .06 % of the slowest mode in 80 minutes
    assert np.abs(away).max() < 0.0025
    # a shape of 20 minutes a setup is good to some per cent of its size
    assert alike.min() > 0.95
    assert found.frequencies_repeatability is not None
    document = json.loads(out.read_text())["analysis"]
    assert len(document["files"]) == 4
    if how:  # joined ones take as long again; what repeats them is the same document
        assert np.array_equal(ms.replay(out).modes.poles, found.poles)


@pytest.mark.slow
def test_where_setups_are_not_refined_their_own_scatter_gives_the_intervals() -> None:
    """Five setups disagree by what they disagree."""
    built = tower(93000, setups=5, minutes=20)
    result = ms.analyze(built.setups, refine=False)
    modes, true = result.modes, built.modes
    assert modes.unrefined is None
    assert modes.frequencies_std is None
    assert np.all(modes.degrees == 4)
    assert not any("no standard deviation" in str(note) for note in result.notes)
    ends, nearest = modes.interval(), np.argmin(np.abs(modes.frequencies[:, None] - true.frequencies), axis=1)
    for name, values in (("frequency", true.frequencies), ("damping_ratio", true.damping_ratios)):
        held = (ends[name][:, 0] <= values[nearest]) & (values[nearest] <= ends[name][:, 1])
        assert held.sum() >= len(modes) - 2
    half = 2.776 * modes.frequencies_repeatability  # Student's quantile of four degrees of freedom
    assert np.ptp(ends["frequency"], axis=1) / 2 == pytest.approx(half, rel=1e-3)


@pytest.mark.study("ambient")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("how", [[], ["--apart"]])
def test_eleven_modes_of_a_tower_in_fifteen_setups(
    seed: int, how: list[str], tmp_path: Path, study: Callable[[str, str], Study]
) -> None:
    built = tower(seed, minutes=150)
    out = tmp_path / "modes.json"
    assert main(["identify", *as_files(built, tmp_path), *how, "-q", "-o", str(out)]) == 0
    away, alike = paired(ms.read(out), built.modes)
    ways = "each identified apart" if how else "joined"
    table = study(f"tower in 15 setups of 150 min, {ways}, structure {seed}", f"1 structure, seed {seed}")
    table.row("frequency errors of the 11 modes", 100 * np.abs(away), most=0.05, form=".2g", unit=" %")
    table.row("MAC of the 11 shapes", alike, least=0.99, form=".4f")
    assert not table.missed


def test_three_setups_of_the_building_give_its_nine_modes() -> None:
    exact = [2.63186, 2.69173, 3.43042, 8.29742, 8.42882, 10.6272, 14.0053, 14.093, 17.5741]
    # the integrator of the simulation lowers the highest by .6 %
    assert stored_list("building_3sl")["f"] == pytest.approx(exact, rel=0.007)


def test_own_rows_stay_as_they_were_measured_and_late_noise_is_left() -> None:
    built = tower(2, setups=2, minutes=10)
    setups = ms.merge(built.setups)
    joined = joined_setups(setups)
    parts = [ms.estimate_correlation(part) for part in built.setups]
    assert joined.samples < significant_lags(parts) < parts[0].samples
    assert joined.groups == ("setup 1",) * 4 + ("setup 2",) * 4
    assert joined.input_dofs[4] == "16:+X in setup 2"
    own = parts[0].values[: joined.samples]
    rows = [joined.output_dofs.index(dof) for dof in parts[0].output_dofs]
    kept = joined.values[:, rows, :4]
    assert kept / kept[0, 0, 0] == pytest.approx(own / own[0, 0, 0], rel=1e-9)


def test_setups_are_not_identified_apart_where_there_are_none(tmp_path: Path) -> None:
    record = tower(0, setups=1, minutes=1).setups[0]
    with pytest.raises(ms.DataError, match="there is Signals"):
        ms.analyze(record, apart=True)
