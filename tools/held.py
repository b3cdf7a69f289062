"""Figures that the documentation prints, held to what they must be: exact values of simulated structures, published ones of measured data.

A page of the gallery is named with the values that its output must show, and how near. `make docs` asks this of every built page.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from html import unescape
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tools import exact

__all__ = ["HELD", "Held", "drifted", "missing"]


class Held(NamedTuple):
    """What a page must print.

    The frequencies of a structure from one to another, Hz, or values that were published or come by another way, each so many times
    (found, and true); and words.
    """

    of: str | tuple[float, ...] | Callable[[], Iterable[float]] = ()
    within: float = 1e-3
    first: int = 0
    last: int | None = None
    words: tuple[str, ...] = ()
    times: int = 1

    def values(self) -> list[float]:
        """Return the values."""
        if callable(self.of):
            return [float(value) for value in self.of()]
        if not isinstance(self.of, str):
            return list(self.of)
        from modalscope import systems

        return [float(f) for f in systems.catalog()[self.of]().modes().frequencies[self.first : self.last]]


#: Published by the authors of the data or of the structure, Hz.
BEAM = (177.0, 477.4, 933.1, 1535.5)
BUILDING = (1.882, 2.422, 2.687)
FRAME = (9.41, 11.79, 16.38, 25.54)

#: Page -> what it must print. How near: noise of the simulation, digits of the publication, digits that are printed.
HELD = {
    # before refinement; the published values scatter by .5 Hz over single responses
    "executed/plot_0_identification": Held(BEAM, 3e-3, times=2),
    "start/plot_1_hammer": Held(BEAM),
    "start/plot_2_shaker": Held("chain5"),
    "start/plot_3_ambient": Held(BUILDING, 2e-3),
    "start/plot_4_earthquake": Held(exact.storeys, 3e-3, times=2),
    "start/plot_5_control": Held(exact.least_damping, 0.1, words=("explains 99.7 %",)),
    "howto/plot_animate": Held(FRAME[1:2]),
    "howto/plot_arrays": Held("chain5"),
    "howto/plot_bad_hit": Held(words=("overload: u1: hit 1:", "the force stays at 2000")),
    "howto/plot_by_hand": Held("chain5", last=3),
    "howto/plot_certify": Held(words=("True  True  True  True  True",)),
    "howto/plot_close_modes": Held("close4", 1e-4, times=2),
    "howto/plot_compare": Held("chain5", words=("Methods agree on all 5 modes",)),
    "howto/plot_complex_modes": Held(exact.collinearity, 2e-4),
    "howto/plot_doctor": Held(words=("clipped: y3:",)),
    "howto/plot_dwell": Held("chain5", first=1),
    "howto/plot_export": Held(words=("[1. 1. 1. 1. 1.] [1. 1. 1. 1. 1.]",)),
    "howto/plot_fdd": Held(BUILDING, 5e-3),
    "howto/plot_frames": Held("chain5", 3e-3),
    "howto/plot_free_decay": Held("chain5"),
    "howto/plot_frf_estimators": Held((1 / 1.09, 1.0), 0.01),
    "howto/plot_intervals": Held(words=("within: [ True  True  True  True  True]",)),
    "howto/plot_mass_scaling": Held(exact.unit_mass, 3e-3, times=6),
    "howto/plot_matrices": Held(exact.stiffness_over_mass, 1e-4, times=2),
    "howto/plot_months": Held(words=("change at 2026-04-11", "1: 1.246 Hz -0.194")),
    "howto/plot_n4sid": Held("chain5", 3e-3),
    "howto/plot_okid": Held("chain5"),
    "howto/plot_on_geometry": Held(FRAME),
    "howto/plot_order": Held((1.0,), 0.03, words=("% unexplained",)),
    "howto/plot_orders_of_rotation": Held(words=("[0.8 0.5]",)),
    "howto/plot_polymax": Held(BEAM),
    "howto/plot_quantity": Held((2 * np.pi * 158 / 60,), 2e-3),
    "howto/plot_read_a_table": Held(words=("600 samples at 20 Hz, 4 outputs (acceleration), 1 input",)),
    "howto/plot_refine": Held(exact.damping, 0.03, times=2),
    "howto/plot_replay": Held(words=("True",)),
    "howto/plot_report_file": Held(words=("no request to anywhere",)),
    "howto/plot_residuals": Held("chain5", first=0, last=1),
    "howto/plot_roving_hammer": Held("chain5"),
    "howto/plot_runs": Held("chain5"),
    "howto/plot_setups": Held(exact.six_masses, 6e-3),
    "howto/plot_several_bands": Held(BEAM),
    "howto/plot_sixty_files": Held(words=("probability 1 that they are the same mode",)),
    "howto/plot_ssi_data": Held("chain5", 3e-3),
    "howto/plot_sweep": Held("chain5"),
    "howto/plot_synthesize": Held(exact.receptance, 1e-5),
    "howto/plot_take_refuse": Held("chain5", last=3),
    "howto/plot_two_tests": Held(exact.softened, 2e-3),
    "howto/plot_uneven_shifts": Held("chain5", 1e-3, times=2),
    "howto/plot_validate_model": Held(words=("99.7        99.7",)),
    "howto/plot_windows": Held(exact.hit_peaks, 4e-3, times=2),
    "howto/plot_wrong_sign": Held(words=("polarity: 2:+X", "Change the sign of 2:+X")),
    "howto/plot_zoom_band": Held(BEAM[1:2]),
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
    >>> missing("found 1.0004, true 1.1", Held((1.0,), times=2))
    ['it does not print 1 (within 0.1 %) 2 times']
    """
    printed = np.array([float(number) for number in _NUMBER.findall(text)] or [np.inf])
    near = [np.abs(printed / value - 1) for value in held.values()]
    told = [
        f"it does not print {value:g} (within {100 * held.within:g} %){'' if held.times == 1 else f' {held.times} times'}"
        for value, far in zip(held.values(), near, strict=True)
        if np.sum(far <= held.within) < held.times
    ]
    return told + [f"it does not say {word}" for word in held.words if word not in text]
