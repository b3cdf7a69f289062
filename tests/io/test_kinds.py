"""Further kinds of files: quoted lines, cameras, universal files of another width, recorders that begin one channel after the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import survey

T = np.arange(600) / 50
A, B = np.sin(9 * T) * np.exp(-T / 3), np.cos(25 * T) * np.exp(-T / 2)


def test_lines_in_quotes_are_rows_of_several_cells(tmp_path: Path) -> None:
    rows = "".join(f'"{t:.2f}, {a:.5f}, {b:.5f}",,\r\n' for t, a, b in zip(T, A, B, strict=True))
    (tmp_path / "a.csv").write_text('"time (s), a, b"\r\n' + rows)
    found = ms.read(tmp_path / "a.csv")
    assert (found.output_dofs, found.sampling_rate) == (("a", "b"), 50.0)
    np.testing.assert_allclose(found.outputs, np.stack([A, B], 1), atol=1e-5)


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_the_points_of_a_camera_are_channels(axes: tuple[int, int, int], tmp_path: Path) -> None:
    shapes = np.array(
        [[[1, 0.3], [-0.5, 0.2]], [[0.8, 0.1], [0.6, -0.4]], [[0.5, 0.9], [0.9, 0.7]]]
    )  # points, modes, directions
    stack = np.einsum("pmd,mn->pnd", shapes, np.stack([A, B]))
    np.save(tmp_path / "a.npy", np.transpose(stack, axes))
    found = ms.read(tmp_path / "a.npy", sampling_rate=50.0)
    assert found.output_dofs == tuple(f"{p}:+{d}" for p in (1, 2, 3) for d in "XY")
    np.testing.assert_allclose(found.outputs[:, 3], stack[1, :, 1])


def test_runs_that_move_each_by_itself_are_no_points(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.random.default_rng(2).standard_normal((4, 600, 2)))
    with pytest.raises(ms.DataError, match="outputs of shape"):
        ms.read(tmp_path / "a.npy", sampling_rate=50.0)


def test_a_universal_file_of_another_width_is_parted_by_blanks(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    ms.write(path, ms.Signals(outputs=A[:, None], sampling_rate=50.0), text=True)
    lines = path.read_text().splitlines()
    body = [
        k
        for k, line in enumerate(lines)
        if k > 12 and all(cell[:1] in "-0123456789" and "E" in cell for cell in line.split())
    ]
    wide = [" ".join(f"{float(cell):.10E}" for cell in lines[k].split()) for k in body]
    path.write_text("\n".join([*lines[: body[0]], *wide, *lines[body[-1] + 1 :]]) + "\n")
    np.testing.assert_allclose(ms.read(path).outputs[:, 0], A, atol=1e-9)
    path.write_text("\n".join([*lines[: body[0]], *wide[:-1], *lines[body[-1] + 1 :]]) + "\n")
    with pytest.raises(ms.DataError, match="the 600 points of its header"):
        ms.read(path)


def test_channels_of_a_recorder_are_taken_from_the_last_start_on(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    start = np.datetime64("2024-05-01T12:00:00.000000")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        for name, values, late in (("a", A, 0), ("b", B, 1_240_000)):
            facts = {"wf_increment": 0.02, "wf_start_time": start + np.timedelta64(late, "us"), "wf_start_offset": 0.0}
            writer.write_segment([nptdms.ChannelObject("Log", name, values, properties=facts)])
    found = survey(tmp_path / "a.tdms")
    assert any("b begins 1.24 s after a" in note for note in found.notes)
    np.testing.assert_array_equal(found.thing.outputs, np.stack([A[62:], B[:-62]], 1))
