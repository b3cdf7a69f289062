"""NetCDF data sets of modes: by the names of their variables and axes, in any order of these."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modalscope.analysis.monitoring import read_covariates, read_history
from modalscope.data import DataError

h5py = pytest.importorskip("h5py")

F = np.array([[1.0, 2.0], [np.nan, 2.1], [1.1, 2.2]])


def written(
    path: Path, axes: dict[str, tuple[str, ...]], units: str = "hours since 2026-06-01 00:00:00", **values: Any
) -> Path:
    """Write variables with named axes, as netCDF 4 does."""
    with h5py.File(path, "w") as file:
        for name, array in values.items():
            file[name] = array
        sizes = {axis: np.shape(values[name])[k] for name, names in axes.items() for k, axis in enumerate(names)}
        for axis, size in sizes.items():
            if axis not in file:
                file[axis] = np.arange(size)
            file[axis].make_scale(axis)
        for name, names in axes.items():
            for k, axis in enumerate(names):
                if axis != name:
                    file[name].dims[k].attach_scale(file[axis])
        file["time"].attrs["units"] = units
    return path


def test_modes_are_read_whatever_the_order_of_axes_and_times(tmp_path: Path) -> None:
    shapes = np.arange(12.0).reshape(3, 2, 2) * (1 + 1j)
    axes = {"frequencies": ("mode", "time"), "damping": ("mode", "time"), "modeshapes": ("channels", "time", "mode")}
    given = {"frequencies": F.T, "damping": F.T / 100, "modeshapes": np.moveaxis(shapes, 2, 0)}
    labels = np.array([b"east", b"north"], dtype=object)
    path = written(tmp_path / "a.nc", axes, time=[2, 0, 1], channels=labels, **given)
    found = read_history(path)
    assert found.frequencies.tolist() == [2.1, 1.1, 2.2, 1.0, 2.0]
    assert found.record.tolist() == [0, 1, 1, 2, 2]
    assert str(found.times[0]) == "2026-06-01T00:00:00.000"
    assert found.output_dofs == ("east", "north")
    assert np.array_equal(found.shapes[0], shapes[1, 1])
    assert np.isnan(found.frequencies_std).all()


@pytest.mark.slow
def test_damping_in_per_cent_is_told_by_its_unit_or_its_values(tmp_path: Path) -> None:
    """A median of 20 % of critical damping is the limit."""
    axes = {"frequencies": ("time", "mode"), "damping": ("time", "mode")}
    for value, ratio in ((0.19, 0.19), (0.21, 0.0021)):
        path = written(tmp_path / f"{value}.nc", axes, time=[0, 1, 2], frequencies=F, damping=np.full((3, 2), value))
        found = read_history(path)
        assert np.allclose(found.damping_ratios, ratio)
        assert len(found.notes) == (value > 0.2)
        assert np.allclose(read_history(path, damping="ratio").damping_ratios, value)
        with h5py.File(path, "a") as file:
            file["damping"].attrs["units"] = "%"
        found = read_history(path)
        assert np.allclose(found.damping_ratios, value / 100)
        assert found.notes == ()


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    axes = {"frequencies": ("time", "mode")}
    path = written(tmp_path / "a.nc", axes, units="o'clock", time=[0, 1, 2], frequencies=F)
    with pytest.raises(DataError, match='their unit is "o\'clock"'):
        read_history(path)
    with pytest.raises(DataError, match="it has no time, or no frequencies"):
        read_history(written(tmp_path / "b.nc", {"values": ("time",)}, time=[0, 1, 2], values=[1.0, 2, 3]))
    with pytest.raises(DataError, match="there is no such file"):
        read_history(tmp_path / "nowhere.nc")
    (tmp_path / "c.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(200))
    with pytest.raises(DataError):
        read_history(tmp_path / "c.nc")


def test_covariates_are_those_of_a_statistic_or_all_along_time(tmp_path: Path) -> None:
    axes = {"mean": ("time", "channels"), "rms": ("time", "channels")}
    given = {"mean": np.arange(6.0).reshape(3, 2), "rms": np.ones((3, 2))}
    path = written(tmp_path / "a.nc", axes, time=[0, 1, 2], channels=np.array([b"t1", b"t2"], dtype=object), **given)
    times, values = read_covariates(path)
    assert np.diff(times)[0] == np.timedelta64(1, "h")
    assert {name: x.tolist() for name, x in values.items()} == {"t1": [0, 2, 4], "t2": [1, 3, 5]}
    assert read_covariates(path, statistic="rms")[1]["t1"].tolist() == [1, 1, 1]
    path = written(tmp_path / "b.nc", {"wind": ("time",)}, time=[0, 1, 2], wind=[1.0, 2.0, 3.0])
    assert read_covariates(path)[1]["wind"].tolist() == [1, 2, 3]
