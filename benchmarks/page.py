"""The page measures itself in a browser (?bench), on made-up data: 200 000 points, 20 000 poles, 10 000 nodes that move.

Goals: 1.5 s to interactive, a click in the table within 100 ms, the slider within 150 ms, 30 frames a second, 300 MB. Memory is all that
the tab's process has to itself; the browser has no graphics card, as on a remote desktop.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from tests.interfaces.app.server import built, served
from tests.support import BROWSER, CHROMIUM

#: What the page tells -> words, unit, and its goal.
GOALS = {
    "interactive": ("interactive", "ms", 1500),
    "click": ("click to table", "ms", 100),
    "slider": ("order slider", "ms", 150),
    "frames": ("animation of 10 000 nodes", "frames/s", 30),
    "memory": ("memory of the tab", "MB", 300),
}


def memory(browser: Any) -> float | None:
    """Return the megabytes that the tab's process shares with no other, where the system tells them."""
    processes = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    maps = [Path(f"/proc/{each['id']}/smaps_rollup") for each in processes if each["type"] == "renderer"]
    if not all(path.is_file() for path in maps):
        return None
    lines = [line.split() for path in maps for line in path.read_text().splitlines() if line.startswith("Private_")]
    return sum(int(kilobytes) for _, kilobytes, _ in lines) / 1e3


def main() -> None:
    """Print what the page says of itself."""
    if CHROMIUM is None or not built():
        print("no chromium, or the front end is not built: make page")
        return
    folder = Path(tempfile.mkdtemp())
    with served(folder, folder) as server, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=BROWSER)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(server.address + "&bench")
        end = time.monotonic() + 120
        while not (told := page.evaluate("globalThis.benched")):
            assert time.monotonic() < end, "the page did not finish"
            time.sleep(0.1)
        told["memory"] = memory(browser)
        browser.close()
    for name, (words, unit, goal) in GOALS.items():
        value = told.get(name)
        print(f"{words:28} {'-' if value is None else f'{value:8.1f}'} {unit:9} (goal {goal})")


if __name__ == "__main__":
    main()
