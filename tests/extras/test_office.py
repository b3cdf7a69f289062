"""Reports as Word documents and slides hold the table, the verdict and the pictures of the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.plot.web.verdict import verdict_of_result
from modalscope.selection.judging.description import table_of
from modalscope.systems import chain5
from tests.support import refused


@pytest.fixture(scope="module")
def result() -> ms.Result:
    return ms.analyze(
        chain5().frequency_response(np.linspace(0.3, 7.5, 300), noise=0.02, seed=1), orders=range(8, 15, 2)
    )


@pytest.mark.slow
def test_a_word_document_holds_table_verdict_and_pictures(result: ms.Result, tmp_path: Path) -> None:
    docx = pytest.importorskip("docx")
    document = docx.Document(str(ms.report(result, tmp_path / "r.docx", title="Five masses")))
    assert [[cell.text for cell in row.cells] for row in document.tables[0].rows] == table_of(result.modes)
    texts = [paragraph.text for paragraph in document.paragraphs]
    assert texts[0] == "Five masses"
    assert set(verdict_of_result(result).unexplained) <= set(texts)
    assert len(document.inline_shapes) == 1 + 1 + 1 + len(result.modes)  # diagram, AutoMAC, response, shapes
    assert any(text.startswith("Mode 5: good") for text in texts)  # its frequency stands in the picture


@pytest.mark.slow
def test_slides_hold_the_whole_table_and_every_picture(result: ms.Result, tmp_path: Path) -> None:
    pptx = pytest.importorskip("pptx")
    show = pptx.Presentation(str(ms.report(result, tmp_path / "r.pptx")))
    shapes = [shape for slide in show.slides for shape in slide.shapes]
    tables = [shape.table for shape in shapes if shape.has_table]
    assert [[cell.text for cell in row.cells] for row in tables[0].rows] == table_of(result.modes)
    assert sum(shape.shape_type == 13 for shape in shapes) == 3 + len(result.modes)  # 13: picture


def test_a_comparison_is_no_document_of_an_office_program(result: ms.Result, tmp_path: Path) -> None:
    c = ms.compare(
        chain5().impulse_response(200, noise=0.01, seed=0), methods=["era", "alternate"], orders=[10], workers=1
    )
    refused("a report in 'c.docx'", ms.report, c, tmp_path / "c.docx")
