"""Pack a result as one blob that reports and notebooks draw interactively."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, ModalModel, StabilizationDiagram
from modalscope.data.results import Result
from modalscope.data.shown import html_table
from modalscope.interfaces.plot.picture import unit_of
from modalscope.interfaces.plot.web.blob import pack, parts_of
from modalscope.interfaces.plot.web.fits import Fit, Lines, fit_of_bands, lines_of
from modalscope.interfaces.plot.web.modes import modes_parts, over_points
from modalscope.interfaces.plot.web.poles import first_indicator, poles_parts
from modalscope.interfaces.plot.web.verdict import Verdict, verdict_of
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, BoolArray, IntArray
from modalscope.numerics.errors import optional_package
from modalscope.selection.judging.description import table_of
from modalscope.selection.judging.grades import grades
from modalscope.selection.judging.select import select
from modalscope.signals.preprocess.singular_spectra import Decomposition

#: Maximum numbers of all channels in a blob, and minimum and maximum lines of a channel.
_MAX_NUMBERS, _MIN_LINES, _MAX_LINES = 200_000, 100, 1500

#: Maximum ratio to the largest measured value that half precision holds, with room.
_MAX_RATIO = 6e4

#: Maximum points of a curve, about twice the width of a wide screen.
_MAX_POINTS = 4000

_STATIC = Path(__file__).parents[2] / "app" / "static"


def front_end(name: str) -> str | None:
    """Return a file of the bundled front end; None if it was not built.

    `name`: such as "viewer.js".
    """
    path = _STATIC / name
    return path.read_text(encoding="utf-8") if path.is_file() else None


@dataclass(frozen=True, eq=False, slots=True)
class Drawing:
    """What a finished result shows, computed once: entries and arrays of its modes, fit, verdict and lines.

    `spectra`: of a record without inputs, drawn behind the poles instead of the indicator. `fit`: None where responses cannot be rebuilt,
    and `lines` with it. `points`: as of `over_points`.
    """

    modes: ModalModel
    points: ModalModel
    diagrams: Sequence[StabilizationDiagram]
    spectra: Decomposition | None
    entries: Mapping[str, Any]
    arrays: Mapping[str, Array]
    fit: Fit
    lines: Lines | None
    verdict: Verdict


def drawing_of(
    modes: ModalModel,
    *diagrams: StabilizationDiagram,
    spectra: Decomposition | None = None,
    holds: BoolArray | None = None,
) -> Drawing:
    """Return what is shown of modes and their diagrams, one per band.

    `spectra`: of a record without inputs. `holds`: as in `grades`.
    """
    points = over_points(modes, diagrams[0].response)
    entries, arrays = modes_parts(modes, {}, holds, points=points)
    fit = fit_of_bands(modes, diagrams)
    verdict = verdict_of(modes, diagrams[0].response, fit if len(modes) else None, grades(modes, holds))
    lines = None if fit is None else lines_of(modes, diagrams)
    return Drawing(modes, points, diagrams, spectra, entries, arrays, fit, lines, verdict)


def alive_blob(drawing: Drawing) -> bytes:
    """Return modes and their diagrams as one blob."""
    diagrams, response = drawing.diagrams, drawing.diagrams[0].response
    shown, arrays, exact = poles_parts(diagrams, [first_indicator(diagrams, drawing.spectra, _MAX_POINTS)])
    head: dict[str, Any] = {
        **drawing.entries,
        **shown,
        "columns": list(response.columns),
        "unit": unit_of(response.picture()).strip(" []"),
        "fit": None if drawing.fit is None else drawing.fit[0],
        "unexplained": drawing.verdict.unexplained,
        "warnings": drawing.verdict.warnings,
    }
    arrays |= drawing.arrays
    if drawing.fit is not None and drawing.lines is not None:
        shape = drawing.lines.measured.shape[1:]
        channels, scales = _channels(drawing.modes, drawing.lines)
        if channels:  # records have one fit error per output, (l, 1)
            head |= {"channels": True, "fits": np.broadcast_to(drawing.fit[1], shape), "scales": scales}
            arrays |= channels
    return pack(head, arrays, exact=(*exact, "response_lines"), half=_SIDES)


#: Arrays of responses: half precision, relative to the largest value of each channel, is a hundredth of a decibel.
_SIDES = ("measured_real", "measured_imag", "rebuilt_real", "rebuilt_imag")


def _channels(modes: ModalModel, lines: Lines) -> tuple[dict[str, Array], Array]:
    """Return lines, measured and rebuilt values (l, m, lines) relative to `scales` (l, m), and these; none of too many channels."""
    scales = np.maximum(np.max(np.abs(lines.measured), axis=0, initial=0.0), np.finfo(float).tiny)
    most = min(_MAX_NUMBERS // max(4 * scales.size, 1), _MAX_LINES)
    if most < _MIN_LINES:
        return {}, scales
    kept = _shown(lines.frequencies, modes, most)
    sides = parts_of(measured=lines.measured[kept] / scales, rebuilt=lines.rebuilt[kept] / scales)
    drawn = {name: np.moveaxis(np.clip(v, -_MAX_RATIO, _MAX_RATIO), 0, -1) for name, v in sides.items()}
    return {"response_lines": lines.frequencies[kept], **drawn}, scales


def _shown(f: Array, modes: ModalModel, most: int) -> IntArray:
    """Return the indices of the drawn lines: half of them evenly spaced, half near the modes."""
    if len(f) <= most:
        return np.arange(len(f))
    even = np.linspace(0, len(f) - 1, most // 2).astype(int)
    half = np.abs(modes.poles.real) / (2 * np.pi)
    near = np.min(np.abs(f[:, None] - modes.frequencies) / np.maximum(half, np.finfo(float).tiny), axis=1)
    peaks = np.argsort(near, kind="stable")[: most - most // 2]
    return np.unique(np.concatenate([even, peaks]))


def living(result: Result) -> dict[str, Any]:
    """Return what a notebook shows of a result that lives; nothing where the front end is not built."""
    if front_end("widget.js") is None:
        return {}
    bundle = widget(result)._repr_mimebundle_()
    return dict(bundle[0] if isinstance(bundle, tuple) else bundle)


@named()
def widget(thing: Any) -> Any:
    """Show a result in a notebook: interactive diagram, modes, animated shapes, responses and AutoMAC.

    Parameters
    ----------
    thing : Result, StabilizationDiagram or (ModalModel, StabilizationDiagram)
        The modes of a diagram alone are selected automatically.

    Returns
    -------
    anywidget.AnyWidget
        Its attribute `chosen` is the index of the displayed mode, and can be set.

    Raises
    ------
    DataError
        An object without modes and diagram; anywidget (the extra `notebook`) or the front end is missing.
    """
    modes, diagrams = selected(thing)
    anywidget = optional_package("a widget", "anywidget", "notebook")
    traitlets = optional_package("a widget", "traitlets", "notebook")
    script, style = front_end("widget.js"), front_end("widget.css")
    if script is None or style is None:
        remedy = "Run: make page (needs Node 20 and npm)."
        raise DataError("a widget needs its built front end", "there is none here", remedy)
    fields = {"blob": traitlets.Bytes().tag(sync=True), "chosen": traitlets.Int(0).tag(sync=True)}

    class Exported(anywidget.AnyWidget):  # type: ignore[name-defined,misc]
        def _repr_mimebundle_(self, **given: Any) -> Any:
            """Return the widget, and what a notebook shows of it where no program answers: diagram and table."""
            data, *more = super()._repr_mimebundle_(**given)
            return ({**data, "text/html": diagrams[0]._repr_html_() + html_table(table_of(modes))}, *more)

    return type("Widget", (Exported,), {"_esm": script, "_css": style, **fields})(
        blob=alive_blob(drawing_of(modes, *diagrams))
    )


def selected(thing: Any, asked: str = "a widget") -> tuple[ModalModel, tuple[StabilizationDiagram, ...]]:
    """Return the modes and the diagrams of a result, of a pair in either order, or of a diagram, whose modes are selected.

    Raises `DataError`: something else; `asked`: what they are needed for.
    """
    if isinstance(thing, StabilizationDiagram):
        return select(thing), (thing,)
    if isinstance(thing, Result):
        return thing.modes, thing.diagrams or (thing.diagram,)
    pair = thing if isinstance(thing, tuple) else (getattr(thing, "modes", None), getattr(thing, "diagram", None))
    found = {type(each): each for each in pair}
    if len(pair) == 2 and set(found) == {ModalModel, StabilizationDiagram}:
        return found[ModalModel], (found[StabilizationDiagram],)
    remedy = "Give a result of analyze, a diagram of stabilize, or (modes, diagram)."
    raise DataError(f"{asked} needs modes and their diagram", f"it was given {type(thing).__name__}", remedy)
