"""Figures that the documentation prints, held to what they must be: exact values of simulated structures, published ones of measured data.

A page of the gallery is named with the values that its output must show, and how near. `make docs` asks this of every built page.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import unescape
from pathlib import Path
from typing import NamedTuple

import numpy as np

__all__ = ["HELD", "Held", "drifted", "missing"]


class Held(NamedTuple):
    """What a page must print: the frequencies of a structure from one to another, Hz, or values that were published, and words."""

    of: str | tuple[float, ...] = ()
    within: float = 1e-3
    first: int = 0
    last: int | None = None
    words: tuple[str, ...] = ()

    def values(self) -> list[float]:
        """Return the values."""
        if not isinstance(self.of, str):
            return list(self.of)
        from modalscope import systems

        return [float(f) for f in systems.catalog()[self.of]().modes().frequencies[self.first : self.last]]


#: Published by the authors of the data, Hz.
BEAM = (177.0, 477.4, 933.1, 1535.5)
BUILDING = (1.882, 2.422, 2.687)

#: Page -> what it must print. How near: noise of the simulation, digits of the publication.
HELD = {
    "start/plot_1_hammer": Held(BEAM),
    "start/plot_2_shaker": Held("chain5"),
    "start/plot_3_ambient": Held(BUILDING, 2e-3),
    "howto/plot_arrays": Held("chain5"),
    "howto/plot_by_hand": Held("chain5", last=3),
    "howto/plot_certify": Held(words=("True  True  True  True  True",)),
    "howto/plot_close_modes": Held("close4", 1e-4),
    "howto/plot_compare": Held("chain5", words=("All 5 modes can be trusted",)),
    "howto/plot_dwell": Held("chain5", first=1),
    "howto/plot_fdd": Held(BUILDING, 5e-3),
    "howto/plot_frames": Held("chain5", 2e-3, last=4),
    "howto/plot_free_decay": Held("chain5"),
    "howto/plot_n4sid": Held("chain5", 3e-3),
    "howto/plot_okid": Held("chain5"),
    "howto/plot_polymax": Held(BEAM),
    "howto/plot_read_a_table": Held(words=("600 samples at 20 Hz, 4 outputs (acceleration), 1 input",)),
    "howto/plot_replay": Held(words=("True",)),
    "howto/plot_report_file": Held(words=("no request to anywhere",)),
    "howto/plot_residuals": Held("chain5", first=0, last=1),
}

_OUTPUT = re.compile(r'<div class="sphx-glr-script-out[^>]*>(.*?)</pre>', re.DOTALL)
_NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")


def drifted(root: Path) -> list[str]:
    """Return what pages of a built site do not print any more, as sentences."""
    found = []
    for name, held in HELD.items():
        page = root / "generated" / f"{name}.html"
        if not page.is_file():
            found.append(f"{name}: there is no such page")
            continue
        parts = _OUTPUT.findall(page.read_text(encoding="utf-8"))
        text = unescape(re.sub(r"<[^>]+>", "", "\n".join(parts)))
        found += [f"{name}: {each}" for each in missing(text, held)]
    return found


def missing(text: str, held: Held) -> Sequence[str]:
    """Return which of the values and words a text does not hold.

    Examples
    --------
    >>> missing("modes at 1.0004 and 2.1 Hz", Held((1.0, 2.0), words=("modes", "trusted")))
    ['it does not print 2 (within 0.1 %)', 'it does not say trusted']
    """
    printed = np.array([float(number) for number in _NUMBER.findall(text)] or [np.inf])
    near = [float(np.min(np.abs(printed / value - 1))) for value in held.values()]
    told = [
        f"it does not print {value:g} (within {100 * held.within:g} %)"
        for value, far in zip(held.values(), near, strict=True)
        if far > held.within
    ]
    return told + [f"it does not say {word}" for word in held.words if word not in text]
