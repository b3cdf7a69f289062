"""The published noise table, time-domain rows: medians over a hundred runs and more, within a factor of two (`make study`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from modalscope.identification.identify import identify
from modalscope.numerics.functions.poles import frequencies_and_damping
from tests.studies import Study
from tests.support import FIVE, add_noise

RUNS = 120

#: Entries above this are not compared: they are failures, and failures have no median worth the name.
COMPARED = 1e-2

ROWS, COLUMNS, SAMPLES = 20, 120, 400

#: Method and options of each row, and the table's median frequency / damping errors: chain5, ring5, close4, heavy4, over4 at
#: 40 dB, then at 20 dB. Samples of accelerations after a Dirac impulse.
TABLE = {
    "ERA n": (
        {"method": "era"},
        "6e-5/2e-2 6e-5/5e-3 4e-5/3e-3 4e-4/4e-3 2e-2/2e-3 8e-4/3e-1 6e-4/4e-2 4e-4/3e-2 4e-3/3e-2 2/5e-1",
    ),
    "ERA 2n": (
        {"method": "era", "times": 2},
        "6e-5/2e-2 5e-5/4e-3 4e-5/3e-3 8e-4/3e-3 4e-2/2e-3 8e-4/2e-1 5e-4/4e-2 4e-4/2e-2 5e-3/3e-2 5e-1/4e-2",
    ),
    "ERA, T_r random, 3n rows": (
        {"method": "era", "random": 3},
        "2e-4/1e-1 9e-5/9e-3 7e-5/1e-2 2e-3/7e-3 2e-1/5e-3 5e-3/1e1 1e-3/7e-1 9e-4/8e-1 1e-1/8e-1 2/1e1",
    ),
    "alternate, observable": (
        {"method": "alternate", "form": "observable"},
        "7e-5/4e-2 5e-5/5e-3 5e-5/3e-3 4e-4/4e-3 2e-2/2e-3 9e-4/3e-1 5e-4/5e-2 5e-4/3e-2 4e-3/4e-2 2/5e-1",
    ),
    "alternate, controllable": (
        {"method": "alternate", "form": "controllable"},
        "7e-5/3e-2 5e-5/5e-3 4e-5/2e-3 4e-4/4e-3 2e-2/2e-3 9e-4/3e-1 5e-4/4e-2 4e-4/2e-2 4e-3/3e-2 2/5e-1",
    ),
    "polyreference, observable": (
        {"method": "polyreference", "form": "observable"},
        "8e-5/4e-2 6e-5/4e-3 5e-5/3e-3 3e-2/1e-1 3e-1/3e-3 7e-4/3e-1 6e-4/4e-2 5e-4/3e-2 1e-1/4e-1 5e-1/1e-1",
    ),
    "polyreference, controllable": (
        {"method": "polyreference", "form": "controllable", "block_rows": 120, "block_columns": 20},
        "5e-5/2e-2 5e-5/4e-3 5e-5/4e-3 4e-2/9e-2 1/1e-1 5e-4/2e-1 5e-4/4e-2 5e-4/4e-2 7e-2/8e-1 9e-1/7e-2",
    ),
    "PRCE p = 24": (
        {"method": "prce", "order": 48, "block_columns": 24, "block_rows": 375},
        "6e-5/7e-3 5e-5/4e-3 3e-5/3e-3 1e-2/3e-2 3e-1/3e-2 6e-4/3e-1 5e-4/6e-2 3e-4/4e-2 1e-1/3e-1 6e-1/3e-1",
    ),
    "PRCE p = 60": (
        {"method": "prce", "order": 120, "block_columns": 60, "block_rows": 339},
        "6e-5/1e-2 4e-5/3e-3 3e-5/2e-3 7e-3/3e-2 3e-1/1e-2 7e-4/1e-1 4e-4/3e-2 3e-4/2e-2 6e-2/3e-1 7e-1/1e-1",
    ),
    "least squares, rank n": (
        {"method": "least_squares"},
        "6e-5/2e-2 6e-5/5e-3 4e-5/3e-3 4e-4/4e-3 2e-2/2e-3 8e-4/3e-1 6e-4/4e-2 4e-4/3e-2 4e-3/3e-2 2/5e-1",
    ),
    "least squares, not truncated": (
        {"method": "prce", "form": "observable", "order": 80},
        "6e-5/5e-2 5e-5/5e-3 3e-5/3e-3 3e-3/1e-2 1e-1/5e-3 8e-4/7e-1 5e-4/6e-2 3e-4/3e-2 2e-2/2e-1 5e-1/1e-1",
    ),
}


def low(printed: float) -> float:
    """The smallest number that is printed so, with one digit."""
    return printed - 0.5 * 10 ** np.floor(np.log10(printed))


def high(printed: float) -> float:
    """The largest."""
    return printed + 0.5 * 10 ** np.floor(np.log10(printed))


def errors(name: str, snr: float, options: dict, seed: int) -> tuple[float, float]:
    """Worst errors over the modes of one run; poles are paired with the nearest found, as in the table."""
    structure = FIVE[name]()
    truth = np.linalg.eigvals(structure.state_space().A)
    response = add_noise(structure.impulse_response(SAMPLES, quantity="acceleration", input="dirac"), snr, seed)
    chosen = {"order": truth.size, "block_rows": ROWS, "block_columns": COLUMNS, **options}
    chosen["order"] *= chosen.pop("times", 1)
    if "random" in chosen:
        kept = chosen.pop("random") * truth.size
        # as the table was made; the orthonormal rows of random_projection() do better
        rng = np.random.default_rng(seed)
        chosen["row_compression"] = rng.standard_normal((kept, ROWS * response.values.shape[1]))
    found = identify(response, **chosen)
    poles, truth = np.concatenate([found.modes.poles, found.extraneous.poles]), truth[truth.imag >= 0]
    nearest = poles[np.argmin(abs(poles - truth[:, None]), axis=1)]
    (f, zeta), (f0, zeta0) = frequencies_and_damping(nearest), frequencies_and_damping(truth)
    return float(np.max(abs(f / f0 - 1))), float(np.max(abs(zeta / zeta0 - 1)))


def eight_run_medians(runs: np.ndarray) -> tuple[float, float]:
    """Between what the medians of eight runs lie, ninety-nine times of a hundred: the table was made of eight."""
    draws = np.random.default_rng(0).choice(runs, size=(2000, 8))
    low_, high_ = np.quantile(np.median(draws, axis=1), [0.005, 0.995])
    return float(low_), float(high_)


@pytest.mark.study("methods")
def test_noise_table(study: Callable[[str, str], Study]) -> None:
    """All entries below a hundredth: within a factor of two, but for a few that eight runs leave to chance (112 of 115 were)."""
    cells = [(name, snr) for snr in (40.0, 20.0) for name in FIVE]
    compared, off, unexplained = 0, [], []
    seeds = f"{RUNS} runs, seeds 0 to {RUNS - 1}"
    for row, (options, printed) in TABLE.items():
        entries = [tuple(float(x) for x in pair.split("/")) for pair in printed.split()]
        for (name, snr), published in zip(cells, entries, strict=True):
            runs = np.array([errors(name, snr, options, seed) for seed in range(RUNS)]).T
            table = study(f"published table, samples, {row}, {snr:.0f} dB, {name}", seeds)
            for what, values, said in zip(("f", "zeta"), runs, published, strict=True):
                table.row(f"median of the largest error, {what} (published {said:.0e})", np.median(values), form=".1e")
                if said >= COMPARED:
                    continue
                compared += 1
                found, (least, most) = float(np.median(values)), eight_run_medians(values)
                if not low(said) / 2 <= found <= 2 * high(said):
                    off.append((row, name, snr, what, found, said))
                    if not least <= high(said) or not low(said) <= most:
                        unexplained.append((row, name, snr, what, least, most, said))
    print(*off, sep="\n  ")
    assert compared > 100
    table = study("published table, samples, all entries below a hundredth", seeds)
    table.row("entries", compared)
    table.row("not within a factor of two", 100 * len(off) / compared, most=4, unit=" %")
    table.row("of these, not explained by the eight runs of the table", len(unexplained), most=0)
    assert not table.missed
