"""The report in a real browser, where one is installed."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from modalscope.reporting import report
from tests.plot import examples

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
def test_a_browser_asks_nobody_shows_every_picture_and_never_scrolls_sideways(tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    path = report((examples.modes(), examples.diagram()), tmp_path / "r.html")
    asked: list[str] = []
    said: list[str] = []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.on("console", lambda message: said.append(message.text))
        page.goto(path.as_uri())
        sizes = page.evaluate("[...document.images].map(image => [image.complete, image.naturalWidth])")
        spill = []
        for width in (1200, 700, 380):
            page.set_viewport_size({"width": width, "height": 800})
            spill.append(page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))
        browser.close()
    assert [url for url in asked if not url.startswith("data:")] == [path.as_uri()]
    assert sizes
    assert all(complete and natural > 0 for complete, natural in sizes)
    assert max(spill) <= 0
    assert not said


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


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
@pytest.mark.filterwarnings("ignore:Glyph")
def test_hostile_labels_run_nothing_ask_nobody_and_are_drawn(tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    asked: list[str] = []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.on("request", lambda request: asked.append(request.url))
        for k, text in enumerate(HOSTILE):
            diagram = examples.diagram()
            outputs = (text, *diagram.response.output_dofs[1:])
            response = replace(diagram.response, output_dofs=outputs, units=(text, text), processing=(text,))
            modes = replace(examples.modes(), output_dofs=outputs, geometry=None, processing=(text,), notes=(text,))
            changed = replace(diagram, response=response, notes=(text,))
            path = report((modes, changed), tmp_path / f"{k}.html", title=text, source=text, command=text)
            before = path.read_bytes()
            page.goto(path.as_uri())
            assert page.evaluate("document.scripts.length") == 0, text
            assert page.title() != "run"
            sizes = page.evaluate("[...document.images].map(image => [image.complete, image.naturalWidth])")
            assert sizes
            assert all(complete and natural > 0 for complete, natural in sizes), text
            assert not set(before) & {0, 27, 12}, text
        browser.close()
    assert all(url.startswith(("data:", "file:")) for url in asked)
