"""Files of recorders, through packages that are extras: the record of the ordinary files; a package that is missing is named."""

from __future__ import annotations

import gc
import re
import zipfile
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import survey
from tests.io import ordinary
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


def write_tdms(path: Path, *groups: str) -> None:
    """Write the record once a group; so do the others, which write what a package writes."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject(group, name, values, properties={"wf_increment": 1 / RATE, "unit_string": unit})
                for group in groups or ("run",)
                for name, values, unit in zip(NAMES, CHANNELS.T, UNITS, strict=True)
            ]
        )


def write_mdf(path: Path, version: str = "4.10") -> None:
    asammdf = pytest.importorskip("asammdf")
    signals = [
        asammdf.Signal(samples=values.copy(), timestamps=TIMES, name=name, unit=unit)
        for name, values, unit in zip(NAMES, CHANNELS.T, UNITS, strict=True)
    ]
    with asammdf.MDF(version=version) as file:
        file.append(signals)
        file.save(path, overwrite=True)


def dataset() -> Any:
    xarray = pytest.importorskip("xarray")
    return xarray.Dataset(
        {
            "Force": ("time", CHANNELS[:, 0], {"units": "N"}),
            "Acc": (("time", "sensor"), CHANNELS[:, 1:], {"units": "m/s2"}),
        },
        coords={"time": TIMES, "sensor": ["A", "B"]},
    )


def write_netcdf(path: Path, engine: str = "h5netcdf") -> None:
    pytest.importorskip(engine)
    dataset().to_netcdf(path, engine=engine)


def write_parquet(path: Path) -> None:
    pytest.importorskip("pyarrow")
    pandas = pytest.importorskip("pandas")
    heads = ["Time [s]", *(f"{name} [{unit}]" for name, unit in zip(NAMES, UNITS, strict=True))]
    pandas.DataFrame(np.column_stack([TIMES, CHANNELS]), columns=heads).to_parquet(path)


def write_mesh(path: Path, **options: Any) -> None:
    meshio = pytest.importorskip("meshio")
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], float)
    meshio.Mesh(points, [("triangle", [[0, 1, 2], [0, 2, 3]])]).write(path, **options)


def test_tdms_keeps_increment_and_units(tmp_path: Path) -> None:
    write_tdms(tmp_path / "a.tdms")
    assert is_the_record(ms.read(tmp_path / "a.tdms"))
    write_tdms(tmp_path / "b.tdms", "run", "other")
    refused("sheet='(run|other)' or sheet=", ms.read, tmp_path / "b.tdms")
    assert is_the_record(ms.read(tmp_path / "b.tdms", sheet="run"))
    (tmp_path / "c.tdms").write_bytes((tmp_path / "a.tdms").read_bytes()[:60])
    refused("damaged|no groups|no columns|needs", ms.read, tmp_path / "c.tdms")


def test_mdf_keeps_clock_and_units(tmp_path: Path) -> None:
    write_mdf(tmp_path / "a.mf4")
    assert is_the_record(ms.read(tmp_path / "a.mf4"))
    (tmp_path / "b.mf4").write_bytes(b"MDF     4.10" + bytes(50))
    refused("damaged", ms.read, tmp_path / "b.mf4")


@pytest.mark.slow
def test_netcdf_keeps_units_and_time(tmp_path: Path) -> None:
    write_netcdf(tmp_path / "a.nc")
    record = ms.read(tmp_path / "a.nc")
    assert record.output_dofs == ("Acc A", "Acc B")
    assert np.array_equal(record.outputs, CHANNELS[:, 1:])
    again = ms.from_frame(dataset())
    assert np.array_equal(again.inputs, record.inputs)
    assert again.units == record.units == (("m/s2", "m/s2"), ("N",))
    (tmp_path / "b.nc").write_bytes((tmp_path / "a.nc").read_bytes()[:900])
    refused("damaged", ms.read, tmp_path / "b.nc")


@pytest.mark.slow
def test_modes_in_a_netcdf_file_are_refused_as_what_they_are_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    xarray = pytest.importorskip("xarray")
    f = np.sort(np.random.default_rng(0).random((30, 4)), axis=1)
    sides = ("time", "mode")
    xarray.Dataset({"frequency": (sides, f), "damping": (sides, 0.01 * f)}).to_netcdf(
        tmp_path / "a.nc", engine="h5netcdf"
    )
    monkeypatch.setattr("modalscope.io.apart.run_apart", lambda *_: pytest.fail("its numbers were read"))
    refused("it holds modes, by its 'damping'", ms.read, tmp_path / "a.nc")


@pytest.mark.filterwarnings("error")
def test_a_damaged_netcdf_file_prints_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_netcdf(tmp_path / "a.nc")
    whole = (tmp_path / "a.nc").read_bytes()
    (tmp_path / "b.nc").write_bytes(whole[:20] + whole[:50] + whole[20:])
    refused("reading b.nc .*damaged", ms.read, tmp_path / "b.nc")
    gc.collect()
    assert capfd.readouterr().err == ""


@pytest.mark.filterwarnings("error")
def test_a_workbook_with_a_damaged_name_is_read_without_a_warning(tmp_path: Path) -> None:
    ordinary.CASES["a workbook with units and a title"].write(tmp_path / "a.xlsx")
    with zipfile.ZipFile(tmp_path / "a.xlsx") as old, zipfile.ZipFile(tmp_path / "b.xlsx", "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "xl/workbook.xml":
                wrong = b'<definedNames><definedName name="_xlnm.Print_Area" localSheetId="0">x</definedName></definedNames>'
                data, count = re.subn(rb"<definedNames ?/>", wrong, data)
                assert count == 1
            new.writestr(name, data)
    assert np.array_equal(ms.read(tmp_path / "b.xlsx").outputs, ms.read(tmp_path / "a.xlsx").outputs)


@pytest.mark.slow
def test_a_workbook_of_a_billion_empty_cells_is_ended(tmp_path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    book.active.cell(1_048_576, 16_384, 1.0)
    book.save(tmp_path / "a.xlsx")
    refused("a.xlsx with openpyxl.*(does not end|not end within|MemoryError)", ms.read, tmp_path / "a.xlsx")


_BOOK = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
_WORKBOOK = (
    f'<workbook {_BOOK} xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships"><sheets>'
    "{}</sheets></workbook>"
)


def _sheets(count: int) -> str:
    return _WORKBOOK.format("".join(f'<sheet name="{k}" sheetId="{k}" r:id="rId1"/>' for k in range(1, count + 1)))


def _styles(code: str, first: str = "") -> str:
    return f'{first}<styleSheet {_BOOK}><numFmts><numFmt numFmtId="200" formatCode="{code}"/></numFmts></styleSheet>'


@pytest.mark.parametrize(
    ("member", "text", "apart"),
    [
        ("xl/other.xml", "<a/>", False),
        ("xl/other.xml", "<a/>" * 260_000, True),  # more than small ones hold
        ("xl/styles.xml", _styles("[" * 500), False),
        ("xl/styles.xml", _styles("[" * 501), True),  # patterns of openpyxl take the square of it
        ("xl/styles.xml", _styles("0", "<!DOCTYPE a [<!ENTITY b 'c'>]>"), True),
        ("xl/styles.xml", _styles("0", "<!-- a remark -->"), False),
        ("xl/other.bin", "a\0", True),
        ("xl/workbook.xml", _sheets(100), False),
        ("xl/workbook.xml", _sheets(2000), True),  # one part, read as often as there are names
    ],
)
def test_a_small_workbook_is_read_in_this_process_unless_what_it_holds_may_take_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, member: str, text: str, apart: bool
) -> None:
    path, begun = tmp_path / "a.xlsx", list[str]()
    book = pytest.importorskip("openpyxl").Workbook()
    for row in (["t [s]", "a [m/s2]"], *([k / 100, float(k % 7)] for k in range(8))):
        book.active.append(row)
    book.save(tmp_path / "b.xlsx")
    with zipfile.ZipFile(tmp_path / "b.xlsx") as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name in {*old.namelist(), member}:
            new.writestr(name, text if name == member else old.read(name))

    def noted(package: str, *given: Any) -> Any:
        begun.append(package)
        return "it is ended", b""

    monkeypatch.setattr("modalscope.io.apart.run_apart", noted)
    with suppress(ms.DataError):  # several sheets
        ms.read(path)
    assert begun == ["openpyxl"] * apart


def test_parquet_keeps_names(tmp_path: Path) -> None:
    write_parquet(tmp_path / "a.parquet")
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
    monkeypatch.setattr("modalscope.io.foreign.find_spec", lambda name: None)
    (tmp_path / f"a{suffix}").write_bytes(b"anything")
    refused(rf"pip install 'modalscope\[{extra}\]'", ms.read, tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".tdms", pytest.param(".mf4", marks=pytest.mark.slow)])
def test_when_a_file_starts_is_known_to_what_puts_recorders_on_one_clock(tmp_path: Path, suffix: str) -> None:
    start = datetime(2024, 5, 3, 12, 0, 3, 700_000, tzinfo=UTC)
    if suffix == ".tdms":
        nptdms = pytest.importorskip("nptdms")
        said = {"wf_increment": 1 / RATE, "wf_start_time": np.datetime64(start.replace(tzinfo=None))}
        with nptdms.TdmsWriter(str(tmp_path / "node.tdms")) as writer:
            writer.write_segment([nptdms.ChannelObject("run", "Acc", CHANNELS[:, 1], properties=said)])
    else:
        asammdf = pytest.importorskip("asammdf")
        with asammdf.MDF(version="4.10") as file:
            file.header.start_time = start
            file.append([asammdf.Signal(samples=CHANNELS[:, 1].copy(), timestamps=TIMES, name="Acc", unit="m/s2")])
            file.save(tmp_path / "node.mf4", overwrite=True)
    assert survey(tmp_path / f"node{suffix}").begins == pytest.approx(start.timestamp(), abs=1e-6)
