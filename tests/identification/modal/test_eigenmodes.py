"""Canonical forms: the smaller one, and what is extraneous in them."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.identification.identify import identify
from modalscope.identification.modal.eigenmodes import eigenmodes, split_extraneous
from tests.support import FIVE, add_noise, built, match_poles


@pytest.mark.parametrize("name", FIVE)
@pytest.mark.parametrize("form", ["observable", "controllable"])
def test_all_poles_lie_inside_the_circle(name, form):
    """Minimum norm keeps those inside that no mode is of (order conditions, recipe c)."""
    structure = FIVE[name]()
    truth = np.exp(np.linalg.eigvals(structure.state_space().A) * structure.dt)
    options = {"method": "polyreference", "form": form, "order": truth.size, "block_rows": 12, "block_columns": 12}
    p = built(structure.impulse_response(100), **options)
    forward = np.linalg.eigvals(p.triple(truth.size).A)
    assert np.all(abs(forward) < 1)
    assert max(abs(forward - z).min() for z in truth) < 1e-8


def test_the_smaller_form_is_the_default():
    """Of l r = 48 and m s = 36 states the 36; with fewer columns than rows the other way round."""
    response = FIVE["chain5"]().impulse_response(100)
    states = {}
    for rows, columns in ((12, 18), (8, 30)):
        p = built(response, method="polyreference", order=10, block_rows=rows, block_columns=columns)
        states[rows, columns] = (p.settings["form"], p.triple(10).A.shape[0])
    assert states == {(12, 18): ("controllable", 36), (8, 30): ("observable", 32)}


def test_extraneous_poles_have_a_field_of_their_own():
    found = identify(
        FIVE["chain5"]().impulse_response(100), method="polyreference", order=10, block_rows=12, block_columns=18
    )
    assert len(found.modes) == 5
    states = np.where(found.extraneous.poles.imag == 0, 1, 2).sum() - found.extraneous.kinds.count("nyquist")
    assert states == 36 - 10


@pytest.mark.parametrize(
    ("name", "snr", "share"), [("chain5", 20.0, 0.95), ("ring5", 20.0, 1.0), ("close4", 20.0, 1.0)]
)
@pytest.mark.parametrize("form", ["observable", "controllable"])
def test_modes_are_told_from_extraneous_poles_in_noise(name, snr, share, form):
    """What the truncated factor holds; by the amplitude in the first block chain5 lost a mode in four."""
    structure = FIVE[name]()
    truth = np.linalg.eigvals(structure.state_space().A)
    rows, columns = (20, 120) if form == "observable" else (120, 20)
    hits, poles = 0, 0
    for seed in range(6):
        response = add_noise(structure.impulse_response(400), snr, seed)
        p = built(response, method="polyreference", form=form, order=truth.size, block_rows=rows, block_columns=columns)
        model = p.triple(truth.size)
        modes = eigenmodes(p.matrix, model)
        best = match_poles(modes.poles, truth).index
        own, _ = split_extraneous(modes, model)
        hits, poles = hits + len(set(own) & set(best)), poles + best.size
    assert hits >= share * poles
