"""Files and ranges as users write them."""

from __future__ import annotations

from modalscope.cli.reading import parse_orders


def test_both_ends_of_a_range_of_orders_belong_to_it():
    assert list(parse_orders("2:60:2")) == list(range(2, 61, 2))
    assert list(parse_orders("4:6")) == [4, 5, 6]
