"""Format numbers and build self-contained HTML: sections, tables and pictures.

The file contains all that a browser needs: the style, and the pictures as data. Text of the user is escaped where it is inserted.
"""

from __future__ import annotations

import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from modalscope.interfaces.plot.picture import Picture
from modalscope.interfaces.plot.web.svg import STYLE, inks, svg
from modalscope.numerics.errors import printable

#: The page loads nothing from outside, whatever the file contains.
_POLICY = "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"

#: Characters of the head of a column that is not broken into lines.
_SHORT = 8


def heading(key: str) -> str:
    """Return the name of a field as a heading: `frequency_spread_hz` as `frequency spread [Hz]`."""
    words = key.removesuffix("_hz").replace("_", " ")
    if key.endswith("_hz"):
        return f"{words} [Hz]"
    return f"{words} [%]" if in_percent(key) else words


def in_percent(key: str) -> bool:
    """Whether a field is a ratio given in per cent."""
    return "damping_ratio" in key or key.endswith(("_loss", "fit_error"))


def value(key: str, content: Any) -> str:
    """Return the value of a field in words or with four digits."""
    if content is None:
        return "–"
    if isinstance(content, bool | np.bool_):
        return "yes" if content else "no"
    if isinstance(content, numbers.Integral):
        return str(int(content))
    if isinstance(content, numbers.Real):
        number = float(content) * (100 if in_percent(key) else 1)
        return f"{number:.4g}" if np.isfinite(number) else "–"
    if isinstance(content, Mapping):
        return ", ".join(f"{k} {value(str(k), v)}" for k, v in content.items())
    if isinstance(content, np.ndarray) and content.size > 12:
        return f"array of shape {content.shape}"
    if isinstance(content, Iterable) and not isinstance(content, str):
        return ", ".join(value(key, item) for item in content)
    return str(content)


def escaped(text: str) -> str:
    """Return plain text as HTML, with markup and control characters escaped."""
    return escape(printable(text))


@dataclass(frozen=True)
class Section:
    """A section of a page.

    `anchor`: its name in links, a single word. `title`: plain text. `body`: HTML.
    """

    anchor: str
    title: str
    body: str

    def html(self) -> str:
        """Return the section as HTML."""
        return f'<section id="{escaped(self.anchor)}">\n<h2>{escaped(self.title)}</h2>\n{self.body}\n</section>'


def page(title: str, subtitle: str, sections: Iterable[Section], generator: str) -> str:
    """Return the whole document.

    `title`, `subtitle`, `generator`: plain text: the heading, the line below it, and the program. `sections`: in the order of reading;
    each gets a link at the top.
    """
    parts = [Path(__file__).with_name(name) for name in ("page.html", "report.css")]
    template, style = (part.read_text(encoding="utf-8") for part in parts)
    listed = list(sections)
    links = "".join(f'<a href="#{escaped(s.anchor)}">{escaped(s.title)}</a>' for s in listed)
    dark = f"@media (prefers-color-scheme: dark) {{ @media screen {{ :root {{ {inks(dark=True)} }} }} }}"
    style = f":root {{ {inks(dark=False)} }}\n{dark}\n{style}{STYLE}"
    texts = {"title": escaped(title), "subtitle": escaped(subtitle), "generator": escaped(generator)}
    body = "\n".join(s.html() for s in listed)
    return Template(template).substitute(texts, policy=_POLICY, style="\n" + style, links=links, sections=body)


def paragraph(text: str, kind: str = "") -> str:
    """Return plain text as a paragraph, optionally of a class of the style."""
    return f'<p class="{kind}">{escaped(text)}</p>' if kind else f"<p>{escaped(text)}</p>"


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    words: Sequence[int] = (),
    shades: Sequence[Sequence[float]] | None = None,
    graded: int | None = None,
    caption: str = "",
) -> str:
    """Return a table of plain text.

    `words`: columns of words, left-aligned; the others are numbers. `shades`: darkness of every cell, 0 to 1. `graded`: the column of
    grades, coloured by their first words.
    """
    kinds = [' class="words"' if i in words else "" for i in range(len(head))]
    parts = ['<div class="scroll"><table>']
    if caption:
        parts.append(f"<caption>{escaped(caption)}</caption>")
    short = [kind or (' class="short"' if len(cell) <= _SHORT else "") for cell, kind in zip(head, kinds, strict=True)]
    top = "".join(f'<th scope="col"{kind}>{escaped(cell)}</th>' for cell, kind in zip(head, short, strict=True))
    parts.append(f"<thead><tr>{top}</tr></thead><tbody>")
    for i, row in enumerate(rows):
        cells = []
        for j, (cell, kind) in enumerate(zip(row, kinds, strict=True)):
            shade = 0.0 if shades is None else shades[i][j]
            style = f' style="--shade:{100 * shade:.0f}%"' if shade > 0 else ""
            text = escaped(cell)
            text = f'<b class="grade {text.split()[0]}">{text}</b>' if j == graded else text
            cells.append(f"<td{kind}{style}>{text}</td>")
        parts.append(f"<tr>{''.join(cells)}</tr>")
    parts.append("</tbody></table></div>")
    return "".join(parts)


def folded(title: str, body: str) -> str:
    """Return HTML that is folded on screen and open on paper."""
    return f"<details><summary>{escaped(title)}</summary>{body}</details>"


def listing(pairs: Iterable[tuple[str, str]]) -> str:
    """Return names and values as a definition list."""
    return f"<dl>{''.join(f'<dt>{escaped(k)}</dt><dd>{escaped(v)}</dd>' for k, v in pairs)}</dl>"


def numbered(items: Iterable[tuple[str, str]]) -> str:
    """Return a numbered list of names in bold and sentences."""
    return f"<ol>{''.join(f'<li><b>{escaped(name)}</b> {escaped(text)}</li>' for name, text in items)}</ol>"


def script(text: str) -> str:
    """Return program text."""
    return f"<pre><code>{escaped(text)}</code></pre>"


def figure(picture: Picture, caption: str = "", width: float = 490, height: float | None = None) -> str:
    """Return a figure with its picture as SVG of that many pixels; `caption`: plain text below it."""
    below = f"<figcaption>{escaped(caption)}</figcaption>" if caption else ""
    return f"<figure>{svg(picture, width, height)}{below}</figure>"
