"""How many states: right without noise, in noise as far as it can be known, and honest about the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.identification.identify import identify
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.hankel import hankel
from modalscope.identification.realizations.order import gap_after, noise_floor, recommend_order
from tests.support import FIVE, add_noise

SEEDS = range(8)


def advice(name: str, snr: float | None, seed: int = 0):
    """Of the matrix on which the noise statistics are made: 20 x 120 blocks of 400 samples of 4 x 2."""
    response = FIVE[name]().impulse_response(400)
    if snr is not None:
        response = add_noise(response, snr, seed)
    return recommend_order(factorize(hankel(response, block_rows=20, block_columns=120).shifted(0), 40))


@pytest.mark.parametrize("name", FIVE)
def test_without_noise_the_order_is_exact_and_certain(name):
    found = advice(name, None)
    assert found.order == 2 * FIVE[name]().degrees
    assert found.confidence == "certain"
    assert "no noise" in found.reason


# The table of the recipes (section 6, item 7): the gap is right for chain5, ring5, close4 and heavy4 at 40 dB; the
# threshold for chain5, ring5, heavy4, and up to 2 too high for close4; over4 is 9 to 15 by the threshold. That table's
# gap failed on over4 (7) and on heavy4 at 20 dB; the one here is relative to the gaps after it and finds over4 at 40 dB.


@pytest.mark.parametrize("name", FIVE)
def test_at_40_decibels_the_gap_is_right(name):
    states = 2 * FIVE[name]().degrees
    for seed in SEEDS:
        found = advice(name, 40.0, seed)
        assert found.by_gap == found.order == states


@pytest.mark.parametrize(
    ("name", "snr", "above"),
    [
        ("chain5", 40.0, 2),
        ("chain5", 20.0, 2),
        ("ring5", 40.0, 0),
        ("ring5", 20.0, 0),
        ("close4", 40.0, 2),
        ("close4", 20.0, 2),
        ("heavy4", 40.0, 4),
        ("heavy4", 20.0, 3),
        ("over4", 40.0, 7),
    ],
)
def test_the_threshold_is_right_or_a_little_high(name, snr, above):
    states = 2 * FIVE[name]().degrees
    counts = [advice(name, snr, seed).by_threshold for seed in SEEDS]
    assert min(counts) == states or name == "over4"
    assert states <= np.median(counts) <= max(counts) <= states + above


def visible(name: str, snr: float, seed: int) -> int:
    """States whose singular value without noise is above the largest of the noise alone: the others no rule can see."""
    clean = FIVE[name]().impulse_response(400)
    noise = replace(clean, values=add_noise(clean, snr, seed).values - clean.values)
    d, noise_d = (
        np.linalg.svd(hankel(x, block_rows=20, block_columns=120).shifted(0).dense(), compute_uv=False)
        for x in (clean, noise)
    )
    return int(np.count_nonzero(d > noise_d[0]))


@pytest.mark.slow
def test_what_is_called_certain_is_right_and_what_is_wrong_is_called_poor():
    """Over five structures, eight seeds, 40, 20 and 10 dB, against the states that can be seen."""
    said: dict[str, list[int]] = {"certain": [], "fair": [], "poor": []}
    for name in FIVE:
        for snr in (40.0, 20.0, 10.0):
            for seed in SEEDS:
                found = advice(name, snr, seed)
                said[found.confidence].append(abs(found.order - visible(name, snr, seed)))
    assert np.mean(np.array(said["certain"]) == 0) > 0.9
    assert max(said["certain"] + said["fair"]) <= 2
    assert np.mean(np.array(said["poor"]) == 0) < 0.5
    assert all(len(errors) >= 10 for errors in said.values())


def test_a_threshold_from_part_of_the_spectrum_is_that_of_all_of_it():
    """The structured route carries few singular values; the median is over all."""
    response = add_noise(FIVE["chain5"]().impulse_response(600), 30.0)
    H = hankel(response, block_rows=150, block_columns=220).shifted(0)
    fast, dense = recommend_order(factorize(H, 40, "gram")), recommend_order(factorize(H, 40, "dense"))
    assert fast.floor == pytest.approx(dense.floor, rel=1e-9)
    assert (fast.order, fast.by_gap, fast.by_threshold) == (dense.order, dense.by_gap, dense.by_threshold)


def test_noise_alone_stays_below_its_own_floor():
    noise = np.random.default_rng(1).standard_normal((120, 300))
    d = np.linalg.svd(noise, compute_uv=False)
    assert np.count_nonzero(d > noise_floor(d, 120, 300)) == 0
    assert gap_after(d)[1] < 7


def test_identify_without_an_order_takes_the_advice():
    response = FIVE["ring5"]().impulse_response(400, noise=0.01, seed=3)
    found = identify(response, method="era")
    assert found.order == 10
    assert any("order 10 was chosen (certain)" in str(note) for note in found.notes)
