"""One picture in three painters: Matplotlib, SVG and the page's canvas show the same marks and words."""

from __future__ import annotations

import base64
import re
import subprocess
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes

import modalscope as ms
from modalscope.interfaces.plot.diagrams import fit_errors_picture, indicator_picture, stabilization_picture
from modalscope.interfaces.plot.intervals import intervals_picture
from modalscope.interfaces.plot.matrices import mac_picture
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import INKS, Line, Marks, Picture
from modalscope.interfaces.plot.responses import response_picture
from modalscope.interfaces.plot.shapes import shape_picture
from modalscope.interfaces.plot.web.blob import picture_blob
from modalscope.interfaces.plot.web.svg import envelope, svg
from tests.interfaces.app.server import until
from tests.interfaces.plot import examples
from tests.support import ROOT

MODES = examples.modes()

PICTURES: dict[str, Callable[[], Picture]] = {
    "stabilization diagram": lambda: stabilization_picture([examples.diagram()], MODES),
    "indicator": lambda: indicator_picture(examples.response(), MODES),
    "response": lambda: response_picture(examples.response(), MODES, 1, 1),
    "MAC": lambda: mac_picture(MODES),
    "shape as bars": lambda: shape_picture(ms.systems.chain5().modes(), 1),
    "intervals": lambda: intervals_picture(_sure(), "frequency"),
    "orders": lambda: fit_errors_picture(examples.diagram()),
}


def _sure() -> ms.ModalModel:
    modes = ms.systems.chain5().modes()
    return ms.ModalModel(
        poles=modes.poles, shapes=modes.shapes, frequencies_std=np.full(5, 1e-3), damping_ratios_std=np.full(5, 1e-4)
    )


def words_of(picture: Picture) -> set[str]:
    """Return what a picture says, but for round numbers at its axes, which each painter may choose."""
    words = {item.words for item in picture.key()}
    for panel in picture.panels:
        words |= {panel.title, panel.y.label} | {name for _, name in panel.marked}
        words |= {text for item in panel.items for text in getattr(item, "texts", ())}
        words |= {name for _, name in panel.y.named or ()}
        words |= {panel.behind[0].label} if panel.behind else set()
    return (words | {picture.panels[-1].x.label}) - {""}


def marks_of(picture: Picture) -> int:
    """Return how many marks a picture has, where its panels show them."""
    count = 0
    for panel in picture.panels:
        for item in panel.items:
            if isinstance(item, Marks) or (isinstance(item, Line) and item.mark):
                count += int(np.count_nonzero(np.isfinite(item.y)))
    return count


def drawn_words(axes: list[Axes]) -> set[str]:
    found: set[str] = set()
    for ax in axes:
        texts = [*ax.texts, ax.title, ax._left_title, ax.xaxis.label, ax.yaxis.label]  # type: ignore[attr-defined]
        texts += [
            *ax.get_xticklabels(),
            *ax.get_yticklabels(),
            *(legend.get_texts() if (legend := ax.get_legend()) else ()),
        ]
        found |= {text.get_text() for text in texts}
    return found


@pytest.mark.parametrize("name", PICTURES)
def test_matplotlib_shows_the_marks_and_words_of_a_picture(name: str) -> None:
    picture = PICTURES[name]()
    axes = painted(picture).figure.axes
    assert words_of(picture) <= drawn_words(axes)
    lines = [line for ax in axes for line in ax.get_lines() if line.get_marker() not in ("", "None")]
    dots = [
        c for ax in axes for c in ax.collections if hasattr(c, "get_offsets") and type(c).__name__ == "PathCollection"
    ]
    count = sum(np.count_nonzero(np.isfinite(np.asarray(line.get_ydata(), dtype=float))) for line in lines)
    assert count + sum(len(c.get_offsets()) for c in dots) == marks_of(picture)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", PICTURES)
def test_svg_shows_the_marks_and_words_of_a_picture(name: str) -> None:
    picture = PICTURES[name]()
    tree = ElementTree.fromstring(svg(picture, 900, 600))
    assert words_of(picture) <= {unescape(node.text or "") for node in tree.iter("text")}
    # a mark is a path of its own movement, lower-case from its centre; marks at one place are drawn once, and the key has one a line
    paths = [path.attrib["d"] for path in tree.iter("path")]
    stamps = sum(len(re.findall(r"M-?\d+ -?\d+[mh]", d)) for d in paths)
    in_key = sum(isinstance(item, Marks) for item in picture.key())
    assert 0.9 * marks_of(picture) <= stamps - in_key - _horizontal(picture) <= marks_of(picture)


def _horizontal(picture: Picture) -> int:
    """Return the samples of lines in the key, which are drawn like a mark."""
    return sum(isinstance(item, Line) for item in picture.key())


#: A page with the painter of the front end alone.
_ENTRY = """
import "./style.css";
import { fromBase64, unpack } from "./blob.js";
import { makePicture } from "./picture.js";
const place = document.getElementById("place");
globalThis.paint = (packed) => {
  place.textContent = "";
  globalThis.picture = makePicture(place);
  globalThis.picture.set(unpack(fromBase64(packed)));
};
globalThis.inked = () => {
  const canvas = place.querySelector("canvas");
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return pixels.reduce((sum, value, i) => sum + (i % 4 === 3 && value > 0), 0);
};
"""


@pytest.mark.slow
def test_the_canvas_of_the_page_shows_the_marks_and_words_of_every_picture(browser: Any, tmp_path: Path) -> None:
    esbuild, source = ROOT / "page" / "node_modules" / ".bin" / "esbuild", ROOT / "page" / "src"
    if not esbuild.exists():
        pytest.skip("the tools of the front end are not installed: make page")
    made = ("--bundle", "--format=iife", f"--outfile={tmp_path / 'page.js'}", "--log-level=error")
    subprocess.run([esbuild, *made], input=_ENTRY, text=True, check=True, cwd=source)
    place = '<div id="place" style="width: 900px; height: 600px"></div>'
    links = '<link rel="stylesheet" href="page.css"><body class="ms">'
    (tmp_path / "page.html").write_text(f'{links}{place}<script src="page.js"></script>', encoding="utf-8")
    page = browser.new_page()
    page.goto(f"file://{tmp_path / 'page.html'}")
    for name, make in PICTURES.items():
        picture = make()
        page.evaluate("packed => paint(packed)", base64.b64encode(picture_blob(picture)).decode())
        until(lambda: page.evaluate("picture.told.words.length"))
        told = page.evaluate("picture.told")
        assert words_of(picture) <= set(told["words"]), name
        assert told["marks"] == marks_of(picture), name
        assert page.evaluate("inked()") > 2000, name
    page.close()


def test_inks_of_the_page_are_those_of_all_painters() -> None:
    style = (ROOT / "page" / "src" / "style.css").read_text(encoding="utf-8")
    found = dict(re.findall(r"--ink-(\w+): (light-dark\([^)]*\))", style))
    assert found == {name: f"light-dark({light}, {dark})" for name, (light, dark) in INKS.items()}


def test_a_line_is_thinned_to_the_ends_of_its_columns_and_keeps_its_gaps() -> None:
    x, y = np.arange(1000.0), np.sin(np.arange(1000.0))
    y[400:450] = np.nan
    drawn_x, drawn_y = envelope(x, y, 20)
    assert len(drawn_x) < 150
    assert np.nanmax(drawn_y) == np.nanmax(y)
    assert np.nanmin(drawn_y) == np.nanmin(y)
    assert np.isnan(drawn_y).sum() == 50
    assert len(envelope(x, np.full(1000, np.nan), 20)[0]) == 1000  # nothing is known: all gap
