"""Without noise every method of the time domain finds the poles, on the five structures and on random systems."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from modalscope.data import ImpulseResponse, StateSpace
from modalscope.identification.identify import identify
from modalscope.numerics.functions.poles import to_continuous
from tests.support import FIVE, match_poles, pole_tolerance, random_systems, relative

METHODS = [
    (method, form)
    for method in ("era", "alternate", "least_squares", "polyreference", "prce")
    for form in ("observable", "controllable")
]

#: Canonical forms carry poles that are not in the data, and lose a digit to them.
CANONICAL = {"polyreference": 10.0, "prce": 10.0}


def pole_error(found, poles, truth):
    """Largest distance of matched poles over the size of the true one: frequency and damping in one number."""
    match = match_poles(poles, truth)
    true = truth[np.flatnonzero(truth.imag >= -1e-12 * abs(truth))]
    return max(float(np.min(np.abs(poles - s)) / abs(s)) for s in true) if match.index.min() >= 0 else np.inf


def check(response: ImpulseResponse, truth, n: int, rows: int, columns: int, method: str, form: str) -> None:
    order = n
    if method == "prce":
        block = response.values.shape[1 if form == "observable" else 2]
        order = block * (rows if form == "observable" else columns)
    found = identify(
        response, method=method, form=form, order=order, block_rows=rows, block_columns=columns, reciprocal=False
    )
    tolerance = pole_tolerance(found.singular_values, n) * CANONICAL.get(method, 1.0)
    assert pole_error(found, found.modes.poles, truth) < tolerance
    assert found.fit_error < 100 * tolerance


@pytest.mark.parametrize(("method", "form"), METHODS)
@pytest.mark.parametrize("name", FIVE)
def test_five_structures(name, method, form):
    structure = FIVE[name]()
    truth = np.linalg.eigvals(structure.state_space().A)
    check(structure.impulse_response(200), truth, truth.size, 12, 24, method, form)


@pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
@pytest.mark.parametrize("method", ["era", "alternate", "least_squares", "polyreference", "prce"])
def test_other_quantities(quantity, method):
    structure = FIVE["chain5"]()
    truth = np.linalg.eigvals(structure.state_space().A)
    check(structure.impulse_response(200, quantity=quantity), truth, truth.size, 12, 24, method, "observable")


@pytest.mark.slow
@pytest.mark.parametrize(("method", "form"), METHODS)
def test_random_systems(method, form):
    @settings(max_examples=30, deadline=None, derandomize=True)
    @given(random_systems())
    def run(model: StateSpace) -> None:
        n = model.A.shape[0]
        blocks = -(-n // min(model.B.shape[1], model.C.shape[0])) + 4
        response = model.impulse_response(2 * blocks, kind="dirac")
        check(response, to_continuous(np.linalg.eigvals(model.A), 1.0), n, blocks, blocks, method, form)

    run()


@pytest.mark.parametrize("method", ["era", "alternate", "least_squares", "polyreference", "prce"])
@pytest.mark.parametrize(("outputs", "inputs"), [(4, 2), (30, 3)])
def test_a_mode_of_a_ten_millionth_is_found_by_default(method, outputs, inputs):
    """Without an order and without block sizes, on the dense route and on the structured one."""
    from tests.identification.matrices.test_factor import response_of

    response, s = response_of(1e-7, outputs, inputs)
    match = match_poles(identify(response, method=method).modes.poles, s)
    assert match.frequency_error < 1e-6
    assert match.damping_error < 1e-6


@pytest.mark.parametrize("reduction", ["projection", "markov"])
@pytest.mark.parametrize("form", ["observable", "controllable"])
@pytest.mark.parametrize("name", FIVE)
def test_polyreference_at_minimum_order(name, form, reduction):
    """The model has n states, rebuilds the response, and no pole is extraneous."""
    structure = FIVE[name]()
    truth = np.linalg.eigvals(structure.state_space().A)
    response = structure.impulse_response(200)
    found = identify(
        response,
        method="polyreference",
        form=form,
        order=truth.size,
        block_rows=12,
        block_columns=24,
        reduction=reduction,
    )
    assert found.state_space.A.shape == (truth.size, truth.size)
    assert len(found.extraneous) == 0
    assert pole_error(found, found.modes.poles, truth) < 10 * pole_tolerance(found.singular_values, truth.size)
    assert relative(found.rebuild().values, response.values) < 1e-9


def test_the_two_reductions_differ_in_noise_and_each_repairs_the_heavy_mode():
    """The 35 % mode sits among the extraneous poles and is lost by a decade or more; at minimum order it is found."""
    from tests.support import add_noise

    structure = FIVE["heavy4"]()
    truth = np.linalg.eigvals(structure.state_space().A)
    response = add_noise(structure.impulse_response(400), 40.0)
    options = {"method": "polyreference", "form": "observable", "order": 8, "block_rows": 20, "block_columns": 120}
    errors = {
        how: match_poles(identify(response, reduction=how, **options).modes.poles, truth).frequency_error
        for how in (None, "projection", "markov")
    }
    assert len(set(errors.values())) == 3
    assert all(errors[how] < 0.1 * errors[None] for how in ("projection", "markov"))
