"""Ambient setups in their band before they are put together: the band that was asked, or those that all of them together fall into."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modalscope.identification.sizes import SETUP_ROWS
from modalscope.model.notes import Note
from modalscope.model.setups import Setups
from modalscope.preprocess.own_band import OwnBands, own_bands, taken_down
from modalscope.preprocess.prominent import levels_of

__all__ = ["bands_of_setups", "conditioned_setups"]

Band = tuple[float, float]


def bands_of_setups(setups: Setups) -> tuple[tuple[Band, ...], tuple[Note, ...]]:
    """Return the bands that setups fall into, and what is said about them; none where one will do.

    One does where the block rows of the joined setups span half a period of the lowest frequency: modes of one band are fitted without
    those of the others, and their shapes suffer.

    Parameters
    ----------
    setups : Setups
    """
    own = _own(setups)
    rows = max(SETUP_ROWS // len(setups.output_dofs), 10)
    if len(own.parts) < 2 or rows / setups.sampling_rate >= 0.5 / own.parts[0][0]:
        return (), ()
    return own.parts, (own.note(own.parts),)


class InBand(NamedTuple):
    """Setups as they are joined.

    Attributes
    ----------
    setups : Setups
    band : (float, float) or None
        Hz, as asked or as chosen; None where they are taken as they are.
    lowest : float or None
        Hz: the lowest frequency in the band at which something stands out; None where nothing does.
    notes : tuple of Note
    """

    setups: Setups
    band: Band | None
    lowest: float | None
    notes: tuple[Note, ...]


def conditioned_setups(setups: Setups, band: Band | None) -> InBand:
    """Return setups at the rate of a band and without drift, the band, and what was chosen.

    Parameters
    ----------
    setups : Setups
    band : (float, float), optional
        As asked, Hz; by default one in which something stands out of any of them, where they are sampled for more.
    """
    own = _own(setups)
    chosen = own.whole if band is None else band
    lowest = None if own.span is None else max(own.span[0], 0.0 if band is None else band[0])
    if chosen is None:
        return InBand(setups, None, lowest, ())
    parts = tuple(taken_down(part, chosen[1], own.drift) for part in setups.parts)
    return InBand(replace(setups, parts=parts), chosen, lowest, (own.note((chosen,)),) if band is None else ())


def _own(setups: Setups) -> OwnBands:
    """Return the bands of the outputs of all setups side by side, over the samples that all have."""
    count = min(setups.samples)
    each = [levels_of(replace(part, outputs=part.outputs[..., :count, :])) for part in setups.parts]
    together = replace(each[0], levels=np.hstack([levels.levels for levels in each]))
    return own_bands(together, setups.sampling_rate)
