"""The part of a report that moves: the front end of the page and its data, in the file itself; without scripts it is not there."""

from __future__ import annotations

import base64
from collections.abc import Iterator

from modalscope.model import ModalModel, StabilizationDiagram
from modalscope.plot.web.alive import alive_blob, front_end
from modalscope.preprocess.singular_spectra import Decomposition
from modalscope.reporting.html import Section, paragraph

__all__ = ["alive_section"]

#: What is only there where scripts run, and never on paper.
_STYLE = """body:not(.alive) #explore, body:not(.alive) a[href="#explore"] { display: none; }
@media print { #explore { display: none; } }"""


def alive_section(
    modes: ModalModel, *diagrams: StabilizationDiagram, spectra: Decomposition | None = None
) -> Iterator[Section]:
    """Give the section that moves, where there are modes and the front end was built with the package.

    Nothing that a user wrote stands in it as markup: labels are in the data, which are base64.

    Parameters
    ----------
    modes : ModalModel
    *diagrams : StabilizationDiagram
    spectra : Decomposition, optional
        Of a record without inputs: what stands behind the poles.
    """
    script, style = front_end("viewer.js"), front_end("viewer.css")
    if script is None or style is None or not len(modes):
        return
    data = base64.b64encode(alive_blob(modes, *diagrams, spectra=spectra)).decode("ascii")
    lead = paragraph(
        "Drag to zoom, double-click for the whole; choose a mode in the table or a channel of the curve.", "muted"
    )
    yield Section(
        "explore",
        "Look closer",
        f'{lead}<style>{_STYLE}{style}</style><div id="alive"></div>'
        f'<script id="alive-data" type="application/octet-stream">{data}</script>'
        f'<script id="alive-script">{script.replace("</script", "<" + chr(92) + "/script")}</script>',
    )
