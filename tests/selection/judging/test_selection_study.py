"""Lists of hard random structures, of pure noise, and of one channel with many modes; a short form of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.checks import IntArray
from modalscope.numerics.functions.poles import poles_from
from tests.selection.judging.hard import (
    Structure,
    deviations_of,
    frequency_response,
    gains_of,
    impulse_response,
    random_structure,
    score,
)

KINDS: dict[str, Callable[..., Any]] = {"lines": frequency_response, "samples": impulse_response}


def judged(kind: str, decibel: float, seeds: range) -> IntArray:
    """Return how many lists hold all modes above 10 and 30 deviations and nothing else, all above 10 counted alone, and spurious modes."""
    counts = np.zeros(4, int)
    for seed in seeds:
        structure = random_structure(seed)
        response, sigma = KINDS[kind](structure, decibel, seed)
        own, alone = (count(structure, response, sigma) for count in (gains_of, deviations_of))
        found = score(structure, ms.select(ms.stabilize(response)))
        counts += [found.perfect(own > 10), found.perfect(own > 30), found.perfect(alone > 10), found.spurious]
    return counts


@pytest.mark.slow
@pytest.mark.parametrize("decibel", [40, 20])
@pytest.mark.parametrize("kind", list(KINDS))
def test_lists_of_hard_random_structures_are_complete_above_thirty_deviations_and_have_nothing_else(kind, decibel):
    seeds = range(2) if kind == "lines" else range(3)
    _, strong, _, spurious = judged(kind, decibel, seeds)
    assert (strong, spurious) == (len(seeds), 0)


@pytest.mark.study("selection")
@pytest.mark.parametrize("decibel", [40, 20])
@pytest.mark.parametrize("kind", list(KINDS))
def test_study_of_hard_random_structures(kind, decibel, study):
    """Seeds that nothing was developed on; of 100 lists 98 % is 98 within a deviation of 1.4."""
    above10, above30, alone, spurious = judged(kind, decibel, range(7000, 7100))
    found = study(f"hard random structures, {kind}, {decibel} dB", "100 structures, seeds 7000 to 7099")
    found.row("lists with all modes of significance 10, no others", above10, least=96)
    found.row("lists with all modes of significance 30, no others", above30, least=99)
    found.row("lists with all modes of significance 10 without other modes, no others", alone)
    found.row("false modes", spurious, most=1)
    assert not found.missed


def one_channel(seed: int, count: int = 17) -> Structure:
    """Return modes evenly spread over a band of 1 to 20, all of one sign or the other, of one output and input."""
    rng = np.random.default_rng(seed)
    f = 10 * np.exp(np.linspace(0, np.log(20), count)) * (1 + 0.02 * rng.standard_normal(count))
    s = poles_from(f, np.full(count, 0.01))
    size = rng.uniform(0.7, 1.4, count)
    return Structure(s, (size / (2j * s.imag) * s**2)[:, None, None], "acceleration")


@pytest.mark.slow
@pytest.mark.parametrize("domain", ["s", "z"])
def test_one_channel_shows_seventeen_modes_over_a_band_of_one_to_twenty(domain):
    # no model of one channel up to order 80 holds them all: what the others leave does
    structure = one_channel(0)
    response, _ = frequency_response(structure, 40, 0, lines=1200)
    found = score(structure, ms.select(ms.stabilize(response, domain=domain)))
    assert np.sum(found.found) >= 15
    assert found.spurious == 0


@pytest.mark.study("selection")
@pytest.mark.parametrize("size", [(300, 3, 1), (500, 6, 2), (800, 20, 2), (400, 1, 1)])
def test_study_of_pure_noise(size, study):
    count = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        lines = rng.standard_normal(size) + 1j * rng.standard_normal(size)
        frf = ms.FrequencyResponse(values=lines, frequencies=np.linspace(1, 50, size[0]), quantity="acceleration")
        samples = ms.ImpulseResponse(values=rng.standard_normal(size), sampling_rate=100.0)
        count += sum(len(ms.select(ms.stabilize(data))) for data in (frf, samples))
    name = " x ".join(map(str, size))
    found = study(
        f"white noise, {name} (samples or lines, outputs, inputs)", "20 seeds, 0 to 19, lines and samples of each"
    )
    found.row("modes", count, most=0)
    assert not found.missed
