"""Counts and lists that no machine can hold, or that are no numbers, are answered at once in words."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.indicators import mpc, mpd
from modalscope.identification.matrices.sides import _MAX_BLOCKS, block_shifts
from modalscope.identification.method import MAX_ORDERS, checked_orders
from modalscope.numerics.checks import check_count, check_each
from tests.support import refused

CHAIN = ms.systems.chain5()


@pytest.mark.parametrize("value", [np.timedelta64(4), Fraction(4), 4.0, True, 0, 2**62, "4"])
def test_what_is_no_count_is_named(value: object) -> None:
    error = refused("a whole number of at least 1", check_count, "n", value)
    assert ("Raise it to 1" in error.change) == (value == 0 and value is not False)


def test_longest_lists_are_taken_and_longer_ones_named_without_being_made() -> None:
    assert len(checked_orders(range(1, MAX_ORDERS + 1))) == MAX_ORDERS
    refused("at most 10000, but there are 10001", checked_orders, range(1, MAX_ORDERS + 2))
    refused("orders needs whole numbers, at most", ms.stabilize, CHAIN.impulse_response(50), orders=range(2, 10**12))
    refused("labels, at most", check_each, "labels", range(10**12), "labels")
    assert len(block_shifts("row_shifts", None, _MAX_BLOCKS, "block_rows")) == _MAX_BLOCKS
    refused("no data have more than", block_shifts, "row_shifts", None, _MAX_BLOCKS + 1, "block_rows")


def test_one_shape_is_a_column() -> None:
    shape = np.array([1, 2j, 3])
    for indicator in (mpc, mpd):
        np.testing.assert_array_equal(indicator(shape), indicator(shape[:, None]))
        refused("channels", indicator, np.zeros((2, 2, 2)))
