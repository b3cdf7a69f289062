"""Noise alone is told from all else: white noise of any mixture is, coloured noise is not, and a structure is neither."""

from __future__ import annotations

import numpy as np
import scipy.signal

from modalscope.data import Signals
from modalscope.signals.preprocess.spectral_peaks import NOISE, UNSEEN, levels_of, noise_notes
from tests.selection.judging.ambient_records import random_structure


def kinds(y: np.ndarray, band: tuple[float, float] | None = None) -> list[str]:
    return [note.kind for note in noise_notes(levels_of(Signals(outputs=y, sampling_rate=100.0)), band)]


def test_white_noise_is_noise_alone_in_any_mixture() -> None:
    told = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        l = 1 + seed % 5
        told.append(kinds(rng.standard_normal((4000, l)) @ rng.standard_normal((l, l))))
    assert told.count([NOISE]) >= 39  # a peak by chance in one of a thousand, colour in fewer


def test_noise_in_a_band_is_noise_there() -> None:
    y = np.random.default_rng(0).standard_normal((20000, 2))
    note = noise_notes(levels_of(Signals(outputs=y, sampling_rate=100.0)), (5.0, 20.0))[0]
    assert note.kind == NOISE
    assert 5 <= note.numbers["lowest_hz"] < note.numbers["highest_hz"] <= 20
    assert "Only noise in" in str(note)


def test_coloured_noise_is_not_white_and_nothing_stands_out() -> None:
    smooth = scipy.signal.lfilter([1], [1, -0.8], np.random.default_rng(0).standard_normal((20000, 2)), axis=0)
    assert kinds(smooth) == [UNSEEN]


def test_a_structure_is_no_noise() -> None:
    assert noise_notes(levels_of(random_structure(1).record(1, 0))) == ()
