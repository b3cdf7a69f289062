"""Tables as text: what people write, and what cannot be read."""

import io

import pytest

import modalscope.io as mio
from modalscope.data import Signals
from tests.io import samples
from tests.support import refused


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,out y1\n0,1\n", "there is one sample"),
        ("time_s,out y1\n0,1\n1,x\n", r"1 line under the table ignored \('1,x' ...\)"),
        ("time_s,out y1\n0,1\n# ends\nend\n1,2\n", r"1 line among the rows ignored \('end' ...\)"),
        ("time_s,out y1\n0,1\n1\n", "needs 2 numbers in every row"),
        ("time_s,out y1\n0,1\n1,nan\n2,3\n", "outputs needs finite numbers"),
        ("time_s,out y1\n0,1\n1,1\n5,1\n", "evenly sampled"),
        ("when,out y1\n0,1\n1,1\n", "no column is of times"),
        ("frequency_hz,real a / b\n1,1\n", "missing: imag a / b"),
        ("frequency_hz,something\n1,1\n", "needs complex values"),
        ("mode,frequency_hz,damping_ratio,kind\n1,2,3,mode\n2,3,.1,mode\n", "damping ratios within 1"),
        ("mode,frequency_hz,damping_ratio,real 1\n1,1,.1,3\n2,2,.1,3\n", "imag 1 is missing"),
        ("mode,frequency_hz,damping_ratio,mpc,mpc\n1,1,.1,3,4\n2,2,.1,3,3\n", "each column once"),
        ("# sampling_rate: fast\ntime_s,out y1\n0,1\n1,1\n", "sampling_rate in a.csv needs a number"),
    ],
)
def test_csv_tables_that_do_not_read(tmp_path, text, message):
    (tmp_path / "a.csv").write_text(text)
    refused(message, mio.read, tmp_path / "a.csv")


def test_csv_reads_what_people_write(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s;out 3:+Z [m/s2];in hammer [N]\n0;1;2\n0.1;2;3\n0.2;3;4\n")
    record = mio.read(path, quantity="acceleration")
    assert isinstance(record, Signals)
    assert (record.sampling_rate, record.units, record.input_dofs) == (
        pytest.approx(10),
        (("m/s2",), ("N",)),
        ("hammer",),
    )
    path.write_text("# quantity: velocity\nfrequency_hz,real a / b [m/s / N],imag a / b\n1,1,2\n2,3,4\n")
    assert mio.read(path).quantity == "velocity"
    path.write_text("time_s,1:+Z / 2:+Z\n0,1\n1,2\n2,3\n")
    assert mio.read(path).kind == "dirac"


def test_a_table_of_modes_has_its_numbers_and_shapes(tmp_path):
    import csv

    modes = samples.modes()
    mio.write(tmp_path / "modes.csv", modes)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "modes.csv").read_text())))
    assert [float(row["frequency_hz"]) for row in rows] == modes.frequencies.tolist()
    assert [float(row["imag 12:-X"]) for row in rows] == modes.shapes[2].imag.tolist()
    assert [float(row["emac"]) for row in rows] == modes.indicators["emac"].tolist()


def test_options_of_tables_serve_the_layout_that_is_written_here_too(tmp_path):
    record = samples.records()
    mio.write(tmp_path / "a.csv", record)
    kept = mio.read(tmp_path / "a.csv", ignore=2)
    assert (kept.output_dofs, kept.input_dofs) == (record.output_dofs[1:], record.input_dofs)
    assert (kept.outputs == record.outputs[..., 1:]).all()
    assert kept.sampling_rate == pytest.approx(record.sampling_rate, rel=1e-9)
