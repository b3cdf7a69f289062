"""Which orders are read, on fit errors made by hand."""

from dataclasses import replace

import pytest

from modalscope.identification.orders import still_falls, sufficient_order, usable_orders
from tests.interfaces.plot.examples import diagram

ORDERS = (2, 4, 6, 10, 20, 30, 40, 60)


def with_errors(*errors):
    return replace(diagram(), orders=ORDERS, fit_errors=errors)


@pytest.mark.parametrize(
    ("errors", "order"),
    [
        ((1.0, 0.9, 0.12, 0.11, 0.10, 0.10, 0.10, 0.10), 6),  # within a fifth, the end included
        ((1.0, 0.9, 0.1201, 0.11, 0.10, 0.10, 0.10, 0.10), 10),
        ((1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.1), 60),
        ((0.1, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.2), 2),
    ],
)
def test_the_sufficient_order_is_the_first_within_a_fifth_of_the_best(errors, order):
    assert sufficient_order(with_errors(*errors)) == order


def test_orders_are_read_to_twice_the_sufficient_one_and_twenty_above_it_at_least():
    few = with_errors(1.0, 0.9, 0.11, 0.11, 0.11, 0.105, 0.10, 0.10)
    assert usable_orders(few) == ((2, 4, 6, 10, 20), 0.11)  # 26
    many = with_errors(1.0, 0.9, 0.8, 0.7, 0.6, 0.11, 0.10, 0.10)
    assert usable_orders(many) == (ORDERS, 0.10)  # 60


@pytest.mark.parametrize(
    ("errors", "falls"),
    [
        ((1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.35), True),
        ((1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.37), False),  # by less than a tenth
        ((1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.14), False),  # nearly all is explained
        ((1.0, 0.9, 0.2, 0.7, 0.6, 0.5, 0.4, 0.2), False),  # an order before fits as well
    ],
)
def test_the_fit_still_falls_when_the_last_quarter_of_the_orders_lowers_it_and_much_is_unexplained(errors, falls):
    assert still_falls(with_errors(*errors)) is falls
