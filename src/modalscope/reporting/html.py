"""One self-contained page: sections, tables and pictures as plain HTML, without a template engine.

Everything a reader's browser needs stands in the file: the style, and the pictures as data. Nothing is asked from
outside. What comes from the user is escaped where it enters.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from string import Template

from modalscope.model.errors import printable
from modalscope.reporting.style import STYLE

__all__ = ["Section", "folded", "listing", "numbered", "page", "paragraph", "picture", "script", "table"]

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

    Parameters
    ----------
    anchor : str
        Its name in links, a single word.
    title : str
        Plain text.
    body : str
        HTML.
    """

    anchor: str
    title: str
    body: str

    def html(self) -> str:
        """Return the section as HTML."""
        return f'<section id="{_escaped(self.anchor)}">\n<h2>{_escaped(self.title)}</h2>\n{self.body}\n</section>'


def page(title: str, subtitle: str, sections: Iterable[Section], generator: str) -> str:
    """Return the whole document.

    Parameters
    ----------
    title, subtitle, generator : str
        Plain text: the heading, the line below it, and what wrote the page.
    sections : iterable of Section
        In the order of reading; each gets a link at the top.
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

    Parameters
    ----------
    head : sequence of str
    rows : iterable of sequence of str
    words : sequence of int
        Columns that hold words and are set from the left; the others hold numbers.
    shades : sequence of sequence of float, optional
        For every cell how dark it is, 0 to 1.
    graded : int, optional
        A column of grades: each word is set in the colour of its first word.
    caption : str
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
