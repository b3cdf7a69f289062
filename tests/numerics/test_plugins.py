"""Other packages add formats and methods; what they do wrong is said in words, with their name."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.identification.method_names import cell_label
from modalscope.numerics import plugins
from modalscope.systems import chain5
from tests.support import ROOT

PACKAGE = ROOT / "tests" / "example_package"


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(str(PACKAGE))
    for cached in (plugins.added, plugins.names_added):
        cached.cache_clear()
    yield
    for cached in (plugins.added, plugins.names_added):
        cached.cache_clear()


def written(folder: Path, text: str = "") -> Path:
    path = folder / "run.vnd"
    decay = "\n".join(f"{value:.6f} {2 * value:.6f}" for value in np.exp(-0.1 * np.arange(20)))
    path.write_text(text or f"50\n{decay}\n")
    return path


@pytest.mark.slow
def test_the_suffix_of_another_package_is_read(installed: None, tmp_path: Path) -> None:
    signals = ms.read(written(tmp_path), quantity="velocity")
    assert (signals.samples, signals.sampling_rate, signals.quantity) == (20, 50.0, "velocity")
    command = [sys.executable, "-m", "modalscope", "info", str(tmp_path / "run.vnd")]
    told = subprocess.run(command, env={"PYTHONPATH": str(PACKAGE)}, capture_output=True, text=True, check=True).stdout
    assert ".vnd file, read by vendor_reader" in told


def test_without_the_package_the_suffix_is_unknown(tmp_path: Path) -> None:
    with pytest.raises(ms.DataError, match=r"the suffix '\.vnd' is unknown"):
        ms.read(written(tmp_path, "\0\1\2"))  # text would be read as text


def test_what_no_installed_package_adds_is_asked_in_vain() -> None:
    with pytest.raises(ms.DataError, match=r"tea of modalscope\.readings: no installed package adds it"):
        plugins.added(plugins.READINGS, "tea")


def test_a_fault_of_the_reader_names_its_package(installed: None, tmp_path: Path) -> None:
    with pytest.raises(ms.DataError, match=r"vendor_reader.*damaged or of another kind"):
        ms.read(written(tmp_path, "no rate\n"))


def test_a_row_of_another_package_is_a_method(installed: None) -> None:
    assert any(row.name == "short-era" for row in ms.methods())
    response = chain5().impulse_response(200, noise=0.001, seed=0)
    own = ms.identify(response, method="Vendor-ERA", order=10)
    same = ms.identify(response, method="era", order=10, block_rows=16)
    assert own.method == "short-era"
    assert np.allclose(own.modes.frequencies, same.modes.frequencies, rtol=1e-12)


def test_a_row_of_another_package_is_compared_listed_and_read(installed: None, tmp_path: Path) -> None:
    """Where it is named, and with all sets without a vote: trust was calibrated with the votes of the table."""
    response = chain5().impulse_response(100, noise=0.001, seed=0)
    named = ms.compare(response, ["short-era", "era/time"], orders=[10])
    assert [result.name for result in named.results] == ["short-era (time)", "era (time)"]
    every = ms.compare(response, orders=[10], all_sets=True)
    assert [r.method.name for r in every.results if not r.exact and r.method.domain == "time"] == ["short-era"]
    diagram = ms.stabilize(response, method="short-era", orders=[8, 10])
    ms.write(tmp_path / "short.npz", diagram)
    assert type(ms.read(tmp_path / "short.npz").settings) is type(diagram.settings)
    assert cell_label("short-era", "time") == "ERA with 16 block rows (short-era)"
    with pytest.raises(ms.DataError, match="Did you mean 'short-era'"):
        ms.identify(response, method="shrt-era")


def test_a_row_that_does_not_load_says_which_package(installed: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "vendor_reader", None)
    with pytest.raises(ms.DataError, match="installed package vendor_reader"):
        ms.methods("vendor-era")
