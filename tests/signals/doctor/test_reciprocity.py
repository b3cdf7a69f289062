"""A roving hammer is identified with its drive points as outputs, by H_ij = H_ji; what is not reciprocal stays as it is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modalscope import DataError, analyze, compare, identify, replay, stabilize
from modalscope.data import FrequencyResponse, ImpulseResponse, Signals
from modalscope.data.analysis import Analysis
from modalscope.io.analysis import analysis_from, analysis_to
from modalscope.signals.doctor.reciprocity import by_reciprocity
from modalscope.signals.preprocess import merge
from modalscope.systems import chain5

CHAIN = chain5()
LINES = np.linspace(0.3, 8.0, 150)
ORDERS = range(8, 15, 2)


def roving(**changes: Any) -> FrequencyResponse:
    """Return the responses of two sensors to a hammer at all five masses."""
    data = CHAIN.frequency_response(
        LINES, outputs=[0, 3], inputs=range(5), quantity="acceleration", noise=0.005, seed=0
    )
    return replace(data, **changes)


def hits(**changes: Any) -> Any:
    """Return a hit at every mass, one run each, of two sensors."""
    runs = []
    for k in range(5):
        force = np.zeros((4000, 1))
        force[20:23] = [[0.5], [1.0], [0.5]]
        runs.append(CHAIN.simulate(inputs=force, outputs=[0, 3], at=[k], quantity="acceleration", sampling_rate=20.0))
    return merge(runs)


def test_the_exchange_is_the_transpose_and_twice_the_data_themselves() -> None:
    data = roving(coherence=np.full((150, 2, 5), 0.9), variance=np.ones((150, 2, 5)), units=("m/s2", "N"))
    turned = data.transposed()
    assert np.array_equal(turned.values, data.values.swapaxes(1, 2))
    assert (turned.output_dofs, turned.input_dofs) == (data.input_dofs, data.output_dofs)
    assert turned.units == (("m/s2",) * 5, ("N",) * 2)
    assert turned.coherence is not None
    assert turned.coherence.shape == (150, 5, 2)
    assert turned.exchanged
    assert not data.exchanged
    assert np.array_equal(turned.transposed().values, data.values)
    # the coherence of a whole output has no place any more; a direct term goes with the values
    assert roving(coherence=np.full((150, 2), 0.9)).transposed().coherence is None
    pulse = ImpulseResponse(values=np.ones((4, 1, 2)), feedthrough=[[1.0, 2.0]], sampling_rate=1.0)
    assert pulse.transposed().feedthrough.tolist() == [[1.0], [2.0]]  # type: ignore[union-attr]


def test_the_shapes_of_a_roving_hammer_are_over_its_points() -> None:
    result = analyze(roving(), orders=ORDERS, refine=False)
    assert result.data.exchanged
    assert result.modes.output_dofs == CHAIN.dofs
    assert "exchanged" in {note.kind for note in result.notes}
    true = CHAIN.modes(outputs=range(5))
    assert len(result.modes) == 5
    for shape, exact in zip(result.modes.shapes.T, true.shapes.T, strict=True):
        mac = abs(np.vdot(shape, exact)) ** 2 / (np.vdot(shape, shape).real * np.vdot(exact, exact).real)
        assert mac > 0.9999
    kept = analyze(roving(), orders=ORDERS, refine=False, reciprocal=False)
    assert kept.modes.output_dofs == ("1:+X", "4:+X")
    assert not kept.data.exchanged
    assert np.allclose(kept.modes.frequencies, result.modes.frequencies, rtol=1e-4)


@pytest.mark.parametrize("options", [{}, {"exclude": ["5:+X"], "band": (0.5, 7.0)}])
def test_reciprocity_is_asked_of_responses_as_they_were_measured(options: dict[str, Any]) -> None:
    """Levels, by which an analysis divides every channel, leave nothing reciprocal."""
    data = CHAIN.frequency_response(
        LINES, outputs=[0, 1, 3], inputs=range(5), quantity="acceleration", noise=0.005, seed=0
    )
    result = analyze(data, orders=ORDERS, refine=False, **options)
    assert result.data.exchanged
    assert "exchanged" in {note.kind for note in result.notes}
    assert result.modes.output_dofs == CHAIN.dofs[: 4 if options else 5]
    contradicted = replace(data, values=data.values * np.array([1.0, 3.0, 0.2])[:, None])
    kept = analyze(contradicted, orders=ORDERS, refine=False, **options)
    assert not kept.data.exchanged
    assert [note.kind for note in kept.notes].count("not exchanged") == 1


def test_every_verb_exchanges_alike_and_what_was_done_is_repeated() -> None:
    data = roving()
    diagram = stabilize(data, orders=[10])
    assert diagram.shapes.shape[0] == 5
    assert diagram.settings["reciprocal"] is True
    assert identify(data, order=10).modes.output_dofs == CHAIN.dofs
    assert identify(data, order=10, reciprocal=False).modes.output_dofs == ("1:+X", "4:+X")
    again = identify(data.transposed(), order=10, **diagram.settings)
    assert again.modes.output_dofs == CHAIN.dofs
    assert compare(data, ["era", "lscf"], orders=[10]).modes.output_dofs == CHAIN.dofs


def test_inputs_no_more_than_outputs_are_exchanged_only_where_asked() -> None:
    square = CHAIN.frequency_response(LINES, outputs=range(5), inputs=range(5))
    assert by_reciprocity(square, None) == (square, ())
    wide = CHAIN.frequency_response(LINES, outputs=range(4), inputs=range(5))
    assert by_reciprocity(wide, None)[0].exchanged
    tall = CHAIN.frequency_response(LINES, outputs=range(5), inputs=[0])
    assert by_reciprocity(tall, True)[0].output_dofs == ("1:+X",)


@pytest.mark.slow
def test_hits_one_at_a_time_are_exchanged_and_records_whose_inputs_act_together_are_not() -> None:
    diagram = stabilize(hits(), orders=[10])
    assert diagram.response.exchanged
    assert diagram.shapes.shape[0] == 5
    assert not stabilize(hits(), orders=[10], reciprocal=False).response.exchanged
    rng = np.random.default_rng(0)
    shakers = Signals(outputs=rng.standard_normal((2000, 1)), inputs=rng.standard_normal((2000, 2)), sampling_rate=10.0)
    assert len(stabilize(shakers, orders=[4]).response.output_dofs) == 1
    with pytest.raises(DataError, match="not responses to single forces"):
        stabilize(shakers, orders=[4], reciprocal=True)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"units": (("m/s2", "m/s2"), ("N", "N", "N", "N", "N m"))}, "inputs differ in units"),
        ({"units": (("m/s2", "m/s"), "N")}, "outputs differ in units"),
        ({"units": ("m/s2", "m/s2")}, "inputs in m/s2 are no forces"),
        ({"groups": ("a", "a", "b", "b", "b")}, "groups label the inputs"),
    ],
)
def test_what_is_not_reciprocal_is_kept_and_said(changes: dict[str, Any], words: str) -> None:
    data = roving(**changes)
    response, notes = by_reciprocity(data, None)
    assert response is data
    (note,) = notes
    assert note.kind == "not exchanged"
    assert words in note.text
    with pytest.raises(DataError, match=words):
        by_reciprocity(data, True)


def test_driving_points_that_contradict_forbid_it() -> None:
    values = np.array(roving().values)
    values[:, 0, 3] *= 3.0  # of sensor 1 under the hammer at 4; sensor 4 under the hammer at 1 says otherwise
    data = roving(values=values)
    response, (note,) = by_reciprocity(data, None)
    assert response is data
    assert "reciprocal responses differ" in note.text
    assert by_reciprocity(data, True)[0].exchanged


def test_correlations_and_free_decays_have_no_forces() -> None:
    for kind in ("correlation", "free decay"):
        data = ImpulseResponse(values=np.random.default_rng(0).standard_normal((9, 1, 3)), sampling_rate=1.0, kind=kind)
        assert by_reciprocity(data, None) == (data, ())
        with pytest.raises(DataError, match="not forces"):
            by_reciprocity(data, True)


def test_documents_hold_it_and_those_without_the_key_replay_as_they_were_made() -> None:
    entries = analysis_to(Analysis())
    assert analysis_from(entries).reciprocal is None
    del entries["reciprocal"]
    assert analysis_from(entries).reciprocal is False
    first = analyze(roving(), orders=ORDERS, refine=False, reciprocal=True)
    assert first.analysis is not None
    assert first.analysis.reciprocal is True
    assert np.array_equal(replay(first.analysis, roving()).modes.shapes, first.modes.shapes)
