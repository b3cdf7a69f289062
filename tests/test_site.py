"""The documentation site: what stands in its pages beside the scripts that building it runs."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib
import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5
from tests.support import ROOT
from tools.held import HELD
from tools.site import problems

DOCS = ROOT / "docs"
SCRIPTS = sorted(path for folder in ("start", "howto", "executed") for path in (DOCS / folder).glob("plot_*.py"))


@pytest.mark.slow
def test_every_line_of_the_right_columns_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    rows = re.findall(r"^\| [^|]* \| (.*) \|$", (DOCS / "coming-from.md").read_text(encoding="utf-8"), re.MULTILINE)
    lines = [line for cell in rows for line in re.findall(r"`([^`]+)`", cell) if re.search(r"[(.]", line)]
    lines = [line for line in lines if not line.endswith("=")]
    structure = chain5()
    f = np.linspace(0.3, 8, 200)
    H = structure.frequency_response(f, quantity="acceleration").values
    names: dict[str, object] = {
        "ms": ms,
        "array": np.random.default_rng(0).standard_normal((400, 3)),
        "H": H,
        "f": f,
        "frf": ms.FrequencyResponse(values=H, frequencies=f, quantity="acceleration"),
        "irf": structure.impulse_response(120),
        "record": structure.simulate(inputs="ambient", samples=4000, noise=0.01, seed=1),
        "record2": structure.simulate(samples=4000, noise=0.01),
        "modes": structure.modes(quantity="acceleration"),
    }
    names["diagram"] = ms.stabilize(names["irf"], orders=range(2, 13, 2))
    kept = dict(names)
    assert len(lines) > 40
    for line in lines:
        names |= kept
        exec(compile(line, line, "exec"), names)
    matplotlib.pyplot.close("all")


def test_recipes_are_short_say_where_their_data_come_from_and_end_in_a_picture() -> None:
    for script in SCRIPTS:
        text = script.read_text(encoding="utf-8")
        head, code = text.split('"""', 2)[1:]
        lines = [line for line in code.splitlines() if line.strip() and not line.startswith("#")]
        assert head.strip().splitlines()[1].strip("=") == "", script
        assert len(lines) <= 30 or script.parent.name != "howto", script
        assert re.search(r"plot", code), script


def test_there_are_forty_recipes_and_what_each_of_them_prints_is_held() -> None:
    pages = {f"{path.parent.name}/{path.stem}" for path in SCRIPTS if path.parent.name in ("start", "howto")}
    assert sum(page.startswith("howto/") for page in pages) >= 40
    executed = {f"{path.parent.name}/{path.stem}" for path in SCRIPTS if path.parent.name == "executed"}
    assert pages <= set(HELD) <= pages | executed
    assert all(held.of or held.words for held in HELD.values())


def test_every_start_says_whether_its_data_are_measured() -> None:
    for script in (DOCS / "start").glob("plot_*.py"):
        assert re.search(r"\*\*(Measured|Simulated)\*\*", script.read_text(encoding="utf-8"))


def test_the_settings_of_the_site_name_no_other_place() -> None:
    for path in (DOCS / "conf.py", DOCS / "_static" / "site.css", ROOT / "Makefile"):
        assert not re.search(r"https?://", path.read_text(encoding="utf-8")), path


def test_dead_links_missing_files_and_requests_are_found(tmp_path: Path) -> None:
    (tmp_path / "good.html").write_text('<a href="bad.html#there">x</a><p id="here"></p>')
    (tmp_path / "bad.html").write_text(
        '<p id="there"></p><a href="none.html">x</a><a href="good.html#gone">x</a><img src="no.png"><script src="https://else.where/x.js"></script>'
    )
    found = problems(tmp_path)
    assert len(found) == 4
    assert all(line.startswith("bad.html") for line in found)
