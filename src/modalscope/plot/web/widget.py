"""The page's pictures in a notebook."""

from __future__ import annotations

from typing import Any

from modalscope.judging.select import select
from modalscope.model import DataError, ModalModel, StabilizationDiagram
from modalscope.model.extras import optional_package
from modalscope.model.keywords import named
from modalscope.model.result import Result
from modalscope.plot.web.alive import alive_blob, front_end

__all__ = ["widget"]


@named()
def widget(thing: Any) -> Any:
    """Show a result in a notebook: the diagram to zoom and hover, the modes, their shapes moving, every channel, and the MAC.

    Parameters
    ----------
    thing : Result, StabilizationDiagram or (ModalModel, StabilizationDiagram)
        Of a diagram alone the modes are selected automatically.

    Returns
    -------
    anywidget.AnyWidget
        With `chosen`, the index of the mode that is looked at; setting it chooses another.

    Raises
    ------
    DataError
        Something without modes and a diagram; anywidget (the extra `notebook`) or the front end is not there.
    """
    modes, diagrams = _pair(thing)
    anywidget = optional_package("a widget", "anywidget", "notebook")
    traitlets = optional_package("a widget", "traitlets", "notebook")
    script, style = front_end("widget.js"), front_end("widget.css")
    if script is None or style is None:
        raise DataError(
            "a widget was asked", "its front end is not built", "Say: make page (it needs Node 20 and npm)."
        )
    fields = {
        "_esm": script,
        "_css": style,
        "blob": traitlets.Bytes().tag(sync=True),
        "chosen": traitlets.Int(0).tag(sync=True),
    }
    return type("Widget", (anywidget.AnyWidget,), fields)(blob=alive_blob(modes, *diagrams))


def _pair(thing: Any) -> tuple[ModalModel, tuple[StabilizationDiagram, ...]]:
    """Return modes and their diagrams."""
    if isinstance(thing, StabilizationDiagram):
        return select(thing), (thing,)
    if isinstance(thing, Result):
        return thing.modes, thing.diagrams or (thing.diagram,)
    if isinstance(thing, tuple) and len(thing) == 2:
        modes, diagram = thing
        if isinstance(modes, ModalModel) and isinstance(diagram, StabilizationDiagram):
            return modes, (diagram,)
    raise DataError(
        "a widget was asked",
        f"it was given {type(thing).__name__}",
        "Give a result of analyze, a diagram of stabilize, or (modes, diagram).",
    )
