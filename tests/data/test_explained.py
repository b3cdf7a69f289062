"""How much is explained, in words: the number, and the warning below 70 %."""

import numpy as np
import pytest

from modalscope.data.rebuilt import explains_enough, share_explained, unexplained


@pytest.mark.parametrize(("error", "share"), [(0.0, 1.0), (0.6, 0.64), (1.0, 0.0), (3.0, 0.0), (np.nan, 0.0)])
def test_the_share_is_one_minus_the_squared_error_and_never_below_zero(error, share):
    assert share_explained(error) == pytest.approx(share)


def test_from_seventy_per_cent_on_it_is_enough():
    edge = np.sqrt(0.3)
    assert explains_enough(edge - 1e-9)
    assert not explains_enough(edge + 1e-9)
    assert unexplained(edge - 1e-9).startswith("Unexplained: 54.8 % of the response")
    assert unexplained(edge + 1e-9).startswith("WARNING: 54.8 % of the response is unexplained")
    assert not explains_enough(np.nan)
