"""What a test needs and does not find is said in words: extras are skipped, and so are measured data, which are counted.

With MODALSCOPE_NEED_DATA=1 missing data are failures. With MODALSCOPE_PART=K/N files of tests are parted into N, of which the K-th runs.
"""

from __future__ import annotations

import gc
import os
import re
import socket
import sys
from collections.abc import Callable, Generator, Iterator
from typing import Any
from zlib import crc32

import pytest

from tests.studies import Study, this_run, write
from tests.support import BROWSER, CHROMIUM, wanted_extra

#: How a test says that what it measures is missing (`tests.support.measured`).
MISSING = re.compile(r"(is|are) not there")

#: Helpers that need an extra: they hold no tests, and pytest would keep half a module of one that it cannot import.
collect_ignore = ["arguments.py", "io/apart.py", "io/bombs.py", "io/corpus.py", "io/packed_bombs.py"]


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Let the count of second tries go out at once: it waited 40 ms for the answer to the one before, longer than most tests take."""
    link = getattr(getattr(config, "failures_db", None), "sock", None)
    if link is not None:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


@pytest.hookimpl(tryfirst=True)
def pytest_collection() -> None:
    """Look for no garbage among tests that are only collected: nearly half of the time of that."""
    gc.disable()


@pytest.hookimpl(wrapper=True)
def pytest_collect_file() -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """Look for no examples in the docstrings of tests: there are none."""
    return [each for each in (yield) if isinstance(each, pytest.Module)]


def pytest_collection_finish() -> None:
    gc.freeze()  # nor among them while they run
    gc.enable()


@pytest.fixture(autouse=True)
def _pictures_are_closed() -> Iterator[None]:
    """Close what a test has drawn: Matplotlib warns of more than 20 open figures, wherever the last of them is opened."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="module")  # an open driver holds the event loop of its thread, which other modules need
def browser() -> Iterator[Any]:
    """A browser for all tests of a module: skipped in words where there is none."""
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        made = driver.chromium.launch(executable_path=CHROMIUM, args=BROWSER)
        yield made
        made.close()


@pytest.fixture
def study(request: pytest.FixtureRequest) -> Iterator[Callable[[str, str], Study]]:
    """Open a study (its data, its seeds or cases) of the subject that the test's marker names; what it records is written to its page."""
    (subject,) = request.node.get_closest_marker("study").args
    opened: list[Study] = []

    def begun(data: str, cases: str) -> Study:
        opened.append(Study(subject, data, cases, this_run()))
        return opened[-1]

    yield begun
    write(opened)


@pytest.hookimpl(tryfirst=True)  # before -k chooses
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let `make study WORD=...` choose by subject, too, and `make test-slow PART=1/2` take the files of one part."""
    part, parts = map(int, os.environ.get("MODALSCOPE_PART", "1/1").split("/"))
    kept, others = (
        [i for i in items if (crc32(i.path.name.encode()) % parts == part - 1) is own] for own in (True, False)
    )
    config.hook.pytest_deselected(items=others)
    items[:] = kept
    for item in items:
        for mark in item.iter_markers("study"):
            item.extra_keyword_matches.update(mark.args)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[Any]) -> Generator[None, Any, Any]:
    report = yield
    wanted = wanted_extra(str(call.excinfo.value)) if report.failed and call.excinfo else None
    if wanted:
        report.outcome, report.longrepr = "skipped", (str(item.path), item.reportinfo()[1], f"Skipped: {wanted}")
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
