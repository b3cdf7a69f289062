"""Pack a result as one blob that reports and notebooks draw interactively."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from modalscope.data import DataError, ModalModel, StabilizationDiagram
from modalscope.data.results import Result
from modalscope.identification.method_names import cell_label
from modalscope.judging.select import select
from modalscope.modal.rebuilt import explained
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, IntArray
from modalscope.numerics.extras import optional_package
from modalscope.plot.web.blob import pack
from modalscope.plot.web.modes import modes_parts
from modalscope.plot.web.poles import asked_ends, band_of, behind, fit_of_bands, pole_arrays, rebuilt_lines, thinned
from modalscope.preprocess.singular_spectra import Decomposition

#: Numbers of channels that a blob holds at most, and lines a channel has at least and at most.
_NUMBERS, _FEW, _MANY = 200_000, 100, 1500

#: Singular values that are drawn.
_CURVES = 4

#: Points of the indicator: about twice what a wide screen has.
_POINTS = 4000

_STATIC = Path(__file__).parents[2] / "app" / "static"


def front_end(name: str) -> str | None:
    """Return a part of the bundled front end; None where it was not built.

    `name`: such as "viewer.js".
    """
    path = _STATIC / name
    return path.read_text(encoding="utf-8") if path.is_file() else None


def alive_blob(modes: ModalModel, *diagrams: StabilizationDiagram, spectra: Decomposition | None = None) -> bytes:
    """Return modes and the diagrams that they were selected from, one a band, as one blob.

    `spectra`: whose singular values stand behind the poles in the place of the indicator, in the bands that were asked.
    """
    told, drawn = modes_parts(modes, {})
    first = diagrams[0]
    lines, curves = behind(diagrams, _POINTS) if spectra is None else _spectra_behind(spectra, diagrams)
    head: dict[str, Any] = {
        **told,
        "label": cell_label(first.method, first.domain),
        "orders": sorted({order for diagram in diagrams for order in diagram.orders}),
        "bands": [list(band_of(each, len(diagrams)) if spectra is None else asked_ends(each)) for each in diagrams],
        "level": "mode indicator" if spectra is None else "singular values of the spectra",
        "columns": list(first.response.columns),
    }
    arrays = {**drawn, **pole_arrays(diagrams), "behind": lines, "curves": curves}
    fit = fit_of_bands(modes, diagrams) if len(modes) else None
    if fit is not None:
        channels = _channels(modes, diagrams, fit[1])
        head["explained"] = explained(fit[0])
        if channels.arrays:
            head |= {"channels": True, "fits": channels.fits}
            arrays |= channels.arrays
    return pack(head, arrays, exact=("frequency", "behind", "response_lines"))


def _spectra_behind(spectra: Decomposition, diagrams: Sequence[StabilizationDiagram]) -> tuple[Array, Array]:
    """Return lines (P,) in the bands that were asked, and roots (k, P) of the largest singular values: levels of an amplitude."""
    f = spectra.frequencies
    kept = np.any([(low <= f) & (f <= high) for low, high in map(asked_ends, diagrams)], axis=0)
    return thinned(f[kept], np.sqrt(spectra.singular_values[kept, :_CURVES]), _POINTS)


class _Channels(NamedTuple):
    """What the modes leave of each channel (l, m), and what is drawn of them: nothing where there are too many."""

    fits: Array
    arrays: dict[str, Array]


def _channels(modes: ModalModel, diagrams: Sequence[StabilizationDiagram], left: Array) -> _Channels:
    """Return measured and rebuilt values (l, m, lines) of every channel, of one band after the other.

    What is left (l, m) of records is told of an output under all inputs, (l, 1).
    """
    parts = [rebuilt_lines(modes, diagram, len(diagrams)) for diagram in diagrams]
    f, measured, own = (np.concatenate(side) for side in zip(*parts, strict=True))
    fits = np.broadcast_to(left, measured.shape[1:])
    most = min(_NUMBERS // max(4 * int(np.prod(measured.shape[1:])), 1), _MANY)
    if most < _FEW:
        return _Channels(fits, {})
    kept = _shown(f, modes, most)
    sides = {"measured": measured[kept], "rebuilt": own[kept]}
    drawn = {
        f"{name}_{part}": np.moveaxis(getattr(side, part), 0, -1)
        for name, side in sides.items()
        for part in ("real", "imag")
    }
    return _Channels(fits, {"response_lines": f[kept], **drawn})


def _shown(f: Array, modes: ModalModel, most: int) -> IntArray:
    """Return the lines that are drawn: evenly spread ones, and closer ones where the modes are."""
    if len(f) <= most:
        return np.arange(len(f))
    even = np.linspace(0, len(f) - 1, most // 2).astype(int)
    half = np.abs(modes.poles.real) / (2 * np.pi)
    near = np.min(np.abs(f[:, None] - modes.frequencies) / np.maximum(half, np.finfo(float).tiny), axis=1)
    peaks = np.argsort(near, kind="stable")[: most - most // 2]
    return np.unique(np.concatenate([even, peaks]))


# -------------------------------------------------------------------------------------------------------------- widget
# The page's pictures in a notebook.


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
