"""Write a report as a Word document or as PowerPoint slides: verdict, table of modes, pictures, findings and notes."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.interfaces.plot.gallery import pictures_of
from modalscope.interfaces.plot.on_axes import png
from modalscope.interfaces.plot.web.alive import drawing_of
from modalscope.interfaces.plot.web.verdict import Verdict, grouped, notes_that_matter
from modalscope.interfaces.reporting.document import Origin
from modalscope.numerics.errors import optional_package, printable
from modalscope.selection.judging.description import HEADS, ModeDescription, described

#: Maximum number of drawn shapes.
_MAX_SHAPES = 60

#: Rows of a table on a slide, and pictures of shapes.
_MAX_ROWS, _SHAPES_A_SLIDE = 12, 4

#: Widths of the columns of the table of modes, as shares.
_WIDTHS = (0.08, 0.12, 0.09, 0.11, 0.09, 0.12, 0.08, 0.31)

#: Size of the pictures of shapes, inches: smaller than the others, so that their words stay large.
_SHAPE_SIZE = (6.4, 4.0)

#: Colours of the grades.
_COLOURS = {"good": (0, 115, 79), "look": (213, 94, 0), "doubtful": (31, 41, 51)}


class _Contents:
    """What both kinds of document hold."""

    def __init__(
        self, title: str, subtitle: str, modes: ModalModel, diagram: StabilizationDiagram, origin: Origin
    ) -> None:
        holds = None if origin.certificate is None else origin.certificate.holds
        notes = diagram.notes if origin.notes is None else origin.notes
        self.title, self.subtitle = printable(title), printable(subtitle)
        self.modes, self.diagrams = modes, origin.diagrams or (diagram,)
        self.drawn = pictures_of(modes, self.diagrams, most=_MAX_SHAPES)
        self.shown: tuple[ModeDescription, ...] = described(modes, holds)
        self.verdict: Verdict = drawing_of(modes, *self.diagrams, holds=holds).verdict
        self.findings = [printable(str(finding)) for finding in grouped(origin.findings or ())]
        self.notes = [printable(text) for text in notes_that_matter(notes)[0]]

    def sentences(self) -> list[str]:
        """Return the verdict."""
        v = self.verdict
        return [*v.warnings, *v.unexplained, *v.graded, *v.taken]

    def rows(self) -> list[list[str]]:
        """Return the table of modes, its heads first."""
        return [list(HEADS.values()), *(list(each.to_dict().values()) for each in self.shown)]

    def pictures(self) -> Iterator[tuple[str, bytes]]:
        """Yield the large pictures with their captions: diagram, AutoMAC, strongest response."""
        for name, picture in self.drawn.items():
            if not name.startswith("mode"):
                yield picture.words, png(picture)

    def shapes(self) -> Iterator[tuple[str, bytes]]:
        """Yield the shapes with their captions; a single output has none."""
        for each in self.shown:
            if f"mode{each.number}" in self.drawn:
                words = f"Mode {each.number}: {each.grade}, {each.reason}"
                yield words, png(self.drawn[f"mode{each.number}"], size=_SHAPE_SIZE)


def write_document(
    path: Path, title: str, subtitle: str, modes: ModalModel, diagram: StabilizationDiagram, origin: Origin
) -> None:
    """Write a report to a path that ends in .docx or .pptx.

    Raises `DataError`: the package of the extra `office` is missing.
    """
    contents = _Contents(title, subtitle, modes, diagram, origin)
    (_word if path.suffix.lower() == ".docx" else _slides)(path, contents)


def _word(path: Path, contents: _Contents) -> None:
    docx = optional_package("a report as a Word document", "docx", "office", "python-docx")
    inches, colour = docx.shared.Inches, docx.shared.RGBColor
    document = docx.Document()
    document.core_properties.title = contents.title
    document.add_heading(contents.title, 0)
    document.add_paragraph(contents.subtitle)
    for sentence in contents.sentences():
        document.add_paragraph().add_run(sentence).bold = sentence.startswith("WARNING")
    document.add_heading("Modes", 1)
    rows = contents.rows()
    table = document.add_table(len(rows), len(rows[0]), "Light Grid Accent 1")
    table.autofit = False
    for i, row in enumerate(rows):
        for cell, text, share in zip(table.rows[i].cells, row, _WIDTHS, strict=True):
            cell.text, cell.width = text, inches(6.2 * share)
            for run in cell.paragraphs[0].runs:
                run.font.size = docx.shared.Pt(8.5)
                if text in _COLOURS and i:
                    run.font.color.rgb = colour(*_COLOURS[text])
    for caption, picture in contents.pictures():
        document.add_heading(caption, 1)
        document.add_picture(io.BytesIO(picture), width=inches(6))
    shapes = list(contents.shapes())
    if shapes:
        document.add_heading("Mode shapes", 1)
    for caption, picture in shapes:
        document.add_picture(io.BytesIO(picture), width=inches(4.4))
        document.add_paragraph(caption)
    for heading, texts in (("Data", contents.findings or ["No data problem found."]), ("Notes", contents.notes)):
        if texts:
            document.add_heading(heading, 1)
        for text in texts:
            document.add_paragraph(text, "List Bullet")
    document.save(str(path))


def _slides(path: Path, contents: _Contents) -> None:
    pptx = optional_package("a report as slides", "pptx", "office", "python-pptx")
    show = _Show(pptx)
    show.text(contents.title, [contents.subtitle, *contents.sentences()], 20)
    heads, *rows = contents.rows()
    for start in range(0, len(rows), _MAX_ROWS):
        show.table("Modes" if start == 0 else "Modes, continued", [heads, *rows[start : start + _MAX_ROWS]])
    for caption, picture in contents.pictures():
        show.pictures(caption, [picture], 1)
    shapes = [picture for _, picture in contents.shapes()]
    for start in range(0, len(shapes), _SHAPES_A_SLIDE):
        show.pictures("Mode shapes", shapes[start : start + _SHAPES_A_SLIDE], 2)
    if contents.findings or contents.notes:
        show.text("Data and notes", [*contents.findings, *contents.notes], 16)
    show.made.save(str(path))


class _Show:
    """Slides of 13.3 x 7.5 inches."""

    def __init__(self, pptx: Any) -> None:
        self.made = pptx.Presentation()
        self._inches, self._points = pptx.util.Inches, pptx.util.Pt
        self.made.slide_width, self.made.slide_height = self._inches(13.333), self._inches(7.5)
        self._colour = import_module("pptx.dml.color").RGBColor

    def _slide(self, title: str) -> Any:
        slide = self.made.slides.add_slide(self.made.slide_layouts[5])
        place = slide.shapes.title
        place.text = title
        place.left, place.top, place.width, place.height = map(self._inches, (0.5, 0.25, 12.3, 0.8))
        place.text_frame.paragraphs[0].font.size = self._points(28)
        return slide

    def text(self, title: str, texts: Sequence[str], size: float) -> None:
        """Add a slide of paragraphs."""
        place = map(self._inches, (0.6, 1.4, 12, 5.8))
        frame = self._slide(title).shapes.add_textbox(*place).text_frame
        frame.word_wrap = True
        for k, text in enumerate(texts):
            paragraph = frame.paragraphs[0] if k == 0 else frame.add_paragraph()
            paragraph.text, paragraph.font.size = text, self._points(size)
            paragraph.font.bold = text.startswith("WARNING")
            paragraph.space_after = self._points(8)

    def table(self, title: str, rows: Sequence[Sequence[str]]) -> None:
        """Add a slide with a table."""
        place = map(self._inches, (0.6, 1.3, 12.1, 0.4 * len(rows)))
        table = self._slide(title).shapes.add_table(len(rows), len(rows[0]), *place).table
        for i, row in enumerate(rows):
            for j, text in enumerate(row):
                paragraph = table.cell(i, j).text_frame.paragraphs[0]
                paragraph.text, paragraph.font.size = text, self._points(13)
                if text in _COLOURS and i:
                    paragraph.font.color.rgb = self._colour(*_COLOURS[text])
        for column, share in zip(table.columns, _WIDTHS, strict=True):
            column.width = self._inches(12.1 * share)

    def pictures(self, title: str, pictures: Sequence[bytes], columns: int) -> None:
        """Add a slide of pictures."""
        slide, high = self._slide(title), 6.2 / columns
        for k, picture in enumerate(pictures):
            left, top = 2.0 + 4.9 * (k % columns), 1.15 + high * (k // columns)
            height = self._inches(high - 0.05)
            slide.shapes.add_picture(io.BytesIO(picture), self._inches(left), self._inches(top), height=height)
