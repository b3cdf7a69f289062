"""Facts above a table: keys and values as cells, and how rates are written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from tests.io.columns.test_words import T, write
from tests.support import refused

MOTION = (np.sin(T), np.cos(T), np.cos(2 * T))


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("Sample rate:,4096", 4096), ("Sample rate:,4096,,", 4096), ("Sampling rate: ,4096,Hz", 4096), ("Sample rate,,4096", 4096),
        ('"Sample rate:",4096', 4096), ('"Sampling Rate (Hz)","4096"', 4096), ("Fs=,4096", 4096), ("Sample rate [kHz]:,4.096", 4096),
        ("Sampling frequency,4096,4096,4096", 4096), ("Sample interval:,0.001", 1000), ("Sample rate:,.5", 0.5),
        # in one cell, thousands may be parted
        ("Sampling rate: 1,024 Hz", 1024), ("Sampling rate: 51,200.5 Hz", 51200.5), ("Sample rate: 1.024 kHz", 1024),
        ("Sample rate: 1,024 kHz", 1024),
    ],
)  # fmt: skip
def test_a_rate_above_a_table_of_commas(tmp_path: Path, line: str, rate: float) -> None:
    path = write(tmp_path / "a.csv", f"{line}\nForce [N],a [g],b [g]", *MOTION)
    assert ms.read(path).sampling_rate == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("Sampling frequency;4096", 4096), ("Sample rate:;4096;;", 4096), ("Abtastrate;1024,5;Hz", 1024.5), ("dt;0,001", 1000),
        ("Abtastrate: 51.200 Hz", 51200), ("Abtastrate: 1.024,5 Hz", 1024.5), ("Sample rate: 51.2 Hz", 51.2),
        # of steps and of kHz three digits behind a point are decimals
        ("Delta Time: 0.001 s", 1000), ("dt: 1.250 ms", 800), ("Sampling rate: 1.024 kHz", 1024),
    ],
)  # fmt: skip
def test_a_rate_above_a_table_of_semicolons_and_decimal_commas(tmp_path: Path, line: str, rate: float) -> None:
    path = write(tmp_path / "a.csv", f"{line}\nForce [N];a [g];b [g]", *MOTION, sep=";")
    assert ms.read(path).sampling_rate == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("line", ["Sample rate:\t4096", "Sample rate:\t\t4096\tHz", "Sample rate\t4096"])
def test_a_rate_above_a_table_of_tabs(tmp_path: Path, line: str) -> None:
    assert ms.read(write(tmp_path / "a.txt", f"{line}\nF [N]\ta [g]\tb [g]", *MOTION, sep="\t")).sampling_rate == 4096


@pytest.mark.parametrize("line", ["Sample rate,100,200", "Sample rate,100,100,200", "fs: 2 000"])
def test_rates_that_differ_from_channel_to_channel_are_asked_for(tmp_path: Path, line: str) -> None:
    path = write(tmp_path / "a.csv", f"{line}\nForce [N],a [g],b [g]", *MOTION)
    refused("(?s)its header says several.*--sampling-rate HZ", ms.read, path)
    assert ms.read(path, sampling_rate=100.0).sampling_rate == 100
