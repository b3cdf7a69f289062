"""A whole job in a real browser, and what a browser must not do: run what is written in labels, ask elsewhere, hide a control."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.io.analysis import analysis_from
from tests.interfaces.app.server import HOSTILE, Served, built, until
from tests.support import ROOT

AXE = ROOT / "page" / "node_modules" / "axe-core" / "axe.min.js"


class Window:
    """A window on the page: what it asks and says is written down."""

    def __init__(self, browser: Any, server: Served) -> None:
        self.asked: list[str] = []
        self.said: list[str] = []
        self.server = server
        self.context = browser.new_context(viewport={"width": 1280, "height": 800}, reduced_motion="reduce")
        self.page = self.context.new_page()
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.goto(server.address)

    def until(self, question: str, seconds: float = 60.0) -> Any:
        """Ask the page until it answers yes; it forbids itself what `wait_for_function` does."""
        return until(lambda: self.page.evaluate(question), seconds)

    def open(self, name: str) -> None:
        self.page.locator(".welcome .row b", has_text=name).first.click()
        self.until("!!globalThis.modalscope?.state.key")
        self.page.locator(".diagram").wait_for()

    def set_orders(self, orders: tuple[int, int]) -> None:
        for field, value in zip(("first", "last"), orders, strict=True):
            self.page.fill(f"[aria-label='Orders: {field}']", str(value))
        self.page.keyboard.press("Enter")
        self.until(f"modalscope.state.document.orders?.at(-1) === {orders[1]}")
        self.done()

    def done(self) -> None:
        settled = "!modalscope.pending && !modalscope.found?.early"
        self.until(f"['done', 'failed'].includes(modalscope.state.stage.stage) && {settled}")
        assert self.page.evaluate("modalscope.state.failed") is None

    def document(self) -> Any:
        return analysis_from(self.page.evaluate("modalscope.state.document"))

    def shows(self, modes: int) -> None:
        """Wait until the table has this many modes: a page draws when its browser finds time."""
        until(lambda: self.page.locator(".modes tbody tr").count() == modes, 20)

    def download(self, press: Any) -> Path:
        with self.page.expect_download() as waiting:
            press()
        path = Path(waiting.value.path())
        return path.rename(path.with_name(waiting.value.suggested_filename))


@pytest.fixture
def window(browser: Any, server: Served) -> Iterator[Window]:
    if not built():
        pytest.skip("the front end of the page is not built: make page")
    made = Window(browser, server)
    yield made
    elsewhere = [url for url in made.asked if not url.startswith((made.server.base, "data:", "blob:"))]
    assert not elsewhere
    assert not [text for text in made.said if "GPU" not in text and "GL" not in text]
    made.context.close()


#: Where a stable pole of the second mode is on the screen.
POLE = """(() => {
    const { frequency, kind } = modalscope.poles;
    const f = modalscope.found.modes[1].frequency;
    let best = -1;
    for (let i = 0; i < frequency.length; i++) if (kind[i] === 4 && Math.abs(frequency[i] - f) < 0.01 * f) best = i;
    return modalscope.diagram.at(best);
})()"""

#: Writes down what the page says while it computes.
LISTEN = """
    globalThis.seen = new Set();
    const place = document.querySelector('.status');
    new MutationObserver(() => seen.add(place.innerText)).observe(place, {childList: true, subtree: true, characterData: true});
"""


def drag_a_band(window: Window) -> None:
    """Drag a band on the strip: poles appear order by order."""
    page = window.page
    page.evaluate(f"(() => {{{LISTEN}}})()")
    box = page.locator(".strip canvas").first.bounding_box()
    page.mouse.move(box["x"] + 24, box["y"] + 30)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.5, box["y"] + 30, steps=4)
    page.mouse.move(box["x"] + box["width"] * 0.93, box["y"] + 30)
    page.mouse.up()
    window.until("modalscope.state.document.bands.length === 1")
    window.done()
    assert page.evaluate("[...seen].filter((text) => /^orders \\d+ of/.test(text)).length") > 3
    window.shows(5)


def refuse_by_a_click(window: Window) -> None:
    """Refuse the second mode by a click on a pole of it: at once in the table, and then in the result."""
    page = window.page
    refused = page.evaluate("modalscope.found.modes[1].frequency")
    page.mouse.move(*page.evaluate(POLE))
    page.mouse.click(*page.evaluate(POLE))
    window.shows(4)
    window.until("modalscope.state.document.refused.length === 1")
    window.done()
    assert window.document().refused == (refused,)
    assert refused not in page.evaluate("modalscope.found.modes.map((m) => m.frequency)")


def take_back_and_refuse_by_key(window: Window) -> None:
    """What was refused stands below the table, and is taken from there; x refuses the chosen mode."""
    window.page.get_by_role("button", name="restore").click()
    window.until("modalscope.state.document.refused.length === 0")
    window.done()
    window.shows(5)
    window.page.keyboard.press("x")
    window.until("modalscope.state.document.refused.length === 1")
    window.done()


def stands(picture: Any) -> bool:
    """Two looks, some frames apart, see the same."""
    before = picture.screenshot()
    time.sleep(0.2)
    return bool(picture.screenshot() == before)


def watch_it_move(window: Window) -> None:
    """The shape stands still for who wants no motion, moves on its geometry when it is told to, and stops again."""
    page = window.page
    moving = page.locator(".shape .plot")
    until(lambda: stands(moving), 20)
    first = moving.screenshot()
    page.keyboard.press(" ")
    until(lambda: moving.screenshot() != first, 20)
    page.keyboard.press(" ")
    until(lambda: stands(moving), 20)
    still = moving.screenshot()
    assert page.evaluate("modalscope.found.nodes.length") == 4
    page.keyboard.press("2")
    until(lambda: moving.screenshot() != still, 20)


def choose_the_indicator_and_mark_peaks(window: Window) -> None:
    """Another indicator stands behind the poles when it is chosen; m marks the peaks of the curve, and again takes the marks away."""
    page = window.page
    diagram, response = page.locator(".diagram .plot"), page.locator(".response .plot")
    until(lambda: stands(diagram), 20)
    before = diagram.screenshot()
    page.get_by_label("Curves behind the poles").select_option("mmif")
    until(lambda: diagram.screenshot() != before, 20)
    page.evaluate("document.activeElement.blur()")
    until(lambda: stands(response), 20)
    plain = response.screenshot()
    page.keyboard.press("m")
    until(lambda: response.screenshot() != plain, 20)
    page.keyboard.press("m")
    until(lambda: response.screenshot() == plain, 20)


@pytest.mark.slow
def test_a_whole_job(window: Window) -> None:
    page = window.page
    window.open("chain.uff")
    window.set_orders((2, 20))
    assert "token" not in page.url
    window.shows(5)
    drag_a_band(window)
    refuse_by_a_click(window)
    take_back_and_refuse_by_key(window)
    watch_it_move(window)
    choose_the_indicator_and_mark_peaks(window)

    # exported modes are those of the document, done again from the file
    again = ms.replay(window.document()).modes
    page.keyboard.press("e")
    written = ms.read(window.download(lambda: page.get_by_role("menuitem", name=".uff").click()))
    assert written.frequencies == pytest.approx(again.frequencies, rel=1e-5)  # universal files hold six digits
    assert page.evaluate("modalscope.found.modes.map((m) => m.frequency)") == list(again.frequencies)

    # a reload finds everything as it was; undo takes the last choice back; a report is one file
    page.reload()
    window.until("!!globalThis.modalscope?.found && !modalscope.found.early")
    window.shows(4)
    page.keyboard.press("Control+z")
    window.until("modalscope.state.document.refused.length === 0")
    window.done()
    window.shows(5)
    report = window.download(lambda: page.keyboard.press("r"))
    assert report.suffix == ".html"
    assert b"Mode shapes" in report.read_bytes()


@pytest.mark.slow
def test_labels_run_nothing_and_names_are_text(window: Window) -> None:
    window.open("hostile.analysis.json")
    window.done()
    page = window.page
    page.keyboard.press("n")
    page.keyboard.type(HOSTILE)
    page.keyboard.press("Enter")
    window.until("Object.keys(modalscope.state.document.names).length === 1")
    window.done()
    until(lambda: HOSTILE in page.locator(".modes tbody").inner_text(), 20)
    until(lambda: HOSTILE in page.locator(".response select").first.inner_text(), 20)
    assert page.title() == "modalscope"
    assert page.evaluate("document.querySelectorAll('img, .ms script').length") == 0


@pytest.mark.slow
def test_every_method_is_compared_by_a_click(window: Window, server: Served, key: str) -> None:
    page = window.page
    page.goto(f"{server.base}/#{key}")
    window.until("!!globalThis.modalscope?.found")
    window.done()
    page.get_by_role("button", name="compare").click()
    page.locator("dialog.wide").wait_for(timeout=60_000)
    modes, methods = page.locator("dialog.wide tbody").all()
    assert [float(cell) for cell in modes.locator("td:nth-child(2)").all_inner_texts()] == pytest.approx(
        ms.systems.chain5().modes().frequencies, rel=0.01
    )
    assert methods.locator("tr").count() > 5
    window.until("[...document.querySelectorAll('dialog img')].every((i) => i.complete && i.naturalWidth > 0)")
    page.keyboard.press("Escape")
    window.until("!document.querySelector('dialog')")


@pytest.mark.slow
def test_what_to_measure_next_is_asked_and_answered(window: Window, server: Served, key: str) -> None:
    page = window.page
    page.goto(f"{server.base}/#{key}")
    window.until("!!globalThis.modalscope?.found")
    window.done()
    page.keyboard.press("w")
    wish = page.get_by_label("What is asked of the modes")
    page.locator(".next p", has_text="Asked: damping ±5 %").wait_for()
    wish.fill("f 90 %")
    page.get_by_role("button", name="answer").click()
    page.locator(".next p", has_text="stop here").wait_for()
    assert page.evaluate(UNNAMED) == 0


#: Controls that nobody who cannot see them could tell apart.
UNNAMED = """[...document.querySelectorAll('button, select, input, textarea')].filter((e) =>
    !(e.getAttribute('aria-label') || e.title || e.textContent.trim() || e.closest('label'))).length"""


@pytest.mark.slow
def test_nothing_serious_stands_in_the_way_of_anybody(window: Window, server: Served, key: str) -> None:
    if not AXE.is_file():
        pytest.skip("axe-core is not installed: make page")
    axe = AXE.read_text(encoding="utf-8")
    page = window.page

    def found() -> list[str]:
        page.evaluate(f"{axe}; undefined")
        told = page.evaluate("axe.run(document, {resultTypes: ['violations']})")["violations"]
        return [f"{v['id']}: {v['nodes'][0]['html'][:120]}" for v in told if v["impact"] in ("serious", "critical")]

    page.locator(".drop").wait_for()
    assert found() == []
    page.goto(f"{server.base}/#{key}")
    window.until("!!globalThis.modalscope?.found")
    window.done()
    assert found() == []
    page.keyboard.press("d")
    assert found() == []
    page.keyboard.press("Shift+?")
    page.locator("dialog").wait_for()
    assert found() == []
    page.keyboard.press("Escape")
    window.until("!document.querySelector('dialog')")
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
    assert page.evaluate(UNNAMED) == 0


@pytest.mark.slow
def test_a_bad_file_is_told_where_it_is_dropped(window: Window, folder: Path) -> None:
    page = window.page
    with page.expect_file_chooser() as chooser:
        page.locator(".drop").click()
    chooser.value.set_files(str(folder / "broken.uff"))
    page.locator("[role=alert]").wait_for()
    told = page.locator("[role=alert]").inner_text()
    assert "broken.uff" in told
    assert page.get_by_role("button", name="again").count() == 1


@pytest.mark.slow
def test_lines_of_the_geometry_are_drawn_by_clicks(window: Window) -> None:
    page = window.page
    window.open("chain.uff")
    window.set_orders((2, 12))
    page.get_by_role("button", name="geometry…").click()
    sketch, lines = page.locator("canvas.sketch"), page.get_by_label("Lines: pairs of nodes")
    box, written = sketch.bounding_box(), lines.input_value().split()
    assert (
        len(page.get_by_label("Points: node,x,y,z").input_value().split()) == 5
    )  # the head and the nodes that are there
    ends = [box["x"] + 20, box["x"] + box["width"] - 20]

    def join() -> None:
        for x in ends:
            page.mouse.click(x, box["y"] + box["height"] / 2)

    join()
    first, last = written[0].split(",")[0], written[-1].split(",")[1]
    assert lines.input_value().split() == [*written, f"{first},{last}"]
    join()  # again takes the line away
    assert lines.input_value().split() == written
    page.get_by_role("dialog").get_by_role("button", name="undo").click()
    page.get_by_role("button", name="Apply").click()
    window.until("modalscope.state.document.files[0].reading.geometry?.length === 2")
    window.done()
    assert page.evaluate("modalscope.found.lines.length / 2") == len(written) + 1


@pytest.mark.slow
def test_options_of_the_method_are_written_as_in_python(window: Window, tmp_path: Path) -> None:
    page = window.page
    window.open("chain.uff")
    window.set_orders((2, 12))
    before = page.evaluate("JSON.stringify(modalscope.found.modes.map((m) => m.frequency))")
    page.locator("summary", has_text="Expert").click()
    field = page.get_by_label("Options of the method")
    field.fill("block_rows=9; form=observable")
    field.press("Enter")
    window.until("modalscope.state.document.options.block_rows === 9")
    window.done()
    assert window.document().options == {"block_rows": 9, "form": "observable"}
    assert page.evaluate("JSON.stringify(modalscope.found.modes.map((m) => m.frequency))") != before
    field.fill("block_rowz=9")
    field.press("Enter")
    page.locator("[role=alert]").wait_for()
    assert "block_rows" in page.locator("[role=alert]").inner_text()
    page.screenshot(path=str(tmp_path / "expert.png"))
    page.get_by_role("button", name="change the option").click()
    field.fill("")
    field.press("Enter")
    window.until("Object.keys(modalscope.state.document.options).length === 0")
    window.done()


@pytest.mark.slow
def test_one_output_is_drawn_neither_as_shape_nor_as_mac(window: Window, tmp_path: Path) -> None:
    ms.write(
        tmp_path / "one.npz", ms.systems.chain5().frequency_response(np.arange(0.2, 9, 0.05), outputs=[0], inputs=[0])
    )
    page = window.page
    with page.expect_file_chooser() as chooser:
        page.locator(".drop").click()
    chooser.value.set_files(str(tmp_path / "one.npz"))
    window.until("!!globalThis.modalscope?.state.key")
    window.done()
    until(lambda: "a shape of one number says nothing" in page.locator(".plot.shape").inner_text(), 20)
    assert "shapes cannot be compared" in page.locator(".panel.matrix").inner_text()
