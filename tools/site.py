"""Checks of the built documentation site: links that lead nowhere, requests to anywhere, figures that drifted, pages that some cannot use.

`python -m tools.site build/docs`; pages are tried in a browser where playwright, a chromium and axe-core are at hand.
"""

from __future__ import annotations

import shutil
import sys
from html.parser import HTMLParser
from importlib.util import find_spec
from os.path import normpath
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from tools.held import drifted

#: Where make docs puts axe-core.
AXE = Path("build/npm/node_modules/axe-core/axe.min.js")

#: Pages that are tried in a browser: one of each kind.
TRIED = (
    "index.html",
    "trust.html",
    "coming-from.html",
    "generated/start/plot_1_hammer.html",
    "generated/howto/index.html",
    "generated/executed/plot_3_era.html",
    "generated/table/index.html",
    "generated/table/alternate-s.html",
    "generated/reference/index.html",
    "generated/reference/modalscope.analyze.html",
    "search.html",
)

#: What a browser fetches without being asked.
FETCHED = {("script", "src"), ("img", "src"), ("iframe", "src"), ("source", "src"), ("video", "src"), ("audio", "src")}


class _Page(HTMLParser):
    """Links, anchors, and what a page fetches."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        # a canonical address or a link to the next page is fetched by nobody
        if tag == "link" and given.get("rel") in ("stylesheet", "preload", "icon", "shortcut icon"):
            self.fetched.append(given.get("href", ""))
        self.fetched += [given[name] for kind, name in FETCHED if kind == tag and name in given]


def problems(root: Path) -> list[str]:
    """Return what is wrong with the pages below a folder, as sentences."""
    root = root.resolve()
    pages = {path: _read(path) for path in sorted(root.rglob("*.html")) if "_static" not in path.parts}
    found = []
    for path, page in pages.items():
        name = path.relative_to(root)
        found += [f"{name} fetches {each}" for each in page.fetched if urlsplit(each).netloc]
        found += [f"{name} wants {each}" for each in page.fetched if not _there(path, each)]
        found += [f"{name} links to {each}" for each in page.links if not _leads(path, each, pages)]
    return found


def _read(path: Path) -> _Page:
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def _target(path: Path, link: str) -> Path:
    there = unquote(urlsplit(link).path)
    return Path(normpath(path.parent / there)) if there else path


def _there(path: Path, link: str) -> bool:
    return bool(urlsplit(link).scheme) or bool(urlsplit(link).netloc) or _target(path, link).is_file()


def _leads(path: Path, link: str, pages: dict[Path, _Page]) -> bool:
    """Whether a link leads to a file, and its fragment to an anchor there; links to other places are the reader's choice."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return True
    target = _target(path, link)
    if not target.is_file():
        return False
    known = pages.get(target)
    return not parts.fragment or known is None or unquote(parts.fragment) in known.anchors


def tried(root: Path) -> list[str]:
    """Return what a browser says: requests to other places, sideways scrolling at 400 px, and what axe-core finds."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None or find_spec("playwright") is None or not AXE.is_file():
        return []
    from playwright.sync_api import sync_playwright

    found: list[str] = []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.on("request", lambda request: _noted(request.url, found))
        for name in TRIED:
            page.set_viewport_size({"width": 1200, "height": 900})
            page.goto((root / name).resolve().as_uri(), wait_until="load")
            page.add_script_tag(path=str(AXE))
            page.wait_for_timeout(300)
            found += [f"{name}: {each}" for each in _axe(page)]
            page.set_viewport_size({"width": 400, "height": 800})
            spill = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            found += [f"{name} is {spill} px too wide at 400 px"] if spill > 0 else []
        page.goto((root / "search.html").resolve().as_uri() + "?q=damping")
        found += [] if _comes(page, "#search-results li") else ["search.html finds nothing for damping"]
        browser.close()
    return found


def _comes(page: Any, place: str) -> bool:
    """Whether something comes to stand at a place of a page, on however busy a machine: nobody waits longer when it comes at once."""
    from playwright.sync_api import TimeoutError as Late

    try:
        page.locator(place).first.wait_for(state="attached", timeout=60_000)
    except Late:
        return False
    return True


def _noted(url: str, found: list[str]) -> None:
    if urlsplit(url).scheme not in ("file", "data", "blob", "about"):
        found.append(f"a page asks {url}")


def _axe(page: Any) -> list[str]:
    """Return the rules that a page breaks, with the first element of each."""
    wanted = "axe.run(document, {runOnly: ['wcag2a', 'wcag2aa']})"
    told = page.evaluate(
        f"{wanted}.then(r => r.violations.map(v => [v.id, v.nodes.length, v.nodes[0].html.slice(0, 160)]))"
    )
    return [f"{rule} ({count} times), first {html}" for rule, count, html in told]


def main() -> int:
    """Print what is wrong, one line each."""
    root = Path(sys.argv[1] if len(sys.argv) > 1 else "build/docs")
    found = [*problems(root), *drifted(root), *tried(root)]
    for line in found:
        print(line)
    return min(len(found), 1)


if __name__ == "__main__":
    sys.exit(main())
