"""How well a factor of the data matrix follows the modes read off it: amplitude coherence and EMAC of one side."""

from __future__ import annotations

import numpy as np

from modalscope.blocks.evolved import ModalSide
from modalscope.modal.amplitudes import agreement, coherence
from modalscope.modal.indicators import decay_step
from modalscope.model.checks import RealArray

__all__ = ["followed"]


def followed(side: ModalSide) -> tuple[RealArray, RealArray]:
    """Return amplitude coherence over all blocks, and EMAC: an identified block against the modes' first one, grown.

    NaN where nothing is seen.

    Parameters
    ----------
    side : ModalSide
    """
    found = side.compare(agreement, decay_step)
    values = coherence(found.inner, found.identified, found.expected), found.agreement
    if found.seen is None:
        return values
    return np.where(found.seen, values[0], np.nan), np.where(found.seen, values[1], np.nan)
