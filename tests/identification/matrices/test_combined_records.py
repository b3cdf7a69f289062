"""Records of many outputs through combinations: the modes of all outputs, and what is left out is counted."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.indicators import mac
from tests.support import match_poles, random_system


def record(noise: float) -> ms.Signals:
    """Three modes at 150 outputs, quiet and loud, under two white forces; the state at the start is not zero."""
    rng = np.random.default_rng(5)
    model = random_system(rng, outputs=150, inputs=2, modes=3, damping=(0.005, 0.03), direct=True)
    u = rng.standard_normal((650, 2))
    y = model.simulate(u)[50:] * 10 ** rng.uniform(-2, 2, 150)
    return ms.Signals(
        outputs=y + noise * y.std(axis=0) * rng.standard_normal(y.shape), inputs=u[50:], sampling_rate=1.0
    )


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_modes_are_those_of_all_outputs(noise: float) -> None:
    data = record(noise)
    ours, theirs = (
        ms.identify(data, order=6, route="records", factorization=how, block_rows=4) for how in ("auto", "gram")
    )
    assert "150 outputs through" in " ".join(map(str, ours.notes))
    assert "combinations" not in " ".join(map(str, theirs.notes))
    match = match_poles(ours.modes.poles, theirs.modes.poles)
    if not noise:
        assert match.frequency_error < 1e-9
        assert ours.fit_error < 1e-9
        return
    index = match.index
    std = theirs.modes.frequencies_std
    assert std is not None
    # both read the same noise: the ways differ by less than it leaves open
    assert np.all(np.abs(ours.modes.frequencies[index] - theirs.modes.frequencies) < 2 * std)
    assert np.all(np.diag(mac(ours.modes.shapes[:, index], theirs.modes.shapes)) > 0.9999)
    assert ours.fit_error == pytest.approx(theirs.fit_error, rel=0.01)
    assert ours.fit_error == pytest.approx(noise, rel=0.02)
