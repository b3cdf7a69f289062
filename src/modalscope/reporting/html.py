"""Build self-contained HTML: sections, tables, numbers, pictures and style.

Everything a reader's browser needs stands in the file: the style, and the pictures as data. Nothing is asked from
outside. What comes from the user is escaped where it enters.
"""

from __future__ import annotations

import base64
import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from string import Template
from typing import Any

import numpy as np

from modalscope.numerics.checks import Array
from modalscope.numerics.errors import printable

# --------------------------------------------------------------------------------------------------------------- style
# The look of a report on screen, in the dark and on paper.

STYLE = """
:root { --ink: #1f2933; --muted: #5b6773; --line: #dde3e8; --paper: #ffffff; --back: #f5f7f9; --accent: #0072b2; --shadow: #d55e00;
  --good: #00734f; }
@media (prefers-color-scheme: dark) { @media screen {
:root { --ink: #e4e8ec; --muted: #9aa7b3; --line: #333d47; --paper: #1b2229; --back: #12171c; --accent: #56b4e9; --shadow: #e69f00;
  --good: #4cc79b; }
} }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2rem 1.5rem 3rem; max-width: 1120px; background: var(--back); color: var(--ink);
  font: 15px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 0 0 .25rem; }
h2 { font-size: 1.15rem; margin: 0 0 .8rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .5rem; }
header p { margin: 0; }
.muted, figcaption, caption { color: var(--muted); }
nav { margin: 1rem 0 1.2rem; display: flex; flex-wrap: wrap; gap: .35rem 1.1rem; font-size: .9rem; }
a { color: var(--accent); text-decoration: none; }
a:hover { text-decoration: underline; }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 8px; padding: 1.2rem 1.4rem; margin: 0 0 1.1rem; }
p { margin: 0 0 .7rem; max-width: 75ch; }
.verdict { font-size: 1.12rem; }
.loud { font-weight: 600; color: var(--shadow); border-left: 4px solid var(--shadow); padding-left: .7rem; }
.grade { font-weight: 600; white-space: nowrap; }
.grade::before { content: "\\25cf\\00a0"; }
.grade.good, .grade.trusted { color: var(--good); }
.grade.look, .grade.frequency { color: var(--shadow); }
.grade.look::before, .grade.frequency::before { content: "\\25d0\\00a0"; }
.grade.doubtful { color: var(--ink); }
.grade.doubtful::before { content: "\\25cb\\00a0"; }
details { margin: 0 0 .9rem; }
summary { cursor: pointer; color: var(--accent); margin: 0 0 .6rem; }
.scroll { overflow-x: auto; margin: 0 0 .9rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92rem; }
caption { text-align: left; padding: 0 0 .35rem; font-size: .9rem; }
th, td { padding: .28rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; vertical-align: top; }
th { font-weight: 600; color: var(--muted); border-bottom-width: 2px; vertical-align: bottom;
  white-space: normal; }
th.words, td.words { text-align: left; }
td.words { white-space: normal; min-width: 6rem; }
td[style] { background: color-mix(in srgb, var(--shadow) var(--shade), transparent); }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.4rem; margin: 0 0 .9rem; font-size: .95rem; }
dt { color: var(--muted); }
dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 0 0 .9rem; }
figure img { display: block; width: 100%; height: auto; background: #fff; border-radius: 5px; }
figcaption { font-size: .9rem; margin-top: .35rem; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr)); gap: .8rem 1.2rem; }
.narrow { max-width: 640px; }
.narrow img { width: auto; max-width: 100%; }
pre { background: var(--back); border: 1px solid var(--line); border-radius: 5px; padding: .8rem 1rem;
  overflow-x: auto; font-size: .87rem; }
ol { margin: 0 0 1rem; padding-left: 1.6rem; }
li { margin: 0 0 .25rem; max-width: 90ch; }
li b { font-variant-numeric: tabular-nums; }
@media print {
  @page { margin: 15mm; }
  body { background: #fff; padding: 0; max-width: none; font-size: 10pt; }
  nav { display: none; }
  section { border: 0; border-radius: 0; padding: 0; margin: 0 0 6mm; }
  h2, h3, section > p { break-after: avoid; }
  figure, tr, li, dl, pre { break-inside: avoid; }
  .scroll { overflow: visible; }
  table { font-size: 8.5pt; }
  th, td { padding: .5mm 2mm; }
  pre { white-space: pre-wrap; }
  details::details-content { content-visibility: visible; block-size: auto; }
  summary { list-style: none; color: inherit; font-weight: 600; }
  .pair { grid-template-columns: 1fr 1fr; }
  td[style] { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""


# ------------------------------------------------------------------------------------------------------------- numbers
# Numbers and names as a reader wants them.


def decimals(frequencies: Array) -> int:
    """Return how many decimals give the lowest frequency about six digits, at least two and at most five."""
    positive = np.asarray(frequencies)[np.asarray(frequencies) > 0]
    if not positive.size:
        return 3
    return int(np.clip(5 - np.floor(np.log10(positive.min())), 2, 5))


def frequency(hertz: float) -> str:
    """Return a frequency with five digits and its unit."""
    return f"{hertz:.5g} Hz"


def percent(ratio: float, digits: int = 3) -> str:
    """Return a ratio in per cent; a dash where it is not known."""
    return f"{100 * ratio:.{digits}g} %" if np.isfinite(ratio) else "–"


def heading(key: str) -> str:
    """Return the name of a field as a heading: `frequency_spread_hz` as `frequency spread [Hz]`."""
    words = key.removesuffix("_hz").replace("_", " ")
    if key.endswith("_hz"):
        return f"{words} [Hz]"
    return f"{words} [%]" if in_percent(key) else words


def in_percent(key: str) -> bool:
    """Whether a field is a ratio that readers know in per cent."""
    return "damping_ratio" in key or key.endswith(("_loss", "fit_error"))


def value(key: str, found: Any) -> str:
    """Return the value of a field in words or with four digits."""
    if found is None:
        return "–"
    if isinstance(found, bool | np.bool_):
        return "yes" if found else "no"
    if isinstance(found, numbers.Integral):
        return str(int(found))
    if isinstance(found, numbers.Real):
        number = float(found) * (100 if in_percent(key) else 1)
        return f"{number:.4g}" if np.isfinite(number) else "–"
    if isinstance(found, Mapping):
        return ", ".join(f"{k} {value(str(k), v)}" for k, v in found.items())
    if isinstance(found, np.ndarray) and found.size > 12:
        return f"array of shape {found.shape}"
    if isinstance(found, Iterable) and not isinstance(found, str):
        return ", ".join(value(key, item) for item in found)
    return str(found)


def list_some(names: Iterable[str], most: int = 12) -> str:
    """Return names, the first ones only where they are many."""
    every = list(names)
    rest = len(every) - most
    return ", ".join(every[:most]) + (f" and {rest} more" if rest > 0 else "")


# ---------------------------------------------------------------------------------------------------------------- html

#: Nothing is asked from outside, whatever stands in the file.
_POLICY = "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"

_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="$policy">
<meta name="generator" content="$generator">
<title>$title</title>
<style>$style</style>
</head>
<body>
<header>
<h1>$title</h1>
<p class="muted">$subtitle, $generator</p>
</header>
<nav aria-label="Sections">$links</nav>
<main>
$sections
</main>
</body>
</html>
""")


def _escaped(text: str) -> str:
    """Return plain text as HTML: what means something there is escaped, and so is what a page cannot hold."""
    return escape(printable(text))


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it, already HTML.

    `anchor`: its name in links, a single word. `title`: plain text. `body`: HTML.
    """

    anchor: str
    title: str
    body: str

    def html(self) -> str:
        """Return the section as HTML."""
        return f'<section id="{_escaped(self.anchor)}">\n<h2>{_escaped(self.title)}</h2>\n{self.body}\n</section>'


def page(title: str, subtitle: str, sections: Iterable[Section], generator: str) -> str:
    """Return the whole document.

    `title`, `subtitle`, `generator`: plain text: the heading, the line below it, and what wrote the page. `sections`: in the order of
    reading; each gets a link at the top.
    """
    kept = list(sections)
    return _PAGE.substitute(
        policy=_POLICY,
        title=_escaped(title),
        subtitle=_escaped(subtitle),
        generator=_escaped(generator),
        style=STYLE,
        links="".join(f'<a href="#{_escaped(s.anchor)}">{_escaped(s.title)}</a>' for s in kept),
        sections="\n".join(s.html() for s in kept),
    )


def paragraph(text: str, kind: str = "") -> str:
    """Return plain text as a paragraph of a class of the style."""
    return f'<p class="{kind}">{_escaped(text)}</p>' if kind else f"<p>{_escaped(text)}</p>"


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

    `words`: columns that hold words and are set from the left; the others hold numbers. `shades`: for every cell how dark it is, 0 to 1.
    `graded`: A column of grades: each word is set in the colour of its first word.
    """
    kinds = [' class="words"' if i in words else "" for i in range(len(head))]
    parts = ['<div class="scroll"><table>']
    if caption:
        parts.append(f"<caption>{_escaped(caption)}</caption>")
    top = "".join(f'<th scope="col"{kind}>{_escaped(cell)}</th>' for cell, kind in zip(head, kinds, strict=True))
    parts.append(f"<thead><tr>{top}</tr></thead><tbody>")
    for i, row in enumerate(rows):
        cells = []
        for j, (cell, kind) in enumerate(zip(row, kinds, strict=True)):
            shade = 0.0 if shades is None else shades[i][j]
            style = f' style="--shade:{100 * shade:.0f}%"' if shade > 0 else ""
            text = (
                _escaped(cell) if j != graded else f'<b class="grade {_escaped(cell.split()[0])}">{_escaped(cell)}</b>'
            )
            cells.append(f"<td{kind}{style}>{text}</td>")
        parts.append(f"<tr>{''.join(cells)}</tr>")
    parts.append("</tbody></table></div>")
    return "".join(parts)


def folded(title: str, body: str) -> str:
    """Return HTML that a reader unfolds; on paper it stands open."""
    return f"<details><summary>{_escaped(title)}</summary>{body}</details>"


def listing(pairs: Iterable[tuple[str, str]]) -> str:
    """Return names and values as a list of definitions."""
    return f"<dl>{''.join(f'<dt>{_escaped(k)}</dt><dd>{_escaped(v)}</dd>' for k, v in pairs)}</dl>"


def numbered(items: Iterable[tuple[str, str]]) -> str:
    """Return a numbered list of a name, set off, and a sentence."""
    return f"<ol>{''.join(f'<li><b>{_escaped(name)}</b> {_escaped(text)}</li>' for name, text in items)}</ol>"


def script(text: str) -> str:
    """Return lines of a program."""
    return f"<pre><code>{_escaped(text)}</code></pre>"


def picture(svg: bytes, description: str, caption: str = "") -> str:
    """Return a figure that holds its picture as data; the description serves who cannot see it."""
    data = base64.b64encode(svg).decode("ascii")
    below = f"<figcaption>{_escaped(caption)}</figcaption>" if caption else ""
    return f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{_escaped(description)}">{below}</figure>'
