"""Files of recorders, through packages that are extras: the record of the ordinary files; a package that is missing is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from tests.io.ordinary import CHANNELS, RATE, TIMES
from tests.support import refused

NAMES = ("Force", "AccA", "AccB")
UNITS = ("N", "m/s2", "m/s2")


def is_the_record(record: Any) -> bool:
    assert record.sampling_rate == pytest.approx(RATE, rel=1e-9)
    assert record.input_dofs == ("Force",)
    assert record.output_dofs == NAMES[1:]
    assert record.units == (UNITS[1:], UNITS[:1])
    return np.allclose(record.outputs, CHANNELS[:, 1:]) and np.allclose(record.inputs, CHANNELS[:, :1])


def test_tdms_keeps_increment_and_units(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("run", name, values, properties={"wf_increment": 1 / RATE, "unit_string": unit})
        for name, values, unit in zip(NAMES, CHANNELS.T, UNITS, strict=True)
    ]
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment(channels)
    assert is_the_record(ms.read(tmp_path / "a.tdms"))
    again = [nptdms.ChannelObject("other", c.channel, 2 * c.data, properties=c.properties) for c in channels]
    with nptdms.TdmsWriter(str(tmp_path / "b.tdms")) as writer:
        writer.write_segment([*channels, *again])
    refused('--sheet "(run|other)" or --sheet', ms.read, tmp_path / "b.tdms")
    assert is_the_record(ms.read(tmp_path / "b.tdms", sheet="run"))
    (tmp_path / "c.tdms").write_bytes((tmp_path / "a.tdms").read_bytes()[:60])
    refused("damaged|no groups|no columns|needs", ms.read, tmp_path / "c.tdms")


def test_mdf_keeps_clock_and_units(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    signals = [
        asammdf.Signal(samples=values.copy(), timestamps=TIMES, name=name, unit=unit)
        for name, values, unit in zip(NAMES, CHANNELS.T, UNITS, strict=True)
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(tmp_path / "a.mf4", overwrite=True)
    assert is_the_record(ms.read(tmp_path / "a.mf4"))
    (tmp_path / "b.mf4").write_bytes(b"MDF     4.10" + bytes(50))
    refused("damaged", ms.read, tmp_path / "b.mf4")


def test_netcdf_keeps_units_and_time(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    data = xarray.Dataset(
        {
            "Force": ("time", CHANNELS[:, 0], {"units": "N"}),
            "Acc": (("time", "sensor"), CHANNELS[:, 1:], {"units": "m/s2"}),
        },
        coords={"time": TIMES, "sensor": ["A", "B"]},
    )
    data.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    record = ms.read(tmp_path / "a.nc")
    assert record.output_dofs == ("Acc A", "Acc B")
    assert np.array_equal(record.outputs, CHANNELS[:, 1:])
    again = ms.from_frame(data)
    assert np.array_equal(again.inputs, record.inputs)
    assert again.units == record.units == (("m/s2", "m/s2"), ("N",))
    (tmp_path / "b.nc").write_bytes((tmp_path / "a.nc").read_bytes()[:900])
    refused("damaged", ms.read, tmp_path / "b.nc")


def test_parquet_keeps_names(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    pandas = pytest.importorskip("pandas")
    heads = ["Time [s]", *(f"{name} [{unit}]" for name, unit in zip(NAMES, UNITS, strict=True))]
    pandas.DataFrame(np.column_stack([TIMES, CHANNELS]), columns=heads).to_parquet(tmp_path / "a.parquet")
    assert is_the_record(ms.read(tmp_path / "a.parquet"))
    (tmp_path / "b.parquet").write_bytes((tmp_path / "a.parquet").read_bytes()[:900])
    refused("damaged", ms.read, tmp_path / "b.parquet")


@pytest.mark.parametrize(
    ("suffix", "package", "extra"),
    [
        (".tdms", "nptdms", "tdms"),
        (".mf4", "asammdf", "mdf"),
        (".nc", "xarray", "netcdf"),
        (".parquet", "pyarrow", "parquet"),
        (".xlsx", "openpyxl", "excel"),
        (".msh", "meshio", "mesh"),
    ],
)
def test_a_package_that_is_missing_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, package: str, extra: str
) -> None:
    def without(name: str) -> Any:
        assert name.partition(".")[0] == package
        raise ImportError(name)

    monkeypatch.setattr("modalscope.numerics.errors.import_module", without)
    (tmp_path / f"a{suffix}").write_bytes(b"anything")
    refused(rf"pip install 'modalscope\[{extra}\]'", ms.read, tmp_path / f"a{suffix}")
