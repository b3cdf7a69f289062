"""What cannot be done is an error that says what to change; what is odd is found and labelled."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import DataError, ImpulseResponse, StateSpace
from modalscope.identification.identify import identify
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import prepare
from tests.support import FIVE, add_noise, match_poles, relative

CHAIN = FIVE["chain5"]()
RESPONSE = CHAIN.impulse_response(200)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"order": 11}, "order=11: the data matrix has rank 10.*Lower the order"),
        ({"order": 10, "block_rows": 150, "block_columns": 60}, "reads samples 0 to 209, but the response has 200"),
        ({"order": 10, "block_rows": 0}, "block_rows"),
        ({"order": 0}, "order"),
        ({"order": 10, "row_shifts": [0, 2, 4, 6]}, "multiples of 2"),
        ({"order": 10, "form": "both"}, "form"),
        ({"order": 10, "reduction": "markov"}, "only the canonical form of the null space"),
        ({"order": 10, "factorization": "power"}, "factorization"),
    ],
)
def test_era_with_what_cannot_be(options, words):
    with pytest.raises(DataError, match=f"(?s){words}"):
        identify(RESPONSE, method="era", **options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"order": 7, "form": "observable"}, "order=7 of a least-squares companion.*multiple of 4"),
        ({"order": 48, "form": "observable", "block_rows": 10}, "at most 40 with 10 blocks"),
    ],
)
def test_prce_with_what_cannot_be(options, words):
    with pytest.raises(DataError, match=f"(?s){words}"):
        identify(RESPONSE, method="prce", **options)


@pytest.mark.parametrize("method", ["alternate", "polyreference"])
def test_too_few_blocks_are_named(method):
    """ring5 by two outputs needs six block rows: with five the matrix has its rank, but not without its last block."""
    ring = FIVE["ring5"]()
    response = ring.impulse_response(100, outputs=[0, 1])
    options = {"method": method, "form": "observable", "order": 10, "block_columns": 40}
    with pytest.raises(DataError, match=r"(?s)rank 9.*more block rows"):
        identify(response, block_rows=4, **options)
    truth = np.linalg.eigvals(ring.state_space().A)
    with pytest.raises(DataError, match="observability index"):
        identify(response, block_rows=5, **options)
    assert match_poles(identify(response, block_rows=6, **options).modes.poles, truth).frequency_error < 1e-9


def test_orders_below_one_without_rank_have_the_coordinates_of_their_factors():
    """ring5 by five block rows, as above: E0 P loses its rank at order 10 alone, and A = d^-1/2 (E0 P)# (E1 P) d^1/2 stays below."""
    response = FIVE["ring5"]().impulse_response(100, outputs=[0, 1])
    asked = prepare(response, method="alternate", form="observable", block_rows=5, block_columns=40)
    pipeline = factor(asked, 10)
    assert np.linalg.cond(pipeline.realization.gram) > 1e13
    for n in (4, 8, 9):
        P, root = pipeline.factors.P[:, :n], np.sqrt(pipeline.factors.d[:n])
        A = np.linalg.pinv(P[:-2]) @ P[2:] * root / root[:, None]
        # lost: the conditions of (E0 P)'(E0 P), 90 at most, and of root, below 30
        assert relative(pipeline.triple(n).A, A) < 1e-11


def test_prce_below_the_controllability_index_is_refused_and_above_it_is_exact():
    """ring5 with two inputs: m p = 10 = n does not suffice at p = 5, p = 6 is exact."""
    ring = FIVE["ring5"]()
    truth = np.linalg.eigvals(ring.state_space().A)
    response = ring.impulse_response(100)
    with pytest.raises(DataError, match=r"companion of 5 blocks: .*fewer than the observability index"):
        identify(response, method="prce", order=10, block_rows=40, block_columns=5)
    found = identify(response, method="prce", order=12, block_rows=40, block_columns=6)
    assert match_poles(found.modes.poles, truth).frequency_error < 1e-9


def sampled(poles, outputs: int = 3, inputs: int = 2, samples: int = 60) -> ImpulseResponse:
    """A response with given poles of the sampled system, one real state each."""
    rng = np.random.default_rng(4)
    model = StateSpace(
        A=np.diag(poles),
        B=rng.standard_normal((len(poles), inputs)),
        C=rng.standard_normal((outputs, len(poles))),
        dt=0.1,
    )
    return model.impulse_response(samples)


@pytest.mark.parametrize("method", ["era", "alternate", "least_squares", "polyreference", "prce"])
def test_negative_real_poles_are_labelled_nyquist(method):
    """ln gives half the sampling rate, 5 Hz: reported as what it is, never dropped, and the model stays exact."""
    order = 3 if method != "prce" else 18
    found = identify(
        sampled([0.9, 0.5, -0.8]), method=method, order=order, block_rows=6, block_columns=9, form="observable"
    )
    assert found.modes.kinds.count("nyquist") == 1
    assert any("nyquist" in str(note) for note in found.notes)
    assert relative(found.rebuild().values, found.response.values) < 1e-9


def test_poles_at_zero_are_labelled_zero_and_do_not_upset_the_others():
    """A state that is forgotten within one sample, next to a decaying one."""
    found = identify(sampled([0.9, 0.0]), method="era", order=2, block_rows=5, block_columns=10)
    assert found.modes.kinds.count("zero") + found.modes.kinds.count("real") + found.modes.kinds.count("nyquist") == 2
    assert np.min(abs(found.modes.poles - np.log(0.9) / 0.1)) < 1e-9
    assert np.all(np.isfinite(found.modes.poles))
    assert any(note.kind == "poles that are no modes" for note in found.notes)


def test_growing_poles_are_labelled_unstable():
    found = identify(sampled([1.05, 0.8]), method="era", order=2, block_rows=5, block_columns=10)
    assert "unstable" in found.modes.kinds


def test_of_repeated_poles_one_input_shows_one_each():
    """ring5's pairs are repeated twice: one input drives one of each pair, and the data show rank 6."""
    response = FIVE["ring5"]().impulse_response(200, inputs=[0])
    assert identify(response, method="era").order == 6


def test_a_defective_pair_of_poles_loses_half_of_the_digits_and_no_more():
    """A critically damped mass: two equal real poles with one eigenvector."""
    from modalscope.systems import Structure

    critical = Structure(mass=[[1.0]], stiffness=[[25.0]], damping=[[10.0]], dt=0.05)
    response = critical.impulse_response(100)
    found = identify(response, method="era", order=2, block_rows=10, block_columns=30)
    assert np.max(abs(found.modes.poles + 5)) < 1e-5
    assert relative(found.rebuild().values, response.values) < 1e-9


def test_a_bad_sensor_left_out_of_all_but_the_first_block():
    """Its noise then enters one row, which a small weight keeps from taking a state; its shape is still found."""
    truth = np.linalg.eigvals(CHAIN.state_space().A)
    clean = CHAIN.impulse_response(400)
    values = add_noise(clean, 60.0).values.copy()
    values[:, 1] += 0.5 * np.std(values[:, 1]) * np.random.default_rng(0).standard_normal(values[:, 1].shape)
    bad = ImpulseResponse(values=values, sampling_rate=20.0)
    options = {"method": "era", "order": 10, "block_rows": 20, "block_columns": 120}
    rows = [[*range(4)], *[[0, 2, 3]] * 19]
    weights = np.ones(4 + 3 * 19)
    weights[1] = 1e-3
    all_of_it = identify(bad, **options)
    most_of_it = identify(bad, row_subsets=rows, row_weights=weights, **options)
    errors = [match_poles(found.modes.poles, truth).damping_error for found in (all_of_it, most_of_it)]
    assert errors[1] < 0.5 * errors[0]
    assert most_of_it.modes.shapes.shape[0] == 4
