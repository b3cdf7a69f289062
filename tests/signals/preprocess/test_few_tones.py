"""Forces that are a few sinusoids measure a few lines: said of a record, and of a model of more states than these determine."""

from __future__ import annotations

import numpy as np

from modalscope.analysis.workflow.realize import _too_few_tones
from modalscope.data import Signals, StateSpace
from modalscope.data.records import as_records
from modalscope.signals.doctor import examine
from modalscope.signals.preprocess.excitation import few_tones
from modalscope.systems import chain5

T = np.arange(3000) / 50.0


def driven(force: np.ndarray, outputs: int = 1) -> Signals:
    y = np.random.default_rng(1).standard_normal((T.size, outputs))
    return Signals(outputs=y, inputs=force[:, None], sampling_rate=50.0)


def tones(count: int, noise: float = 0.0) -> np.ndarray:
    force = sum(np.sin(2 * np.pi * (2.0 * k + 0.01) * T + k) for k in range(1, count + 1))
    return np.asarray(force + noise * np.random.default_rng(0).standard_normal(T.size))


def test_tones_are_counted_and_a_band_or_noise_is_none() -> None:
    for count in (1, 3, 10):
        assert np.allclose(few_tones(driven(tones(count))), [2.0 * k + 0.01 for k in range(1, count + 1)], atol=0.02)
    assert few_tones(driven(tones(11))) == ()
    # of one sinusoid noise of a deviation s has 2 s^2 of the power
    assert len(few_tones(driven(tones(1, noise=0.006)))) == 1
    assert few_tones(driven(tones(1, noise=0.008))) == ()
    band = sum(np.sin(2 * np.pi * f * T + 7 * f**2) for f in 4 + np.arange(30) / 60)
    assert few_tones(driven(np.asarray(band))) == ()


def test_a_record_says_that_it_has_few_lines_and_calls_its_drive_no_resonance() -> None:
    record = chain5().simulate(inputs="white", samples=3000, sampling_rate=50.0, seed=0)
    found = {f.kind: f for f in examine(driven(tones(1)))}
    assert "2.017 Hz alone" in str(found["few lines"])
    assert "short record" not in found
    assert not any(f.kind == "few lines" for f in examine(record))


def test_a_model_of_more_states_than_its_lines_determine_says_so() -> None:
    for outputs, count, most in ((1, 4, 4), (3, 4, 6)):  # 2 k l numbers, n (1 + l) unknowns
        records = as_records(driven(tones(count), outputs))
        for order in (most, most + 1):
            model = StateSpace(
                A=np.eye(order), B=np.ones((order, 1)), C=np.ones((outputs, order)), D=np.zeros((outputs, 1)), dt=0.02
            )
            notes = _too_few_tones(records, model)
            assert bool(notes) == (order > most)
    assert f"which determine {most} states at most, and the model has {order}" in str(notes[0])
