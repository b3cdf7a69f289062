"""Pack a result as one blob that reports and notebooks draw interactively."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, ModalModel, StabilizationDiagram
from modalscope.data.results import Result
from modalscope.identification.method_names import cell_label
from modalscope.judging.select import select
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, BoolArray, IntArray
from modalscope.numerics.errors import optional_package
from modalscope.plot.web.blob import pack
from modalscope.plot.web.fits import asked_ends, band_of, fit_of_bands, rebuilt_lines
from modalscope.plot.web.modes import modes_parts
from modalscope.plot.web.poles import behind, pole_arrays, thinned
from modalscope.plot.web.verdict import verdict_of
from modalscope.preprocess.singular_spectra import Decomposition

#: Maximum numbers of all channels in a blob, and minimum and maximum lines of a channel.
_MAX_NUMBERS, _MIN_LINES, _MAX_LINES = 200_000, 100, 1500

#: Maximum number of drawn singular values.
_MAX_CURVES = 4

#: Maximum points of a curve, about twice the width of a wide screen.
_MAX_POINTS = 4000

_STATIC = Path(__file__).parents[2] / "app" / "static"


def front_end(name: str) -> str | None:
    """Return a file of the bundled front end; None if it was not built.

    `name`: such as "viewer.js".
    """
    path = _STATIC / name
    return path.read_text(encoding="utf-8") if path.is_file() else None


def alive_blob(
    modes: ModalModel,
    *diagrams: StabilizationDiagram,
    spectra: Decomposition | None = None,
    holds: BoolArray | None = None,
) -> bytes:
    """Return modes and their diagrams, one per band, as one blob.

    `spectra`: whose singular values are drawn behind the poles instead of the indicator. `holds`: as in `grades`.
    """
    entries, drawn = modes_parts(modes, {}, holds)
    first = diagrams[0]
    fit = fit_of_bands(modes, diagrams) if len(modes) else None
    verdict = verdict_of(modes, first.response, fit)
    lines, curves = behind(diagrams, _MAX_POINTS) if spectra is None else _spectra_behind(spectra, diagrams)
    head: dict[str, Any] = {
        **entries,
        "label": cell_label(first.method, first.domain),
        "orders": sorted({order for diagram in diagrams for order in diagram.orders}),
        "bands": [list(band_of(d, len(diagrams)) if spectra is None else asked_ends(d)) for d in diagrams],
        "level": "mode indicator" if spectra is None else "singular values of the spectra",
        "columns": list(first.response.columns),
        "unexplained": verdict.unexplained,
        "warnings": verdict.warnings,
    }
    arrays = {**drawn, **pole_arrays(diagrams), "behind": lines, "curves": curves}
    if fit is not None:
        channels, shape = _channels(modes, diagrams)
        if channels:  # records have one fit error per output, (l, 1)
            head |= {"channels": True, "fits": np.broadcast_to(fit[1], shape)}
            arrays |= channels
    return pack(head, arrays, exact=("frequency", "behind", "response_lines"))


def _spectra_behind(spectra: Decomposition, diagrams: Sequence[StabilizationDiagram]) -> tuple[Array, Array]:
    """Return lines (P,) in the chosen bands, and square roots (k, P) of the largest singular values, which are amplitudes."""
    f = spectra.frequencies
    kept = np.any([(low <= f) & (f <= high) for low, high in map(asked_ends, diagrams)], axis=0)
    return thinned(f[kept], np.sqrt(spectra.singular_values[kept, :_MAX_CURVES]), _MAX_POINTS)


def _channels(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> tuple[dict[str, Array], tuple[int, ...]]:
    """Return lines, measured and rebuilt values (l, m, lines) of all bands, none if there are too many channels, and (l, m)."""
    parts = [rebuilt_lines(modes, diagram, len(diagrams)) for diagram in diagrams]
    f, measured, fitted = (np.concatenate(side) for side in zip(*parts, strict=True))
    shape = measured.shape[1:]
    most = min(_MAX_NUMBERS // max(4 * int(np.prod(shape)), 1), _MAX_LINES)
    if most < _MIN_LINES:
        return {}, shape
    kept = _shown(f, modes, most)
    sides = {"measured": measured[kept], "rebuilt": fitted[kept]}
    drawn = {
        f"{name}_{part}": np.moveaxis(getattr(side, part), 0, -1)
        for name, side in sides.items()
        for part in ("real", "imag")
    }
    return {"response_lines": f[kept], **drawn}, shape


def _shown(f: Array, modes: ModalModel, most: int) -> IntArray:
    """Return the indices of the drawn lines: half of them evenly spaced, half near the modes."""
    if len(f) <= most:
        return np.arange(len(f))
    even = np.linspace(0, len(f) - 1, most // 2).astype(int)
    half = np.abs(modes.poles.real) / (2 * np.pi)
    near = np.min(np.abs(f[:, None] - modes.frequencies) / np.maximum(half, np.finfo(float).tiny), axis=1)
    peaks = np.argsort(near, kind="stable")[: most - most // 2]
    return np.unique(np.concatenate([even, peaks]))


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
    modes, diagrams = _pair(thing)
    anywidget = optional_package("a widget", "anywidget", "notebook")
    traitlets = optional_package("a widget", "traitlets", "notebook")
    script, style = front_end("widget.js"), front_end("widget.css")
    if script is None or style is None:
        remedy = "Run: make page (needs Node 20 and npm)."
        raise DataError("a widget was asked", "its front end is not built", remedy)
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
    remedy = "Give a result of analyze, a diagram of stabilize, or (modes, diagram)."
    raise DataError("a widget was asked", f"it was given {type(thing).__name__}", remedy)
