"""The report in a real browser, where one is installed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from modalscope.interfaces.plot.web.alive import front_end
from modalscope.interfaces.reporting import report
from tests.interfaces.plot import examples


@pytest.mark.slow
def test_a_browser_asks_nobody_shows_every_picture_and_never_scrolls_sideways(tmp_path: Path, browser: Any) -> None:
    path = report((examples.modes(), examples.diagram()), tmp_path / "r.html")
    asked: list[str] = []
    said: list[str] = []
    page = browser.new_page()
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: said.append(message.text))
    page.goto(path.as_uri())
    sizes = page.evaluate(DRAWN)
    if front_end("viewer.js") is not None:
        page.locator("#alive .panel").first.wait_for()
    alive = page.evaluate("document.querySelectorAll('#alive .panel').length")
    spill = []
    for width in (1200, 700, 380):
        page.set_viewport_size({"width": width, "height": 800})
        spill.append(page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))
    page.close()
    assert alive == (0 if front_end("viewer.js") is None else 5)
    assert [url for url in asked if not url.startswith("data:")] == [path.as_uri()]
    assert path.stat().st_size < 1_000_000
    assert sizes
    assert min(map(min, sizes)) > 100
    assert max(spill) <= 0
    assert not said


#: Width and height of what is drawn in each picture.
DRAWN = (
    "[...document.querySelectorAll('svg.chart')].map(svg => [svg.getBBox().width, svg.getBoundingClientRect().height])"
)

#: Each means something in one of the languages that a report is written in: HTML, CSS, scripts, SVG, formulas.
HOSTILE = (
    "<script>document.title='run'</script>",
    '"><img src=x onerror="document.title=\'run\'">',
    "</code></pre><iframe src='http://127.0.0.1:9/'>",
    "a\x00b\x1b[2J\x0c\u2028]]>--><svg onload=document.title='run'>",
    r"$\frac{$",
    "$$",
    "]]>",
    "-->",
)

#: The same as one label, for what there is one of: each of them would still do what it says where it were taken for more than text.
ALL = "".join(HOSTILE)


@pytest.mark.filterwarnings("ignore:Glyph")
def test_hostile_labels_run_nothing_ask_nobody_and_are_drawn(tmp_path: Path, browser: Any) -> None:
    asked: list[str] = []
    diagram = examples.diagram()
    outputs = ("".join(HOSTILE[:4]), *HOSTILE[4:6], "".join(HOSTILE[6:]))
    response = replace(diagram.response, output_dofs=outputs, units=(ALL, ALL), processing=HOSTILE)
    modes = replace(examples.modes(), output_dofs=outputs, geometry=None, processing=HOSTILE, notes=HOSTILE)
    changed = replace(diagram, response=response, notes=HOSTILE)
    path = report((modes, changed), tmp_path / "r.html", title=ALL, source=ALL, command=ALL)
    page = browser.new_page()
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    assert page.evaluate("[...document.scripts].filter((each) => !each.id.startsWith('alive')).length") == 0
    assert page.evaluate("document.querySelectorAll('iframe, [onerror], [onload]').length") == 0
    assert page.title() != "run"
    sizes = page.evaluate(DRAWN)
    assert sizes
    assert min(map(min, sizes)) > 100
    assert not set(path.read_bytes()) & {0, 27, 12}
    page.close()
    assert all(url.startswith(("data:", "file:")) for url in asked)
