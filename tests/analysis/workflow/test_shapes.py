"""Residues given poles: shapes, residuals of modes outside the band, real modes, repeated modes, modal masses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope import DataError, FrequencyResponse, ModalModel, StateSpace
from modalscope.analysis.workflow.shapes import fit_residues
from modalscope.data.indicators import OF_SHAPES
from modalscope.identification.identify import identify
from modalscope.identification.modal.state_space import from_modes
from modalscope.systems import chain, chain5
from tests.support import FIVE, random_system, relative

QUANTITIES = ("displacement", "velocity", "acceleration")

#: A fit of some dozens of unknowns to hundreds of lines, resonances a thousand times above the rest.
FIT = 1e-9


def responses(frf: FrequencyResponse, modes: ModalModel) -> float:
    return relative(modes.frequency_response(frf.frequencies).values, frf.values)


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("participation", ["given", "free"])
@pytest.mark.parametrize("name", ["chain5", "close4", "heavy4", "over4"])
def test_exact_poles_give_exact_residues(name: str, participation: str, quantity: str) -> None:
    s = FIVE[name]()
    truth = s.modes(quantity=quantity)
    frf = s.frequency_response(np.linspace(0.3, 8, 300), quantity=quantity)
    found = fit_residues(frf, truth, participation=participation, residuals=quantity != "acceleration")
    if quantity == "acceleration":  # the direct term is a constant; beside residuals it is the lower one
        assert found.feedthrough is not None
        assert relative(found.feedthrough, s.state_space(quantity=quantity).D) < 1e-6
    assert relative(found.residues, truth.residues) < 1e-6
    assert responses(frf, found) < FIT


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_residuals_stand_for_the_modes_outside_the_band(quantity: str) -> None:
    """Of a chain of 12 masses only the band of modes 4 to 6 is known: a constant leaves more than twice as much."""
    s = chain(np.ones(12), np.full(12, 400.0), damping_ratios=0.01, outputs=range(6), inputs=[0, 5])
    modes = s.modes(quantity=quantity).take([3, 4, 5])
    frf = s.frequency_response(np.linspace(2.4, 4.3, 200), quantity=quantity)
    fits = [responses(frf, fit_residues(frf, modes, residuals=residuals)) for residuals in (True, False)]
    assert fits[0] < 0.05  # the nearest modes outside are only a fifth of the band away
    assert fits[0] < 0.5 * fits[1]
    found = fit_residues(frf, modes)
    assert found.lower_residual is not None
    assert found.upper_residual is not None
    assert relative(found.residues, modes.residues) < 0.02


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_the_lower_residual_is_a_rigid_mass(quantity: str) -> None:
    """A free mass of 4 kg under an oscillator: (j w)^(p-2) / 5 far from it is found beside the elastic mode."""
    s = chain([4.0, 1.0], [0.0, 900.0], damping_ratios=[0, 0.01])
    modes = s.modes(quantity=quantity)
    elastic = modes.take(modes.frequencies > 1)
    frf = s.frequency_response(np.linspace(2, 9, 300), quantity=quantity)
    found = fit_residues(frf, elastic)
    assert found.lower_residual is not None
    rest = found.lower_residual if quantity != "acceleration" else found.lower_residual - elastic_direct(elastic)
    assert np.allclose(rest, 0.2, rtol=1e-6)
    assert responses(frf, found) < FIT


def elastic_direct(modes: ModalModel) -> np.ndarray:
    """What modes alone have as direct term as accelerances: 2 Re sum R / s."""
    return 2 * np.sum(modes.residues / modes.poles[:, None, None], axis=0).real


@pytest.mark.parametrize("participation", ["given", "free"])
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_real_modes_of_proportional_damping(quantity: str, participation: str) -> None:
    s = chain(np.ones(4), np.full(4, 400.0), damping_ratios=[0.01, 0.02, 0.01, 0.03], outputs=range(4), inputs=[0, 3])
    frf = s.frequency_response(np.linspace(0.3, 8, 300), quantity=quantity)
    found = fit_residues(frf, s.modes(quantity=quantity), kind="real", residuals=False, participation=participation)
    assert np.abs(found.shapes.imag).max() < 1e-9
    _, phi = s.undamped_modes()
    signs = np.sign(np.sum(found.shapes.real * phi, axis=0))
    assert relative(found.shapes.real * signs, phi) < 1e-7  # unit modal mass
    assert "unit modal mass" in found.scaling
    assert "real modes" in found.processing[-1]
    assert responses(frf, found) < FIT


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_unit_modal_mass_does_not_depend_on_the_quantity(quantity: str) -> None:
    s = FIVE["close4"]()
    frf = s.frequency_response(np.linspace(0.3, 8, 400), quantity=quantity)
    found = fit_residues(frf, s.modes(quantity=quantity), residuals=False)
    truth = s.modes(quantity=quantity).normalized("mass")
    # the sign of a shape is free
    overlap = np.sum(found.shapes.conj() * truth.shapes, axis=0) / np.linalg.norm(truth.shapes, axis=0) ** 2
    assert np.allclose(np.abs(overlap), 1, rtol=1e-6)


def test_without_a_driving_point_shapes_have_length_one() -> None:
    s = chain(np.ones(4), np.full(4, 400.0), damping_ratios=0.01, outputs=[0, 1], inputs=[3])
    frf = s.frequency_response(np.linspace(0.3, 8, 200))
    found = fit_residues(frf, s.modes())
    assert found.scaling.startswith("length 1")
    assert np.allclose(np.linalg.norm(found.shapes, axis=0), 1)


@pytest.mark.parametrize("participation", ["given", "free"])
def test_repeated_modes_have_as_many_shapes_as_there_are(participation: str) -> None:
    s = FIVE["ring5"]()
    truth = s.modes()
    frf = s.frequency_response(np.linspace(0.3, 8, 300))
    found = fit_residues(frf, truth, participation=participation)
    assert len(found) == len(truth)
    assert responses(frf, found) < FIT
    for f in np.unique(truth.frequencies.round(6)):
        here, there = (np.abs(m.frequencies - f) < 1e-5 for m in (found, truth))
        assert relative(found.residues[here].sum(axis=0), truth.residues[there].sum(axis=0)) < 1e-6


def test_one_reference_tells_one_shape_of_repeated_modes() -> None:
    s = FIVE["ring5"]()
    frf = s.frequency_response(np.linspace(0.3, 8, 300), inputs=[0])
    found = fit_residues(frf, s.modes(inputs=[0]), participation="free")
    assert len(found) == 3
    assert "2 repeated modes beyond what 1 references can tell left out" in found.processing[-1]
    assert responses(frf, found) < FIT


def test_the_exponential_windows_damping_is_taken_off_the_functions_too() -> None:
    s = FIVE["chain5"]()
    truth, added = s.modes(), 0.3
    windowed = ModalModel(poles=truth.poles - added, shapes=truth.shapes, participation=truth.participation)
    f = np.linspace(0.3, 8, 300)
    frf = FrequencyResponse(
        values=windowed.frequency_response(f).values, frequencies=f, quantity="displacement", added_damping=added
    )
    found = fit_residues(frf, truth)
    assert relative(found.residues, truth.residues) < 1e-6


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_the_shared_factor_solves_the_plain_problem(seed: int) -> None:
    """Participation given shapes through one triangular factor, against one least-squares problem over all rows, with noise."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=3, inputs=2, modes=3, sampled=False)
    f = np.linspace(0.02, 0.45, 60)
    values = ss.frequency_response(f).values
    values = values + 0.1 * np.abs(values).mean() * rng.standard_normal(values.shape)
    poles = ss.poles[ss.poles.imag > 0]
    shapes = rng.standard_normal((3, 3)) + 1j * rng.standard_normal((3, 3))
    basis = FrequencyResponse(values=values, frequencies=f).basis(poles, weights=rng.uniform(0.5, 2, 60))
    found, terms = basis.fit_participation(shapes)
    rows = basis.data.shape[0]
    for i in range(2):
        J = np.zeros((3, rows, 6 + 3))
        for o in range(3):
            for j in range(3):
                for part, unit in enumerate((1.0, 1j)):
                    r = shapes[o, j] * unit
                    J[o, :, 2 * j + part] = basis.functions[:, 2 * j] * r.real + basis.functions[:, 2 * j + 1] * r.imag
            J[o, :, 6 + o] = basis.terms[:, 0]
        plain = np.linalg.lstsq(J.reshape(-1, 9), basis.data[:, :, i].T.ravel(), rcond=None)[0]
        assert relative(found[:, i], plain[:6:2] + 1j * plain[1:6:2]) < 1e-8
        assert relative(terms[0, :, i], plain[6:]) < 1e-8
    rebuilt = basis.rebuilt(shapes, found, terms)
    assert np.linalg.norm(rebuilt - basis.data) <= np.linalg.norm(basis.data)


def test_modes_as_a_model_and_back() -> None:
    s = FIVE["over4"]()
    truth = s.modes()
    model = from_modes(truth.poles, truth.shapes, truth.participation, np.zeros((4, 2)), None)
    assert isinstance(model, StateSpace)
    f = np.linspace(0.3, 8, 50)
    assert relative(model.frequency_response(f).values, s.frequency_response(f).values) < 1e-10


@pytest.mark.parametrize(
    ("change", "options", "text"),
    [
        ({"quantity": None}, {}, r"quantity of the response is not known"),
        ({"quantity": None}, {"kind": "real"}, r"real modes.*\n?.*not known"),
        ({}, {"kind": "normal"}, r"complex, real"),
        ({}, {"participation": "none"}, r"given, free"),
    ],
)
def test_what_is_missing_is_named(change: dict[str, object], options: dict[str, str], text: str) -> None:
    s = FIVE["chain5"]()
    frf = s.frequency_response(np.linspace(0.3, 8, 100))
    if change:
        frf = FrequencyResponse(values=frf.values, frequencies=frf.frequencies)
    with pytest.raises(DataError, match=text):
        fit_residues(frf, s.modes(), **options)


def test_a_line_at_dc_has_no_lower_residual() -> None:
    s = FIVE["chain5"]()
    frf = s.frequency_response(np.linspace(0, 8, 100))
    with pytest.raises(DataError, match="line at 0 Hz, where they are infinite"):
        fit_residues(frf, s.modes())
    assert responses(frf, fit_residues(frf, s.modes(), residuals=False)) < FIT
    with pytest.raises(DataError, match="a line lies at 0 Hz"):
        s.frequency_response(np.linspace(0, 8, 100), quantity="acceleration").as_quantity("displacement")


def test_fewer_lines_than_unknowns_and_modes_without_participation() -> None:
    s = FIVE["chain5"]()
    with pytest.raises(DataError, match="residues of 5 modes and 2 residual terms need 6 lines"):
        fit_residues(s.frequency_response(np.linspace(1, 2, 5)), s.modes())
    bare = ModalModel(poles=s.modes().poles, shapes=s.modes().shapes)
    with pytest.raises(DataError, match="the modes have none, the response has 2 inputs"):
        fit_residues(s.frequency_response(np.linspace(0.3, 8, 100)), bare, participation="given")
    o = FIVE["over4"]()
    with pytest.raises(DataError, match="there are real poles"):
        fit_residues(o.frequency_response(np.linspace(0.3, 8, 100)), o.modes(), kind="real")


def test_indicators_of_shapes_are_those_of_the_fitted_shapes() -> None:
    """Modes of two outputs, their shapes fitted at all four."""
    frf = chain5().frequency_response(np.linspace(0.3, 8, 300), noise=0.02, seed=0)
    few = identify(frf.select(outputs=frf.output_dofs[:2]), order=10).modes
    found = fit_residues(frf, few)
    for name, of in OF_SHAPES.items():
        assert found.indicators[name] == pytest.approx(of(found.shapes)), name
