"""Tests of measured data that are not there: skipped and counted, or failed where MODALSCOPE_NEED_DATA=1 says that they must be."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Generator, Iterator
from typing import Any

import pytest

#: How a test says that what it measures is missing (`tests.support.measured`).
MISSING = re.compile(r"(is|are) not there")


@pytest.fixture(autouse=True)
def _pictures_are_closed() -> Iterator[None]:
    """Close what a test has drawn: Matplotlib warns of more than 20 open figures, wherever the last of them is opened."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="module")  # an open driver holds the event loop of its thread, which other modules need
def browser() -> Iterator[Any]:
    """A browser for all tests of a module: skipped in words where there is none."""
    from tests.support import BROWSER, CHROMIUM

    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        made = driver.chromium.launch(executable_path=CHROMIUM, args=BROWSER)
        yield made
        made.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, Any]:
    report = yield
    if os.environ.get("MODALSCOPE_NEED_DATA") == "1" and _missing(report):
        report.outcome, report.longrepr = "failed", f"MODALSCOPE_NEED_DATA=1, but {report.longrepr[2]}"
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    count = sum(_missing(report) for report in terminalreporter.stats.get("skipped", ()))
    if count:
        terminalreporter.write_line(
            f"{count} tests skipped: their measured data are not there (tests/support.py says where)"
        )


def _missing(report: Any) -> bool:
    return report.skipped and isinstance(report.longrepr, tuple) and bool(MISSING.search(report.longrepr[2]))
