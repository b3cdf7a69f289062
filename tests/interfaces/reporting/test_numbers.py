"""Numbers as a reader wants them, and what the report says first of all."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import ImpulseResponse
from modalscope.data.modes import ModalModel
from modalscope.data.shown import frequency, list_some, percent
from modalscope.interfaces.reporting.html import heading, value
from modalscope.interfaces.reporting.modes import summary_section
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.description import decimals
from tests.selection.judging.made import Pole, diagram_of


@pytest.mark.parametrize(("lowest", "count"), [(0.02, 6), (1.0, 5), (9.99, 5), (10.0, 4), (123.0, 3), (1e4, 2)])
def test_the_lowest_frequency_has_six_digits_where_no_interval_is_known(lowest: float, count: int) -> None:
    assert decimals(np.array([1e5, lowest, 0.0]), 6) == count


@pytest.mark.parametrize(("smallest", "count"), [(0.99, 2), (0.11, 2), (0.09, 3), (0.0099, 4), (1e-9, 5)])
def test_the_smallest_interval_has_two_digits(smallest: float, count: int) -> None:
    assert decimals(np.array([1.5, 20.0]), 6, [smallest, 1.0, np.nan]) == count


def test_ratios_are_told_in_per_cent_and_everything_else_as_it_is() -> None:
    assert percent(0.01234) == "1.23 %"
    assert percent(np.nan) == "–"
    assert frequency(1.234567) == "1.2346 Hz"
    assert [heading(k) for k in ("frequency_spread_hz", "damping_ratio", "fit_loss", "first_order")] == [
        "frequency spread [Hz]",
        "damping ratio [%]",
        "fit loss [%]",
        "first order",
    ]
    assert [value(k, 0.01234567) for k in ("frequency_hz", "damping_ratio", "fit_error", "persistence")] == [
        "0.01235",
        "1.235",
        "1.235",
        "0.01235",
    ]
    assert [value("x", v) for v in (None, True, 3, np.inf, (1, 2), "a")] == ["–", "yes", "3", "–", "1, 2", "a"]


def test_many_names_are_cut_short() -> None:
    assert list_some("abc", 3) == "a, b, c"
    assert list_some("abcd", 3) == "a, b, c and 1 more"


MODES = ModalModel(
    poles=poles_from([10, 20, 30], [0.01, 0.1, 0.02]), shapes=np.eye(3), damping_ratios_spread=[0.001, 0.005, 0.004]
)


def summary(fit: float) -> str:
    response = ImpulseResponse(values=np.ones((10, 3, 1)), sampling_rate=100.0)
    return summary_section(MODES, [diagram_of(Pole(2), response=response)], (fit, np.zeros((3, 1)))).body


def test_the_least_sure_mode_is_the_one_whose_damping_scatters_most_of_its_own_value() -> None:
    assert "Least certain: mode 3 at 30 Hz, whose damping scatters by 20 % over the orders." in summary(0.5)


def test_the_misfit_is_one_number_and_a_large_one_is_a_warning() -> None:
    # 0.5 of the norm is 0.25 of the mean square, 0.6 is 0.36: the limit is 0.3
    assert "Unexplained: 50 % of the response." in summary(0.5)
    assert "WARNING: 60 % of the response is unexplained" in summary(0.6)
