from __future__ import annotations

import re
from pathlib import Path

import matplotlib
import numpy as np
import pytest

from modalscope import plot, systems
from modalscope.analysis.comparing import Comparison, compare
from modalscope.interfaces.cli import main
from modalscope.interfaces.reporting import report
from modalscope.interfaces.reporting.record import comparison_script

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    response = systems.chain5().impulse_response(300, noise=0.01, seed=0)
    methods = ["era/time", "least_squares/time", "prce/time", "era/s"]
    return compare(response, methods, orders=range(2, 21, 2), workers=1)


@pytest.fixture(scope="module")
def page(comparison: Comparison, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = report(
        comparison,
        tmp_path_factory.mktemp("compare") / "c.html",
        source="<b>chain</b>.uff",
        command="modalscope compare chain.uff",
    )
    return path.read_text(encoding="utf-8")


@pytest.mark.slow
def test_nothing_is_asked_from_outside(page: str) -> None:
    text = re.sub(r"base64,[A-Za-z0-9+/=]+", "", page)
    assert not re.search(r"(?:https?:)?//[\w.]", text)
    assert not re.search(r"<(script|link|iframe|object|embed)", text)
    assert "@import" not in text
    assert "url(" not in text
    assert re.findall(r'src="([^"]{0,26})', page) == ["data:image/svg+xml;base64,"] * page.count("src=")
    assert "<b>chain" not in page  # what users write cannot become markup


def test_the_sections_stand_in_the_order_of_reading(page: str) -> None:
    anchors = re.findall(r'<section id="(\w+)"', page)
    assert anchors == [
        "verdict", "modes", "methods", "map", "disagreements",
        "stabilization", "shapes", "mac", "responses", "data", "settings", "repeat",
    ]  # fmt: skip


def test_every_method_value_and_failure_is_there(comparison: Comparison, page: str) -> None:
    for r in comparison.results:
        assert r.label in page
    assert "no rational transform" in page
    for g in comparison.groups:
        assert f"{g.frequency:.5g}" in page
    for line in comparison.verdict.splitlines():
        if not line.startswith(("Do not trust", "Trust the frequency")):  # of single modes the table speaks
            assert line.split("±")[0].replace("<", "&lt;")[:60] in page
    assert page.count('class="grade') == len(comparison.groups)


def test_a_map_is_drawn_where_it_says_something(comparison: Comparison, page: str) -> None:
    assert len(comparison.kinship.classes) < 4
    assert ": no map" in page
    assert "Distances between methods" not in page


def test_the_script_repeats_the_comparison(comparison: Comparison) -> None:
    text = comparison_script(comparison, "chain.uff")
    compile(text, "script", "exec")
    assert "methods=['era/time', 'least_squares/time', 'prce/time', 'era/s']" in text
    assert "orders=[2, 4, 6" in text
    assert "ms.report(comparison" in text


def test_the_map_puts_equals_on_one_point_and_names_all(comparison: Comparison) -> None:
    ax = plot.method_map(comparison)
    words = {text.get_text() for text in ax.texts}
    assert words == {"ERA = ITD (least_squares)", "PRCE"}
    points = [tuple(np.ravel(line.get_xydata())) for line in ax.lines[1:]]  # the first leads to the names
    # coordinates are roots of eigenvalues: rounding of 1e-12 in distances becomes 1e-6
    assert points[0] == pytest.approx(points[1], abs=1e-4)
    assert len(points) == 3


def test_deviations_show_every_method_and_the_stated_scatter(comparison: Comparison) -> None:
    upper, lower = plot.deviations(comparison)
    found = sum(len(g.members) for g in comparison.groups)
    _, *of_methods = upper.lines  # the zero line, and a line each
    assert sum(len(line.get_xdata()) for line in of_methods) == found
    assert {line.get_linestyle() for line in of_methods} == {"None"}
    (scatter,) = lower.collections
    assert len(scatter.get_paths()) == len(comparison.groups)


@pytest.mark.slow
def test_the_command_writes_a_report_and_repeats_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = tmp_path / "test.npz"
    response = systems.chain5().impulse_response(300, noise=0.01, seed=0)
    np.savez(data, values=response.values, sampling_rate=20.0)
    out = tmp_path / "r.html"
    assert main(["compare", str(data), "--orders", "2:20:2", "--methods", "era/time", "prce", "-o", str(out)]) == 0
    told = capsys.readouterr().out
    assert "methods agree" in told
    assert f"modalscope compare {data} --orders 2:20:2 --methods era/time prce -o {out}" in out.read_text()
    assert main(["compare", str(data), "--methods", "eraa"]) == 2
    assert "Did you mean" in capsys.readouterr().err
    assert not (tmp_path / "no.html").exists()
