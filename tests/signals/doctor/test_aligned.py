"""Outputs that come late after the forces are shifted back, said in a note, repeated by the settings, and left where it is refused."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.shaker import Shaker, shaker
from modalscope import DataError
from modalscope.analysis.comparing.routes import responses_by_route
from modalscope.data.records import Records
from modalscope.identification.prepare import measure
from modalscope.identification.routes import USUAL
from modalscope.interfaces.cli.reading import parse_delays
from modalscope.signals.doctor import examine
from modalscope.signals.doctor.delays import common_delays
from modalscope.signals.preprocess.ambient_records import DELAYS, aligned

LATE = {"y2": 20}


@cache
def sound(seed: int) -> Shaker:
    """A test whose channels are all in time."""
    return shaker(seed, modes=4, outputs=6, seconds=6.0)


def late(delays: dict[str, int], seed: int = 3) -> tuple[ms.Signals, np.ndarray]:
    """Four modes at six outputs, some of which come late."""
    test = sound(seed)
    y, u, N = test.signals.outputs, test.signals.inputs, len(test.signals.outputs)
    lags = [delays.get(f"y{i + 1}", 0) for i in range(6)]
    moved = np.column_stack([own[60 - lag : N - lag] for own, lag in zip(y.T, lags, strict=True)])
    return ms.Signals(outputs=moved, inputs=u[60:], sampling_rate=1024.0, quantities="acceleration"), test.frequencies


@pytest.mark.parametrize("delays", [LATE, {f"y{i + 1}": 25 for i in range(6)}])
def test_what_was_shifted_is_shifted_back(delays: dict[str, int]) -> None:
    record, longest = late(delays)[0], max(delays.values())
    assert common_delays(Records(runs=(record,))) == delays
    (moved,) = aligned(Records(runs=(record,)), delays)[0].runs
    count = record.samples - longest
    assert moved.samples == count
    assert np.array_equal(moved.inputs, record.inputs[:count])
    assert np.array_equal(moved.outputs, late({})[0].outputs[:count])


@pytest.mark.slow
@pytest.mark.parametrize("delays", [LATE, {f"y{i + 1}": 25 for i in range(6)}])
def test_modes_are_those_without_the_delay(delays: dict[str, int]) -> None:
    record, f = late(delays)
    diagram = ms.stabilize(record, orders=range(2, 31, 2))
    assert diagram.settings["delays"] == delays
    assert DELAYS in [note.kind for note in diagram.notes]
    modes = ms.select(diagram)
    assert modes.frequencies == pytest.approx(f, rel=1e-3)
    again = ms.identify(record, order=8, **ms.identify(record, order=8).settings)
    assert np.array_equal(again.poles, ms.identify(record, order=8).poles)


@pytest.mark.slow
def test_it_is_refused_by_an_empty_mapping() -> None:
    record, _ = late(LATE)
    taken = ms.identify(record, order=8, delays={})
    assert dict(taken.settings)["delays"] == {}
    assert DELAYS not in [note.kind for note in taken.notes]
    assert not np.allclose(taken.poles, ms.identify(record, order=8).poles)


def test_records_with_nothing_late_are_those_that_were_given() -> None:
    records = Records(runs=(late({})[0],))
    for none in ({}, {"y2": 0}):
        assert aligned(records, none) == (records, ())


@pytest.mark.slow
def test_a_refinement_takes_the_record_as_the_settings_say() -> None:
    record, _ = late(LATE)
    found = ms.identify(record, order=8, delays={}, band=(50.0, 400.0), exclude=["y1"])
    refined = ms.refine(record, found.modes, settings=found.settings)
    taken = measure(record, (50.0, 400.0), ["y1"], delays={}).response
    assert np.array_equal(refined.poles, ms.refine(taken, found.modes).poles)
    back = ms.refine(record, found.modes, settings={**found.settings, "delays": LATE})
    assert not np.allclose(refined.poles, back.poles, rtol=1e-9)


@pytest.mark.slow
def test_a_comparison_looks_for_delays_once(monkeypatch: pytest.MonkeyPatch) -> None:
    looked = []

    def counted(records: Records) -> dict[str, int]:
        looked.append(records)
        return common_delays(records)

    monkeypatch.setattr("modalscope.identification.routes.common_delays", counted)
    record, _ = late(LATE)
    ways, _ = responses_by_route(record, None, None)
    routes = len(USUAL) - 1  # all but the decays of hits
    assert [way.delays for way in ways] == [LATE] * routes
    assert len(looked) == 1
    assert [way.delays for way in responses_by_route(record, None, None, {})[0]] == [{}] * routes
    assert len(looked) == 1


@pytest.mark.slow
def test_delays_that_are_given_are_taken_and_others_are_refused() -> None:
    record, _ = late({"y2": 3})
    assert ms.identify(record, order=8).settings.get("delays") is None
    assert ms.identify(record, order=8, delays={"y2": 3}).settings["delays"] == {"y2": 3}
    with pytest.raises(DataError, match="the outputs are y1"):
        ms.identify(record, order=8, delays={"nobody": 3})
    with pytest.raises(DataError, match="whole number"):
        ms.identify(record, order=8, delays={"y2": -3})
    with pytest.raises(DataError, match="not records with inputs"):
        ms.identify(ms.systems.chain5().impulse_response(200), order=8, delays={"y2": 3})


def test_runs_that_do_not_say_the_same_are_left_as_they_are() -> None:
    one, other = late(LATE)[0], late({}, seed=4)[0]
    assert common_delays(Records(runs=(one, one))) == LATE
    assert common_delays(Records(runs=(one, other))) == {}


def test_periods_are_left_whole() -> None:
    rng = np.random.default_rng(0)
    u = np.tile(rng.standard_normal((1500, 1)), (4, 1))
    whole = ms.systems.chain5().simulate(inputs=u, at=[0], sampling_rate=12.0, quantity="acceleration")
    record = ms.Signals(outputs=np.roll(whole.outputs, 25, axis=0), inputs=u, sampling_rate=12.0)
    assert set(common_delays(Records(runs=(record,))).values()) == {25}
    assert ms.identify(record, order=10).settings.get("delays") is None


def test_a_channel_that_is_late_in_wind_is_shifted_by_what_is_printed() -> None:
    sound = ms.systems.chain5().simulate(inputs="ambient", samples=4000, sampling_rate=20.0, noise=0.01, seed=1)
    y = np.array(sound.outputs)
    for moved, shift in (("later", slice(None, -12)), ("earlier", slice(12, None))):
        rest = slice(12, None) if moved == "later" else slice(None, -12)
        x = np.array(y[rest])
        x[:, 1] = y[shift, 1]
        record = ms.Signals(outputs=x, sampling_rate=20.0, output_dofs=["a", "b", "c", "d"], quantities="acceleration")
        (found,) = [each for each in examine(record) if each.kind == "delay"]
        assert f"12 samples, {moved}" in found.reason
        delays = parse_delays(found.change.partition("--delays ")[2].partition(",")[0].split())
        assert delays == ({"b": 12} if moved == "later" else {"a": 12, "c": 12, "d": 12})
        seen = ms.identify(record, order=8, delays=delays)
        assert seen.settings["delays"] == delays
        assert [note.kind for note in seen.notes].count(DELAYS) == 1
        assert not [
            each for each in examine(aligned(Records(runs=(record,)), delays)[0].runs[0]) if each.kind == "delay"
        ]
