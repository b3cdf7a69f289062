"""Draw the pictures of the page in the README, light and dark: `python -m tools.page_picture` writes docs/page.png and docs/page-dark.png.

The page shows the measured beam in the band of its published modes, with the fifth mode chosen.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[1]
BEAM = ROOT / "examples" / "beam_hammer" / "beam_hammer.uff"

#: The band in Hz, and the mode that is shown.
BAND, MODE = (100, 4500), 5

DONE = "modalscope.state.stage?.stage === 'done' && !modalscope.pending && !modalscope.found?.early"


def until(page: Any, question: str, seconds: float = 300.0) -> None:
    """Wait until the page answers yes; it forbids itself what `wait_for_function` does."""
    end = time.monotonic() + seconds
    while not page.evaluate(question):
        if time.monotonic() > end:
            raise SystemExit(f"the page did not answer: {question}")
        time.sleep(0.1)


def draw(browser: Any, scheme: str, path: Path) -> None:
    """Open the beam in a page of its own and save what the window shows."""
    command = [sys.executable, "-m", "modalscope", "app", str(BEAM), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        address = server.stdout.readline().partition(": ")[2].strip()
        page = browser.new_page(viewport={"width": 1280, "height": 800}, color_scheme=scheme, reduced_motion="reduce")
        page.goto(address)
        until(page, "!!globalThis.modalscope?.state?.key")
        for value, name in zip(BAND, ("lowest", "highest"), strict=True):
            page.get_by_label(f"{name} frequency").fill(str(value))
        page.keyboard.press("Enter")
        until(page, f"modalscope.state.document.bands?.[0]?.[1] === {BAND[1]} && {DONE}")
        page.locator(f".modes tbody tr:nth-child({MODE})").click()
        time.sleep(1)
        page.screenshot(path=path)
        page.close()
        server.terminate()


if __name__ == "__main__":
    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        for scheme, name in (("light", "page.png"), ("dark", "page-dark.png")):
            draw(chromium, scheme, ROOT / "docs" / name)
        chromium.close()
