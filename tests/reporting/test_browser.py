"""The report in a real browser, where one is installed."""

from __future__ import annotations

import shutil
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
