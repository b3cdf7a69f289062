"""Long records: judged on some of their lines, refined on those near the modes, and the same as the whole where nothing is noise."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from tests.support import match_poles, random_system, relative


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand lines count as long."""
    monkeypatch.setattr("modalscope.data.record_spectra._MAX_JUDGED_LINES", 1000)
    monkeypatch.setattr("modalscope.data.record_spectra._MAX_REFINED_LINES", 2000)
    monkeypatch.setattr("modalscope.identification.matrices.records._MAX_ORTHOGONAL_LINES", 500)


def long_record(noise: float) -> tuple[ms.StateSpace, ms.Signals]:
    rng = np.random.default_rng(1)
    model = random_system(rng, outputs=3, inputs=2, modes=3, damping=(0.01, 0.03), direct=True)
    u = rng.standard_normal((8000, 2))
    y = model.simulate(u)
    y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return model, ms.Signals(outputs=y, inputs=u, sampling_rate=1.0)


@pytest.mark.slow
def test_without_noise_everything_is_exact(short: None) -> None:
    model, record = long_record(0)
    found = ms.identify(record, route="records", order=6)
    assert match_poles(found.poles, np.log(model.poles)).frequency_error < 1e-9
    assert relative(found.state_space.markov_parameters(50), model.markov_parameters(50)) < 1e-8
    diagram = ms.stabilize(record, route="records", orders=[4, 6])
    assert diagram.response.count == 1000
    assert diagram.response.whole.count == 3999
    assert diagram.fit_errors[-1] < 1e-8


@pytest.mark.slow
def test_the_whole_is_refined(short: None) -> None:
    model, record = long_record(0.05)
    some = ms.analyze(record).modes
    truth = np.log(model.poles)
    assert some.unrefined is not None
    # half of the lines, those nearest to the modes, hold nearly all: the deviations are those of the whole within a tenth
    whole = ms.refine(record, some)
    with pytest.MonkeyPatch.context() as more:
        more.setattr("modalscope.data.record_spectra._MAX_REFINED_LINES", 10_000)
        all_lines = ms.refine(record, some)
    assert np.all(np.abs(whole.damping_ratios_std / all_lines.damping_ratios_std - 1) < 0.1)
    assert np.all(np.abs(whole.damping_ratios - all_lines.damping_ratios) < whole.damping_ratios_std)
    assert match_poles(some.poles, truth).damping_error < 0.05
