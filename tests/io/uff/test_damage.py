"""A damaged universal file is refused, or gives an intact prefix; never other numbers than its headers count."""

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.data import DataError, FrequencyResponse, ModalModel, Signals
from modalscope.io.limits import room
from modalscope.io.uff.function import read_function
from modalscope.io.uff.scan import scan
from tests.io import samples

UNEVEN = FrequencyResponse(
    values=samples.frequency_response().values, frequencies=2.0 ** np.arange(7), output_dofs=samples.OUTPUTS
)
CASES = {
    "binary": (lambda: samples.frequency_response().select(inputs=[0]), {}),
    "text": (lambda: samples.frequency_response().select(inputs=[0]), {"text": True}),
    "records": (samples.records, {}),
    "text records": (samples.records, {"text": True}),
    "uneven": (lambda: UNEVEN, {}),
    "uneven text": (lambda: UNEVEN, {"text": True}),
    "modes 55": (samples.modes, {"dataset": 55}),
    "modes 2414": (samples.modes, {"dataset": 2414, "nodes": 15, "lines": 2412}),
}


@pytest.fixture(params=CASES)
def file(request, tmp_path):
    make, options = CASES[request.param]
    mio.write(tmp_path / "whole.uff", make(), **options)
    return tmp_path / "whole.uff"


def test_what_is_read_from_a_truncated_file_comes_from_whole_sets(file, tmp_path):
    data, whole = file.read_bytes(), mio.read(file)
    starts = [k for k in range(1, len(data)) if data[k - 1 : k + 6] == b"\n    -1" or data[k : k + 7] == b"    -1\n"]
    for k in sorted({*starts, *range(0, len(data), max(1, len(data) // 40))}):
        (tmp_path / "cut.uff").write_bytes(data[:k])
        try:
            part = mio.read(tmp_path / "cut.uff")
        except DataError:
            continue
        if isinstance(part, FrequencyResponse):
            rows = [whole.output_dofs.index(dof) for dof in part.output_dofs]
            columns = [whole.input_dofs.index(dof) for dof in part.input_dofs]
            np.testing.assert_array_equal(part.values, whole.values[:, rows][:, :, columns])
        elif isinstance(part, Signals):
            assert part.samples == whole.samples
        elif isinstance(part, ModalModel):
            np.testing.assert_array_equal(part.poles, whole.poles[: len(part)])


def flipped(data, rng, count):
    for _ in range(count):
        changed = bytearray(data)
        changed[rng.integers(len(changed))] ^= rng.integers(1, 256) if rng.random() < 0.5 else 1 << rng.integers(8)
        yield bytes(changed)


def test_a_flipped_byte_is_refused_or_changes_no_count(file, tmp_path):
    """The reader answers by a DataError or by sets of their stated size."""
    path = tmp_path / "flipped.uff"
    for changed in flipped(file.read_bytes(), np.random.default_rng(1), 60):
        path.write_bytes(changed)
        try:
            thing = mio.read(path)
            blocks = [block for block in scan(path.name, changed, room(path.name, len(changed))) if block.dataset == 58]
        except DataError:
            continue
        for block in blocks:
            function = read_function(path.name, block)
            counted = int(block.records[6][10:20])
            assert function.values.size == function.x.size == counted
        axis = {"FrequencyResponse": "lines", "Signals": "samples"}.get(type(thing).__name__)
        if axis:
            assert getattr(thing, axis) in {int(block.records[6][10:20]) for block in blocks}


def binary(tmp_path):
    path = tmp_path / "a.uff"
    mio.write(path, samples.frequency_response())
    return path, path.read_bytes()


def refused(path, data, text):
    path.write_bytes(data)
    with pytest.raises(DataError, match=text) as error:
        mio.read(path)
    assert error.value.asked
    assert error.value.found
    assert error.value.change


@pytest.mark.parametrize(
    ("right", "wrong", "text"),
    [
        (b"    58b     1     2", b"    58b     2     2", r"flagged big-endian(.|\n)*little-endian"),
        (b"    58b     1     2", b"    58b     1     1", "floating-point format 1"),
        (b"          11         112", b"          11         111", "counts 111 bytes, and its 7 points need 112"),
    ],
)
def test_a_head_that_is_not_of_its_payload_is_told(tmp_path, right, wrong, text):
    path, data = binary(tmp_path)
    refused(path, data.replace(right, wrong, 1), text)


def test_nan_in_a_file_is_told(tmp_path):
    path, data = binary(tmp_path)
    value = np.ascontiguousarray(samples.frequency_response().values[:, 0, 0]).tobytes()
    spoilt = np.float64(np.nan).tobytes() + value[8:]
    refused(path, data.replace(value, spoilt, 1), "1 of 7 points are NaN or infinite, the first at point 1")
    mio.write(path, samples.frequency_response(), text=True)
    text = path.read_bytes()
    first = text.index(b"E", text.index(b"NONE", text.index(b"         0    0    0    0 NONE")) + 60)
    number = text[first - 14 : first + 4]
    refused(path, text.replace(number, b"NaN".rjust(len(number)), 1), "NaN or infinity")


def test_one_bad_set_does_not_hide_the_others(tmp_path):
    path, data = binary(tmp_path)
    place = data.index(b"    58b", data.index(b"    58b") + 1)
    refused(path, data[:place] + b"    xxb" + data[place + 7 :], "dataset number")


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"frequency,value\n1,2\n", "it begins with 'frequency,value'"),
        (b"\n\n  \n", "no sets"),
        (b"\x00" * 3000, "it begins with"),
        (b" " * 100_000, "no sets"),
        (b"    -1\n", "dataset number"),
        (b"    -1\n   151\nNONE\n", "not closed"),
        (b"    -1\n   151\n    -1\n1 2 3\n", "after set 1 comes '1 2 3'"),
    ],
)
def test_foreign_and_empty_files_are_told(tmp_path, data, text):
    refused(tmp_path / "a.uff", data, text)


@pytest.mark.parametrize("dataset", [55, 2414])
@pytest.mark.parametrize(
    ("damping", "text"), [("  2.50000E+00", "a damping ratio within 1, but they are 3 Hz and 2.5"), ("", "cut off")]
)
def test_a_mode_that_cannot_be_is_told_from_a_record_that_ends(tmp_path, dataset, damping, text):
    real = ModalModel(poles=[-0.75 + 18.8j], shapes=[[1.0], [2.0]], output_dofs=("1:+Z", "2:+Z"))
    mio.write(tmp_path / "whole.uff", real, dataset=dataset)
    row = {55: "{f}{zero}{zeta}{zero}", 2414: "{zero}{f}{zero}{zero}{zeta}{zero}"}[dataset]
    said = {"f": f"{real.frequencies[0]:13.5E}", "zeta": f"{real.damping_ratios[0]:13.5E}", "zero": f"{0:13.5E}"}
    new = {"f": "  3.00000E+00", "zeta": damping, "zero": said["zero"]}
    changed = row.format(**new) if damping else said["f"]
    data = (tmp_path / "whole.uff").read_bytes()
    assert row.format(**said).encode() in data
    refused(tmp_path / "a.uff", data.replace(row.format(**said).encode(), changed.encode()), text)


def test_a_delimiter_inside_binary_data_is_data(tmp_path):
    trap = np.frombuffer(b"\n    -1\n" * 2)
    values = np.concatenate([trap, [1.0, 2.0]])
    record = Signals(outputs=values[:, None] * [1, 0] + [[0, 1]], sampling_rate=8.0)
    mio.write(tmp_path / "a.uff", record)
    np.testing.assert_array_equal(mio.read(tmp_path / "a.uff").outputs[:, 0], values)


def test_windows_line_ends_are_read(tmp_path):
    path = tmp_path / "a.uff"
    mio.write(path, samples.frequency_response(), text=True)
    expected = mio.read(path)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    np.testing.assert_array_equal(mio.read(path).values, expected.values)
