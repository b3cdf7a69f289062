"""What tests of every package share: where data lie, structures, random systems, matched poles and noise.

Import it as `from tests.support import ...`.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from modalscope import systems
from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals, StateSpace
from modalscope.data.response import Response
from modalscope.identification.pipeline import Pipeline, factor
from modalscope.identification.prepare import prepare
from modalscope.identification.sweep import Cut, Sweep
from modalscope.numerics.functions.poles import frequencies_and_damping, one_of_each_pair, poles_from

#: The project, and the measured beam that comes with it.
ROOT = Path(__file__).resolve().parents[1]
BEAM = ROOT / "examples" / "beam_hammer"

#: A browser to look at pages with, and how it is started: without a graphics card, as machines that test have none.
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
BROWSER = ["--no-sandbox", "--disable-gpu"]

#: Measured data too large for the repository: beside it, or where MODALSCOPE_DATA says. Each folder has its licence.
DATA = Path(os.environ.get("MODALSCOPE_DATA") or ROOT.parent / "shared" / "data")

#: The five structures on which every method is tried, by name; call one to build it.
FIVE = {name: systems.catalog()[name] for name in ("chain5", "ring5", "close4", "heavy4", "over4")}

#: Noise of the identities' tests, dB.
SNR_DB = 20.0

#: How modalscope says that an extra is missing (`modalscope.numerics.errors`), as it is or within the text of another error.
WANTED = re.compile(
    r"(?P<package>[\w.-]+) is not installed\.[\s\\n]+Run: pip install [\\'\"]*(?P<extra>modalscope\[\w+\])"
)

EPS = float(np.finfo(float).eps)


def wanted_extra(error: str) -> str | None:
    """Return what a test that failed with an error would have needed: an extra that is named there and is really not here."""
    told = WANTED.search(error)
    if told is None or find_spec(told["package"].partition(".")[0]):
        return None
    return f"{told['package']} is not installed: {told['extra']}"


def cut_order(pipeline: Pipeline, order: int, *, deviations: bool = True) -> Cut:
    """Return one order of a pipeline."""
    return Sweep(pipeline, [order], deviations=deviations).cut(order)


def built(data: Signals | Response, order: int, **options: Any) -> Pipeline:
    """Factor data for one row of the table up to an order; the options are those of `identify`."""
    return factor(prepare(data, **options), order)


Noisy = TypeVar("Noisy", ImpulseResponse, FrequencyResponse, Signals)


def random_system(
    rng: np.random.Generator,
    *,
    outputs: int | None = None,
    inputs: int | None = None,
    modes: int | None = None,
    damping: tuple[float, float] = (0.001, 0.3),
    direct: bool = False,
    sampled: bool = True,
) -> StateSpace:
    """Return a random stable model: outputs and inputs 1-6, up to 12 modes of 0.1 to 30 % damping, below Nyquist.

    Frequencies are spread over .02 to .45 of the sampling rate (1 Hz), at least .01 Hz apart; every mode is seen
    by every output and driven by every input, and the states are mixed by a random orthogonal change of coordinates.
    """
    l = int(rng.integers(1, 7)) if outputs is None else outputs
    m = int(rng.integers(1, 7)) if inputs is None else inputs
    n = int(rng.integers(1, 13)) if modes is None else modes
    steps = np.sort(rng.uniform(0, 1, n)) * (0.43 - 0.01 * n) + 0.01 * np.arange(n)
    poles = poles_from(0.02 + steps, np.exp(rng.uniform(*np.log(damping), n)))
    A = np.zeros((2 * n, 2 * n))
    for i, s in enumerate(poles):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[s.real, s.imag], [-s.imag, s.real]]
    # entries of modulus 1/2 to 2 and any sign or phase: no mode is invisible
    C = _visible(rng, (l, n))
    B = _visible(rng, (m, n)).T
    turn = np.linalg.qr(rng.standard_normal((2 * n, 2 * n)))[0]
    model = StateSpace(
        A=turn.T @ A @ turn,
        B=turn.T @ np.stack([B.real, B.imag], axis=1).reshape(2 * n, m),
        C=np.stack([C.real, C.imag], axis=2).reshape(l, 2 * n) @ turn,
        D=rng.standard_normal((l, m)) if direct else None,
    )
    return model.to_discrete(1.0, "dirac") if sampled else model


def _visible(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    return rng.uniform(0.5, 2, shape) * np.exp(2j * np.pi * rng.uniform(size=shape))


def random_systems(**fixed: object) -> st.SearchStrategy[StateSpace]:
    """Return a hypothesis strategy of `random_system`; keyword arguments fix what is not to vary."""
    return st.integers(0, 2**32 - 1).map(lambda seed: random_system(np.random.default_rng(seed), **fixed))  # type: ignore[arg-type]


def measured(*parts: str) -> Path:
    """Return a file or folder of the measured data; the test is skipped where it is not there (see conftest)."""
    path = DATA.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"{'/'.join(parts)} is not there")
    return path


def stored_list(name: str) -> dict[str, Any]:
    """Return the list of modes of a real test as it stands; `tests/test_results.py` holds every analysis of one to it."""
    return dict(json.loads((ROOT / "tests" / "results" / "reference.json").read_text("utf-8"))[f"real: {name}"])


def refused(text: str, call: Callable[..., Any], *arguments: Any, **options: Any) -> DataError:
    """Return the error of a call that must be a DataError of three parts, and match."""
    with pytest.raises(DataError, match=text) as error:
        call(*arguments, **options)
    assert all((error.value.asked, error.value.found, error.value.change))
    return error.value


class Match(NamedTuple):
    """How far found poles are from the true ones, and which of the found ones was taken for each."""

    frequency_error: float
    damping_error: float
    index: np.ndarray


def match_poles(found: ArrayLike, truth: ArrayLike) -> Match:
    """Pair every true pole with a found one of its own, as near as can be in all, and return the worst relative errors.

    Both in rad/s; conjugates are left out of both. The frequency error is | |s| - |s0| | / |s0|, the damping error the
    same of zeta. With fewer found than true poles both errors are infinite.
    """
    found, truth = np.atleast_1d(np.asarray(found, complex)), np.atleast_1d(np.asarray(truth, complex))
    kept = one_of_each_pair(found)
    truth = truth[one_of_each_pair(truth)]
    if kept.size < truth.size:
        return Match(np.inf, np.inf, np.full(truth.size, -1))
    distance = np.abs(found[kept] - truth[:, None]) / np.maximum(np.abs(truth[:, None]), 1e-300)
    rows, columns = linear_sum_assignment(np.minimum(distance, 1e6))
    chosen = kept[columns[np.argsort(rows)]]
    f, zeta = frequencies_and_damping(found[chosen])
    f0, zeta0 = frequencies_and_damping(truth)
    return Match(float(np.max(np.abs(f / f0 - 1))), float(np.max(np.abs(zeta - zeta0) / np.abs(zeta0))), chosen)


def add_noise(data: Noisy, snr_db: float = SNR_DB, rng: np.random.Generator | int = 0) -> Noisy:
    """Return the data with white noise on every channel, `snr_db` below the channel's own RMS."""
    return systems.add_noise(data, 10 ** (-snr_db / 20), rng)


def relative(a: ArrayLike, b: ArrayLike) -> float:
    """Return the norm of a - b over the norm of b."""
    a, b = np.asarray(a), np.asarray(b)
    return float(np.linalg.norm(a - b) / max(float(np.linalg.norm(b)), 1e-300))


def pole_tolerance(singular_values: ArrayLike, order: int) -> float:
    """Return max(1e-10, 100 eps sigma_1 / sigma_n), what rounding costs a realization of this order."""
    d = np.asarray(singular_values)
    return max(1e-10, float(100 * EPS * d[0] / d[order - 1]))


def model_transfer(model: StateSpace, frequencies: ArrayLike, shift: int = 0) -> np.ndarray:
    """Return C A^i (x I - A)^-1 B on lines in Hz: the i-th derivative (Eqs. 71, 75), or the shift by i samples (Eq. 81)."""
    power = np.linalg.matrix_power(model.A, shift)
    rest = StateSpace(A=model.A, B=model.B, C=model.C @ power, dt=model.dt)
    return rest.frequency_response(frequencies).values


def row_selection(kept: Sequence[int], rows: int) -> np.ndarray:
    """Return T that keeps some rows, (len(kept), rows)."""
    return np.eye(rows)[list(kept)]


def row_sums(groups: Sequence[Sequence[int]], rows: int) -> np.ndarray:
    """Return T whose rows sum groups of rows, (groups, rows)."""
    return np.array([row_selection(group, rows).sum(axis=0) for group in groups])


def random_projection(kept: int, rows: int, *, seed: int = 0) -> np.ndarray:
    """Return T with orthonormal random rows, (kept, rows), the same for the same seed."""
    return np.linalg.qr(np.random.default_rng(seed).standard_normal((rows, kept)))[0].T
