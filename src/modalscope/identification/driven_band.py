"""Take a response in a band: by default where its forces drive it; correlations at a rate that suits the band."""

from __future__ import annotations

from functools import singledispatch

from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.responses import ImpulseResponse
from modalscope.signals.preprocess.bands import driven_lines
from modalscope.signals.preprocess.conditioning import slower_correlation


@singledispatch
def in_band(
    data: Response, band: tuple[float, float] | None
) -> tuple[Response, tuple[float, float] | None, tuple[Note, ...]]:
    """Return a response in a band, the band, and notes on it."""
    chosen, notes = driven_lines(data) if band is None else (band, ())
    return data.in_band(chosen), chosen, notes


@in_band.register
def _(
    data: ImpulseResponse, band: tuple[float, float] | None
) -> tuple[Response, tuple[float, float] | None, tuple[Note, ...]]:
    return data if band is None else slower_correlation(data, band[1]), None, ()
