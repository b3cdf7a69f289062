"""Times that leave the even grid once: the rows of the longest even stretch are named, counted as the file counts them."""

import numpy as np
import pytest

import modalscope as ms

GAP = np.r_[np.arange(30), 44.3 + np.arange(50)]


@pytest.mark.parametrize(("options", "rows"), [({}, "31-80"), ({"rows": "11-60"}, "31-60")])
def test_the_longest_even_stretch_is_a_way_out(tmp_path, options, rows):
    path = tmp_path / "gap.csv"
    np.savetxt(path, np.column_stack([GAP / 64, np.sin(GAP)]), delimiter=",", header="Time [s],Acc [m/s2]", comments="")
    with pytest.raises(ms.DataError, match=f"rows='{rows}', the longest even stretch"):
        ms.read(path, **options)
    found = ms.read(path, rows=rows)
    first, last = map(int, rows.split("-"))
    assert (found.samples, found.sampling_rate) == (last - first + 1, pytest.approx(64))


def test_a_clock_that_is_uneven_throughout_has_none(tmp_path):
    path, times = tmp_path / "uneven.csv", np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 80))
    noise = np.random.default_rng(1).standard_normal(80)  # motion up to half the rate: none is resampled by itself
    np.savetxt(path, np.column_stack([times, noise]), delimiter=",", header="Time [s],Acc [m/s2]", comments="")
    with pytest.raises(ms.DataError, match="evenly sampled") as refusal:
        ms.read(path)
    assert "--rows" not in refusal.value.args[0]
