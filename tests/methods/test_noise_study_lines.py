"""Noise study: medians over 100 runs against the recipes' table (Arnoldi basis, q = 20), entries below 1e-2 within a factor of 2."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from modalscope import identify
from tests.studies import Study
from tests.support import FIVE, add_noise, match_poles

RUNS = 100

#: The recipes' q = 20 polynomials p_0 ... p_19 are 19 block rows of H(0), and one more.
BLOCK_ROWS = 19
LINES = np.linspace(0.3, 8, 160)

#: (method, quantity, dB) -> structure -> median of the largest error over the modes: frequency, damping. Medians of eight runs,
#: rounded to one digit, hence the factor; larger entries are not statistics of a mode that was found.
TABLE = {
    ("era", "displacement", 40): {
        "chain5": (3e-4, 1e-2),
        "ring5": (9e-5, 6e-3),
        "close4": (6e-5, 4e-3),
        "heavy4": (1e-2, 2e-2),
    },
    ("alternate", "displacement", 40): {
        "chain5": (1e-4, 1e-2),
        "ring5": (1e-4, 6e-3),
        "close4": (6e-5, 4e-3),
        "heavy4": (4e-3, 8e-3),
    },
    ("era", "displacement", 20): {"chain5": (1e-2, 2e-1), "ring5": (1e-3, 1e-1), "close4": (1e-3, 5e-2)},
    ("alternate", "displacement", 20): {"chain5": (2e-3, 2e-1), "ring5": (1e-3, 6e-2), "close4": (7e-4, 5e-2)},
    ("era", "acceleration", 40): {
        "chain5": (3e-5, 2e-2),
        "ring5": (4e-5, 4e-3),
        "close4": (3e-5, 2e-3),
        "heavy4": (1e-3, 4e-3),
        "over4": (2e-2, 2e-3),
    },
    ("alternate", "acceleration", 40): {
        "chain5": (3e-5, 2e-2),
        "ring5": (4e-5, 4e-3),
        "close4": (3e-5, 2e-3),
        "heavy4": (9e-4, 3e-3),
        "over4": (7e-3, 2e-3),
    },
    ("era", "acceleration", 20): {"chain5": (8e-4, 2e-1), "ring5": (1e-3, 4e-2), "close4": (4e-4, 2e-2)},
    ("alternate", "acceleration", 20): {"chain5": (4e-4, 2e-1), "ring5": (4e-4, 4e-2), "close4": (3e-4, 2e-2)},
}


#: The balanced form has a bias that changes erratically with the degree, here 1.2e-3 (q = 14, 30) to 8e-3 (q = 20): H(0) and H(1) share
#: their noise. A table at one degree is no closer than this; the alternate form stays between 1e-3 and 2e-3 for all of them.
UNSTEADY = 3


@pytest.mark.study("methods")
@pytest.mark.parametrize("name", FIVE)
@pytest.mark.parametrize(("method", "quantity", "snr"), TABLE)
def test_medians_are_those_of_the_recipes(
    method: str, quantity: str, snr: int, name: str, study: Callable[[str, str], Study]
) -> None:
    if name not in TABLE[method, quantity, snr]:
        pytest.skip("no entry below 1e-2")
    s = FIVE[name]()
    frf, truth = s.frequency_response(LINES, quantity=quantity), s.modes().poles
    errors = np.array(
        [
            match_poles(
                identify(
                    add_noise(frf, snr, seed), method=method, domain="s", order=2 * s.degrees, block_rows=BLOCK_ROWS
                ).modes.poles,
                truth,
            )[:2]
            for seed in range(RUNS)
        ]
    )
    found = np.median(errors, axis=0)
    table = study(
        f"published table, lines, {method} (s), {quantity}, {snr} dB, {name}", f"{RUNS} runs, seeds 0 to {RUNS - 1}"
    )
    factor = UNSTEADY if (method, quantity, snr, name) == ("era", "displacement", 20, "ring5") else 2
    for what, value, expected in zip(("f", "zeta"), found, TABLE[method, quantity, snr][name], strict=True):
        most = factor * expected if expected < 1e-2 else None
        table.row(f"median of the largest error, {what} (published {expected:.0e})", value, most=most, form=".1e")
    assert not table.missed
