"""Draw tracks over time for a page: a canvas that is enlarged by dragging, and the record of a point that is clicked."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.analysis.monitoring.tracks import Tracks
from modalscope.data.mode_fields import NORMAL_HALF_WIDTH
from modalscope.numerics.checks import Array, ComplexArray, RealArray

#: Maximum components of all shapes that a page holds, about as many bytes as a picture of a megabyte.
_MAX_COMPONENTS = 300_000


def track_view(tracks: Tracks, refused: RealArray) -> str:
    """Return the HTML of the view: the canvas, the values as JSON, and the program that draws them.

    `refused`: times of the records that could not be used, seconds.
    """
    values = {
        "times": tracks.times.tolist(),
        "names": list(tracks.history.names),
        "tracks": list(tracks.names),
        "dofs": list(tracks.history.output_dofs),
        "frequencies": _numbers(tracks.frequencies, 7),
        "halves": _numbers(NORMAL_HALF_WIDTH * tracks.frequencies_std, 3),
        "damping": _numbers(tracks.damping_ratios, 4),
        "probability": _numbers(tracks.probability, 3),
        "shapes": _real_shapes(tracks.shapes),
        "refused": refused.tolist(),
    }
    packed = json.dumps(values, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    program = Path(__file__).with_name("tracks.js").read_text(encoding="utf-8")
    hint = "Drag to enlarge, double-click for all; click a point for its record; arrow keys go through the records."
    canvas = '<canvas tabindex="0" role="img" aria-label="Frequencies of all tracks over time" style="width:100%;height:26rem"></canvas>'
    return (
        f'<div id="tracks-view">{canvas}<p class="muted">{hint} <button type="button">play</button></p>'
        f'<div class="record scroll" role="status"></div></div>'
        f'<script type="application/json" id="tracks-data">{packed}</script><script>{program}</script>'
    )


def _numbers(values: Array, digits: int) -> Any:
    """Return an array as nested lists of so many digits, null where nothing is known."""
    if values.ndim > 1:
        return [_numbers(row, digits) for row in values]
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in values]


def _real_shapes(shapes: ComplexArray) -> Any:
    """Return the shapes (R, T, l) turned to be as real as they can, largest component 1; None where they are too many."""
    if shapes.size > _MAX_COMPONENTS or not shapes.size:
        return None
    known = np.nan_to_num(shapes)
    largest = np.take_along_axis(known, np.argmax(np.abs(known), axis=-1)[..., None], axis=-1)
    scaled = np.real(shapes / np.where(largest == 0, 1, largest))
    return _numbers(np.asarray(scaled), 3)
