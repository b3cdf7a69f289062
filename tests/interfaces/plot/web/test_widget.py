"""A widget holds a result as one blob, whose head says what is in it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.rebuilt import fit_error, inside, rebuilt, unexplained
from modalscope.interfaces.plot.web.alive import alive_blob, drawing_of, front_end
from modalscope.interfaces.plot.web.fits import lines_of_response, rebuilt_lines
from modalscope.interfaces.plot.web.modes import modes_parts, over_points
from modalscope.interfaces.plot.web.poles import poles_blob, spectra_of
from modalscope.signals.preprocess.singular_spectra import decomposition
from modalscope.systems import chain5
from tests.interfaces.plot import examples
from tests.support import refused


def test_a_result_is_one_blob_with_its_modes_poles_and_channels() -> None:
    modes, diagram = examples.modes(), examples.diagram()
    blob = alive_blob(drawing_of(modes, diagram))
    head = _head(blob)
    shapes = {entry["name"]: entry["shape"] for entry in head["arrays"]}
    assert [mode["frequency"] for mode in head["modes"]] == pytest.approx(list(modes.frequencies))
    assert shapes["frequency"] == [len(diagram.poles)]
    assert shapes["measured_real"][:2] == list(diagram.response.values.shape[1:])
    assert shapes["mac"] == [len(modes)] * 2


def test_what_is_left_of_records_is_told_as_the_summary_tells_it_and_of_all_inputs_at_once() -> None:
    record = chain5().simulate(samples=1500, sampling_rate=20.0, noise=0.03, seed=2)
    diagram = ms.stabilize(record, orders=range(8, 15, 2))
    modes = ms.select(diagram)
    told = _head(alive_blob(drawing_of(modes, diagram)))
    whole, each = fit_error(diagram.response.values, rebuilt(diagram.response, modes))
    assert told["unexplained"] == [unexplained(whole)]
    np.testing.assert_allclose(told["fits"], np.broadcast_to(each, (4, 2)))


def test_singular_values_of_spectra_stand_behind_the_poles_in_the_band_that_was_asked() -> None:
    record = chain5().simulate(inputs="ambient", samples=3000, sampling_rate=20.0, seed=3)
    result = ms.analyze(record, band=(2.0, 5.0), orders=range(2, 13, 2))
    spectra = decomposition(record)
    told = _head(alive_blob(drawing_of(result.modes, result.diagram, spectra=spectra)))
    inside = np.count_nonzero((spectra.frequencies >= 2.0) & (spectra.frequencies <= 5.0))
    assert told["bands"] == [[2.0, 5.0]]
    assert told["indicators"][0]["level"] == "singular values of the spectra [(m/s²)²/Hz]"
    assert next(entry["shape"] for entry in told["arrays"] if entry["name"] == "spectra_curves") == [4, inside]


def _head(blob: bytes) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(blob[4 : 4 + int.from_bytes(blob[:4], "little")])
    return found


def test_a_widget_is_of_a_result_alone() -> None:
    refused("Give a result", ms.widget, 3)


@pytest.mark.slow
def test_a_widget_carries_the_front_end() -> None:
    pytest.importorskip("anywidget", reason="the extra `notebook` is not installed")
    if front_end("widget.js") is None:
        pytest.skip("the front end of the page is not built: make page")
    made = ms.widget((examples.modes(), examples.diagram()))
    assert made.blob == alive_blob(drawing_of(examples.modes(), examples.diagram()))
    made.chosen = 1
    assert made.chosen == 1
    exported = made._repr_mimebundle_()[0]["text/html"]  # what a notebook shows that no program answers
    assert "<svg" in exported
    assert "± 95 %" in exported


def test_a_notebook_shows_the_table_of_a_result_and_the_living_diagram() -> None:
    pytest.importorskip("anywidget")
    data = chain5().frequency_response(np.linspace(0.3, 7.5, 200), noise=0.01, seed=0)
    result = ms.analyze(data, orders=range(8, 15, 2))
    bundle = result._repr_mimebundle_()
    assert "± 95 %" in bundle["text/html"]
    assert len(bundle["text/html"]) < 20_000
    living = "application/vnd.jupyter.widget-view+json"
    assert (living in bundle) == (front_end("widget.js") is not None)
    assert set(replace(result, diagrams=())._repr_mimebundle_()) == {"text/plain", "text/html"}


def test_a_geometry_without_lines_is_joined_between_neighbours() -> None:
    modes = examples.modes()
    nodes = [label.partition(":")[0] for label in modes.output_dofs]
    points = np.column_stack([np.arange(len(nodes)), np.zeros((len(nodes), 2))])
    placed = replace(modes, geometry=ms.Geometry(nodes=nodes, coordinates=points))
    assert modes_parts(placed, {})[1]["lines"].tolist() == [[k, k + 1] for k in range(len(nodes) - 1)]


def _indicators(data: Any, *, spectra: bool = False, **options: Any) -> dict[str, Any]:
    diagram = ms.stabilize(data, orders=[8, 10], **options)
    head = _head(poles_blob([diagram], spectra_of(data) if spectra else None))
    return {each["name"]: each for each in head["indicators"]}


def test_indicators_that_stand_behind_poles_are_those_that_the_data_have() -> None:
    chain, f = chain5(), np.linspace(0.2, 8.0, 200)
    lines = chain.frequency_response(f, noise=0.01, seed=0)
    assert list(_indicators(lines)) == ["cmif", "mmif", "sum"]
    assert _indicators(lines)["mmif"]["linear"]
    # of more forces than outputs some always put the response in quadrature; without a quantity the phase at resonance is not known
    hammer = chain.frequency_response(f, outputs=["1:+X"], inputs=["1:+X", "2:+X"], noise=0.01, seed=0)
    assert list(_indicators(hammer, reciprocal=False)) == ["cmif", "sum"]
    assert list(_indicators(replace(lines, quantity=None, units=None))) == ["cmif", "sum"]
    assert list(_indicators(chain.impulse_response(300, noise=0.01, seed=0))) == ["cmif", "sum"]
    ambient = chain.simulate(inputs="ambient", samples=3000, sampling_rate=20.0, seed=0)
    assert list(_indicators(ambient, spectra=True)) == ["spectra", "cmif", "sum"]


def test_correlations_are_drawn_as_smooth_spectra() -> None:
    record = chain5().simulate(inputs="ambient", samples=6000, sampling_rate=20.0, seed=0)
    diagram = ms.stabilize(record, orders=[10])
    modes = ms.select(diagram)
    swing = {}
    for falling in (True, False):
        lines = lines_of_response(modes, diagram.response, falling=falling)
        level = np.log10(np.abs(lines.measured[lines.frequencies > 8.0, 0, 0]))
        swing[falling] = np.abs(np.diff(level)).mean()
    assert swing[True] < swing[False] / 3
    plain = lines_of_response(modes, diagram.response, falling=False)
    np.testing.assert_allclose(plain.measured, diagram.response.spectrum()[1])


def test_shapes_are_drawn_over_the_inputs_where_these_are_the_points() -> None:
    chain = chain5()
    points = chain.modes().output_dofs
    f = np.linspace(0.2, 8.0, 300)
    hammer = chain.frequency_response(f, outputs=[points[2]], inputs=list(points))
    modes = chain.modes(outputs=[points[2]], inputs=list(points))
    drawn = over_points(modes, hammer)
    assert drawn.output_dofs == tuple(points)
    expected = chain.modes(outputs=list(points)).shapes
    assert np.diag(ms.mac(drawn.shapes, expected)) == pytest.approx(1)
    entries, arrays = modes_parts(modes, {}, points=drawn)
    assert (entries["over"], entries["points"], entries["outputs"]) == ("inputs", list(points), [points[2]])
    assert arrays["shape_real"].shape == (len(modes), len(points))
    square = chain.modes(outputs=list(points), inputs=list(points))
    for other, response in ((square, chain.frequency_response(f, inputs=list(points))), (modes, None)):
        assert over_points(other, response) is other


def test_rebuilt_curves_of_two_bands_meet() -> None:
    data = chain5().frequency_response(np.linspace(0.3, 7.5, 600), noise=0.005, seed=0)
    result = ms.analyze(data, band=[(0.3, 3.4), (3.4, 7.5)], orders=range(4, 13, 4), refine=False)
    first, second = (rebuilt_lines(result.modes, diagram, 2) for diagram in result.diagrams)
    step = np.abs(20 * np.log10(np.abs(second[2][0]) / np.abs(first[2][-1])))
    measured = np.abs(20 * np.log10(np.abs(second[1][0]) / np.abs(first[1][-1])))
    assert np.median(step) < 0.5 + np.median(measured)  # dB; without the other band's modes it is several
    alone = [lines_of_response(inside(result.modes, diagram, 2), diagram.response) for diagram in result.diagrams]
    assert np.median(np.abs(20 * np.log10(np.abs(alone[1].rebuilt[0]) / np.abs(alone[0].rebuilt[-1])))) > 2
