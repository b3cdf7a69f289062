"""A record without force that is a free decay is analysed as one, and may be taken as ambient."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import DataError, analyze, replay, stabilize
from modalscope.data import ImpulseResponse, Records, Signals
from modalscope.signals.preprocess.decays import as_free_decay
from modalscope.systems import chain5

CHAIN = chain5()
RATE = 20.0


def plucked(samples: int = 1500, rate: float = RATE, seed: int = 0) -> Signals:
    decay = CHAIN.free_decay(samples, displacement=[0.2, 0.4, 1.0, -0.3, 0.1], sampling_rate=rate, outputs=range(5))
    y = decay.values[:, :, 0]
    noise = 1e-3 * np.abs(y).max() * np.random.default_rng(seed).standard_normal(y.shape)
    return Signals(outputs=y + noise, sampling_rate=rate, quantities="displacement", output_dofs=CHAIN.dofs)


def test_the_modes_of_a_decay_are_found_with_nothing_set() -> None:
    decay = plucked(800)
    assert decay.kind_of_test == "free decay"
    result = analyze(decay, refine=False)
    assert isinstance(result.data, ImpulseResponse)
    assert result.data.kind_of_test == "free decay"
    (note,) = [note for note in result.notes if note.kind == "free decay"]
    assert "from 0 s on" in note.text
    assert np.allclose(result.modes.frequencies, CHAIN.modes().frequencies, rtol=2e-3)
    assert result.analysis is not None
    assert np.array_equal(replay(result.analysis, decay).modes.poles, result.modes.poles)


def test_the_remedy_that_is_printed_takes_it_as_ambient() -> None:
    diagram = stabilize(plucked(), route="correlation", orders=[10])
    assert diagram.response.ambient
    assert analyze(plucked(), route="correlation", orders=[10], refine=False).data.kind_of_test == "free decay"
    with pytest.raises(DataError, match="route='correlation'"):
        stabilize(CHAIN.impulse_response(100), route="correlation")


def test_runs_are_columns_and_all_must_decay() -> None:
    runs = np.stack([plucked(seed=k).outputs for k in range(2)])
    both, notes = as_free_decay(Signals(outputs=runs, sampling_rate=RATE, quantities="displacement"))
    assert isinstance(both, ImpulseResponse)
    assert both.input_dofs == ("run 1", "run 2")
    assert "of 2 runs" in notes[0].text
    mixed = Signals(
        outputs=np.stack([runs[0], np.random.default_rng(0).standard_normal(runs[0].shape)]), sampling_rate=RATE
    )
    assert as_free_decay(mixed) == (mixed, ())


def test_a_force_makes_it_no_decay_and_several_records_have_one_kind() -> None:
    struck = Signals(outputs=plucked().outputs, inputs=np.eye(1500, 1), sampling_rate=RATE)
    assert as_free_decay(struck) == (struck, ())
    assert Records(runs=[plucked(), plucked(seed=1)]).kind_of_test == "free decay"
    assert CHAIN.impulse_response(50).kind_of_test is None


def test_a_force_that_never_changes_is_none_and_is_told() -> None:
    resting = Signals(
        outputs=plucked().outputs,
        inputs=np.full((1500, 1), -3.1),
        sampling_rate=RATE,
        quantities="displacement",
        output_dofs=CHAIN.dofs,
    )
    for options in ({}, {"exclude": ["u1"]}):  # what the finding of the doctor says to do
        result = analyze(resting, refine=False, orders=[10], **options)
        assert isinstance(result.data, ImpulseResponse)
        assert {note.kind: dict(note.numbers) for note in result.notes}["dead force"] == {"u1": -3.1}
    assert np.array_equal(replay(result.analysis, resting).modes.poles, result.modes.poles)


def one_mode(law: float = 0.0, stiffer: float = 0.0, noise: float = 1e-3, limit: float = np.inf) -> Signals:
    """Return 20 s of a decay at 8 Hz (.3 %), seen by a sensor x + law x^2, of a stiffness that goes with the square of its size."""
    t, rng = np.arange(6000) / 300.0, np.random.default_rng(0)
    A = np.exp(-0.003 * 2 * np.pi * 8 * t)
    x = A * np.cos(2 * np.pi * 8 * np.cumsum(1 + stiffer * A**2) / 300)
    y = np.minimum(x + law * x**2 + noise * rng.standard_normal(t.size), limit)
    return Signals(outputs=y[:, None], sampling_rate=300.0)


def listed(data: Signals) -> tuple[list[float], dict[str, str]]:
    result = analyze(data, refine=False)
    return np.round(result.modes.frequencies, 1).tolist(), {note.kind: note.text for note in result.notes}


def test_multiples_of_a_tone_are_no_modes_and_are_named() -> None:
    found, notes = listed(one_mode(law=0.2))
    assert found == [8.0]
    assert "no modes: 16 Hz, multiples of 8 Hz" in notes["multiples"]


def test_a_mode_at_twice_the_frequency_with_a_decay_of_its_own_stays() -> None:
    plain, t = one_mode(), np.arange(6000) / 300.0
    # its square decays by .3 %, too
    for damping in (0.002, 0.0035):
        second = 0.2 * np.exp(-damping * 2 * np.pi * 16 * t) * np.cos(2 * np.pi * 16 * t + 1)
        found, notes = listed(Signals(outputs=plain.outputs + second[:, None], sampling_rate=300.0))
        assert found == [8.0, 16.0]
        assert "multiples" not in notes


def test_a_frequency_that_goes_with_the_size_is_one_mode_and_its_range_is_said() -> None:
    found, notes = listed(one_mode(stiffer=0.02))
    assert found == [8.0]
    assert "depends on amplitude: 8.1" in notes["goes with size"].partition("at the start")[0]
    assert ", 8.00" in notes["goes with size"]
    assert "goes with size" not in listed(one_mode())[1]


def test_two_close_modes_are_two() -> None:
    t = np.arange(6000) / 300.0
    second = 0.7 * np.exp(-0.003 * 2 * np.pi * 8.06 * t) * np.cos(2 * np.pi * 8.06 * t)
    found, notes = listed(Signals(outputs=one_mode().outputs + second[:, None], sampling_rate=300.0))
    assert found == [8.0, 8.1]
    assert not {"multiples", "goes with size"} & set(notes)


def test_a_decay_that_was_clipped_begins_after_the_last_clipped_sample() -> None:
    found, notes = listed(one_mode(limit=0.8))
    assert found == [8.0]
    (start,) = [float(word) for word in notes["free decay"].split() if word[0].isdigit() and "." in word][:1]
    assert 1.3 < start < 1.6  # exp(-.003 2 pi 8 t) = .8 at 1.48 s
    assert "(clipped before)" in notes["free decay"]
    (note, *_) = as_free_decay(one_mode(limit=0.1))[1]
    assert "clipped" not in note.text  # half of it and more was clipped: all is taken


@pytest.mark.parametrize("seed", [309, 312])
def test_what_is_left_of_a_slow_decay_is_no_offset(seed: int) -> None:
    """Its end still vibrates: a plain mean there would leave an offset, which made errors of a white record look correlated."""
    decay = CHAIN.impulse_response(600, sampling_rate=RATE, quantity="velocity", noise=0.01, seed=seed)
    result = analyze(Signals(outputs=decay.values[1:, :, 0], sampling_rate=RATE))
    assert not {"correlated errors", "coloured residual"} & {note.kind for note in result.modes.notes}
    assert np.all(result.modes.interval()["frequency"][:, 1] >= CHAIN.modes().frequencies)
    assert np.all(result.modes.interval()["frequency"][:, 0] <= CHAIN.modes().frequencies)
