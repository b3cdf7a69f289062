"""Measured records, against what their authors and independent programs found; skipped where the data are not at hand."""

import numpy as np
import pytest

from modalscope.data import Signals
from modalscope.signals.doctor import examine
from modalscope.signals.preprocess import estimate_correlation, estimate_frf, filter_band, merge
from tests.support import measured


def load(*parts):
    with np.load(measured(*parts), allow_pickle=False) as held:
        return dict(held)


@pytest.fixture(scope="module")
def hammer():
    data = load("impact_hits", "impacts.npz")
    return Signals(
        outputs=data["acc"][:, :, None],
        inputs=data["force"][:, :, None],
        sampling_rate=float(data["fs"]),
        quantities="acceleration",
    )


@pytest.mark.slow
def test_the_overloaded_hit_is_named_and_left_out(hammer):
    """Independently: coherence .44 with it, .995 without."""
    frf = estimate_frf(hammer)
    assert "left out: 1, overloaded" in frf.processing[-1]
    assert np.median(frf.band(100, 4000).coherence) > 0.995
    assert np.median(estimate_frf(hammer, hits="all").band(100, 4000).coherence) < 0.5
    assert [(f.kind, f.reason[:5]) for f in examine(hammer)] == [("overload", "hit 1"), ("double hit", "hit 3")]


def test_hits_in_one_long_record_are_found(hammer):
    rows = [x.reshape(-1, 1) for x in (hammer.outputs, hammer.inputs)]
    long = Signals(outputs=rows[0], inputs=rows[1], sampling_rate=hammer.sampling_rate)
    apart, joined = estimate_frf(hammer).band(300, 3000), estimate_frf(long).band(300, 3000)
    assert apart.averages == joined.averages == 4
    # the same samples up to a few at the ends; medians over one run and over five differ by a little
    lines = [np.argmin(np.abs(joined.frequencies - f)) for f in apart.frequencies]
    difference = joined.values[lines] - apart.values
    assert np.linalg.norm(difference) < 0.01 * np.linalg.norm(apart.values)


def test_roving_sweeps_equal_the_authors_responses():
    raw, published = load("hati_gvt", "hati_ws3_200Hz.npz"), load("hati_gvt", "hati_ws3_frf.npz")
    runs = [
        Signals(
            outputs=acc,
            inputs=force[:, None],
            sampling_rate=float(raw["fs"]),
            output_dofs=[f"{2 * k + 1}:+Z", f"{2 * k + 2}:+Z"],
            input_dofs=["shaker"],
            quantities="acceleration",
        )
        for k, (force, acc) in enumerate(zip(raw["force"], raw["acc"], strict=True))
    ]
    lines = published["freq"]
    frf = merge(runs).band(lines[0] - 1e-6, lines[-1] + 1e-6)
    assert frf.output_dofs == tuple(f"{k}:+Z" for k in range(1, 21))
    assert np.allclose(frf.frequencies, lines)
    # both come from single-precision files
    assert np.abs(frf.values[:, :, 0] / published["H"] - 1).max() < 1e-5
    assert examine(runs[0]) == ()


@pytest.mark.slow
def test_ambient_records_are_clean_and_give_correlations():
    record = Signals(outputs=load("palisaden", "palisaden_dec5.npz")["y"], sampling_rate=20.0)
    assert examine(record) == ()
    band = filter_band(record, 0.5, 4.0)
    assert band.sampling_rate == 10.0
    found = estimate_correlation(band)
    assert found.values.shape[1:] == (6, 6)
    # decayed: the last tenth of the lags is noise of the estimate
    assert np.abs(found.values[-200:]).max() < 0.1 * np.abs(found.feedthrough).max()


@pytest.mark.slow
def test_setups_with_common_references_merge():
    y = load("building_3sl", "tsl3.npz")["y"]
    names = [[f"ch{i}" if i < 3 else f"ch{i}_{s}" for i in range(10)] for s in range(3)]
    parts = [Signals(outputs=y[s], sampling_rate=100.0, output_dofs=names[s]) for s in range(3)]
    merged = merge(parts, lags=600)
    assert merged.values.shape[1:] == (24, 3)
    assert [examine(part) for part in parts] == [(), (), ()]
    # the merged correlations of one setup's sensors stay what they were, up to the scatter of the estimates
    own = estimate_correlation(parts[0], references=names[0][:3], lags=600)
    a, b = merged.values[:200, :10], own.values[:200]
    likeness = np.sum(a * b) / np.sqrt(np.sum(a**2) * np.sum(b**2))
    assert likeness > 0.9
