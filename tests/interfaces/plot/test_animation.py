"""Shapes that move: files that other programs open, and pictures that differ."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import modalscope as ms
from tests.interfaces.plot import examples
from tests.support import refused

MODES = examples.modes()


@pytest.mark.slow
@pytest.mark.parametrize("modes", [MODES, ms.systems.chain5().modes()], ids=["geometry", "bars"])
def test_a_gif_has_a_period_of_pictures_that_differ(modes: ms.ModalModel, tmp_path: Path) -> None:
    path = ms.plot.animate(modes, [0, 1], tmp_path / "a.gif", seconds=0.4, rate=10)
    with Image.open(path) as picture:
        frames = []
        for k in range(picture.n_frames):  # type: ignore[attr-defined]
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")))
    assert len(frames) == 4
    assert frames[0].shape[1] > 1.8 * frames[0].shape[0]  # two side by side
    assert all((a != b).any() for a, b in pairwise(frames))


def test_a_film_is_written_where_there_is_a_program_for_it(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="the extra `video` is not installed")
    path = ms.plot.animate(MODES, 0, tmp_path / "a.mp4", seconds=0.4, rate=10)
    assert path.read_bytes()[4:8] == b"ftyp"


def test_what_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    refused("the formats are", ms.plot.animate, MODES, 0, tmp_path / "a.avi")
    refused("lower index", ms.plot.animate, MODES, 99, tmp_path / "a.gif")
    refused("it needs a mode", ms.plot.animate, MODES, [], tmp_path / "a.gif")
    refused("the maximum is 1000 frames", ms.plot.animate, MODES, 0, tmp_path / "a.gif", seconds=1e30)
    assert not list(tmp_path.iterdir())
