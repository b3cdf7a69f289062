from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from hypothesis import given, strategies as st
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modalscope import plot
from modalscope.data import DataError, ImpulseResponse, Signals
from modalscope.interfaces.plot.picture import decimals, dodge
from modalscope.interfaces.plot.web.poles import indicator_curves
from modalscope.signals.preprocess import decomposition
from tests.interfaces.plot import examples


def counts(ax: Axes) -> dict[str, int]:
    """Return what the legend promises and what is drawn, by name."""
    drawn = {}
    for line in ax.get_lines():
        name, _, number = str(line.get_label()).rpartition(" (")
        if name and not name.startswith("_"):
            assert len(np.asarray(line.get_xdata())) == int(number.rstrip(")"))
            drawn[name] = int(number.rstrip(")"))
    return drawn


@pytest.mark.slow
def test_importing_plot_leaves_matplotlib_alone() -> None:
    code = "import sys, modalscope.interfaces.plot; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_oscillating_pole_is_drawn_once_and_real_ones_not() -> None:
    d = examples.diagram()
    drawn = counts(plot.stabilization(d))
    stable = int(np.count_nonzero(d.stable))
    steady = int(np.count_nonzero(d.stable_frequency)) - stable
    # the first pole of each of the five modes is new too
    new = 5 + examples.NEW + examples.UNSTABLE
    assert {name: count for name, count in drawn.items() if count} == {
        "stable": stable,
        "frequency": steady,
        "new": new,
    }
    assert sum(drawn.values()) == d.poles.size - examples.REAL


def test_frequency_runs_right_and_order_up_within_the_band() -> None:
    d = examples.diagram()
    ax = plot.stabilization(d)
    assert ax.get_xlabel() == "frequency [Hz]"
    assert "order" in ax.get_ylabel()
    assert ax.get_xlim() == (d.response.frequencies[0], d.response.frequencies[-1])
    low, high = ax.get_ylim()
    assert low == 0
    assert high >= max(d.orders)


def test_selected_modes_are_named_at_their_frequency() -> None:
    ax = plot.stabilization(examples.diagram(), examples.modes())
    words = [text.get_text() for text in ax.texts]
    f = examples.modes().frequencies
    assert [float(word.split()[1]) for word in words] == pytest.approx(f, rel=1e-3)  # five digits are written
    assert [word.split()[0] for word in words] == ["1", "2", "3", "4", "5"]


@pytest.mark.parametrize(("kind", "curves"), [("cmif", 2), ("sum", 1), ("none", 0)])
def test_the_mode_indicator_stands_behind_on_an_axis_of_its_own(kind: str, curves: int) -> None:
    ax = plot.stabilization(examples.diagram(), indicator=kind)
    behind = [other for other in ax.figure.axes if other is not ax]
    assert [len(other.get_lines()) for other in behind] == ([curves] if curves else [])
    for other in behind:
        assert other.get_yscale() == "log"
        assert other.get_zorder() < ax.get_zorder()


def test_an_unknown_indicator_names_those_there_are() -> None:
    with pytest.raises(DataError, match="cmif, sum, none"):
        plot.stabilization(examples.diagram(), indicator="mif")


def test_the_sum_indicator_is_the_sum_of_magnitudes() -> None:
    r = examples.response()
    lines, curves = indicator_curves(r, "sum")
    assert np.array_equal(lines, r.frequencies)
    assert curves[:, 0] == pytest.approx(np.abs(r.values).sum(axis=(1, 2)))


def test_samples_are_transformed_for_the_indicator_and_peak_at_the_modes() -> None:
    irf = examples.modes().impulse_response(2048, 20.0)
    assert isinstance(irf, ImpulseResponse)
    lines, curves = indicator_curves(irf)
    for f in examples.modes().frequencies:
        near = np.abs(lines - f) < 0.15
        peak = lines[near][np.argmax(curves[near, 0])]
        # two lines of the transform: the peak of a damped mode lies between lines and is pulled by its neighbours
        assert abs(peak - f) < 2 * 20 / 2048


def test_curves_of_the_indicator_carry_their_unit() -> None:
    ax = plot.indicator(replace(examples.response(), units=("m/s^2", "N")))
    assert len(ax.get_lines()) == 2  # as many as inputs
    assert ax.get_ylabel() == "singular values [(m/s²)/N]"
    mixed = replace(examples.response(), units=(["m", "m", "m", "rad"], "N"))
    assert plot.indicator(mixed).get_ylabel() == "singular values"


def test_fit_errors_are_drawn_over_orders() -> None:
    d = examples.diagram()
    (line,) = plot.fit_errors(d).get_lines()
    assert np.asarray(line.get_xdata()).tolist() == list(d.orders)
    assert np.asarray(line.get_ydata()) == pytest.approx(100 * d.fit_errors)


def test_pictures_go_on_the_axes_given_and_change_no_setting() -> None:
    before = dict(matplotlib.rcParams)
    ax = Figure().add_subplot()
    assert plot.stabilization(examples.diagram(), examples.modes(), ax) is ax
    assert dict(matplotlib.rcParams) == before
    assert not pyplot.get_fignums()


@given(st.lists(st.floats(0, 1), min_size=1, max_size=20), st.floats(0.001, 0.05))
def test_labels_keep_their_distance_and_their_order(places: list[float], gap: float) -> None:
    x = dodge(np.sort(places), gap)
    assert np.all(np.diff(x) >= gap - 1e-12)  # rounding of the shift that is subtracted and added
    assert x[0] >= 0
    assert x[-1] <= max(1.0, gap * (len(places) - 1)) + 1e-12


@given(st.floats(1e-3, 1e6))
def test_the_highest_frequency_shows_at_most_five_digits(f: float) -> None:
    assert 0 <= decimals(np.array([f])) <= 4


def test_letters_say_what_agrees_with_the_order_before() -> None:
    d = examples.diagram()
    p = d.poles.size
    frequency, damping, shape = np.arange(p) % 8 < 4, np.arange(p) % 4 < 2, np.arange(p) % 2 < 1
    mixed = replace(d, stable_frequency=frequency, stable_damping=damping, stable_shape=shape)
    shown = np.isin(d.kinds, ("mode", "unstable"))
    drawn = counts(plot.stabilization(mixed))
    assert drawn["stable"] == np.count_nonzero(shown & frequency & damping & shape)
    assert drawn["frequency, shape"] == np.count_nonzero(shown & frequency & ~damping & shape)
    assert drawn["frequency, damping"] == np.count_nonzero(shown & frequency & damping & ~shape)
    assert drawn["frequency"] == np.count_nonzero(shown & frequency & ~damping & ~shape)
    assert sum(drawn.values()) == np.count_nonzero(shown)


def test_the_spectra_of_a_record_stand_behind_a_diagram_where_they_are_given() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((4000, 3)), sampling_rate=16.0)
    spectra = decomposition(record)
    ax = plot.stabilization(examples.diagram(), spectra=spectra)
    (behind,) = (other for other in ax.figure.axes if other is not ax)
    assert behind.get_ylabel() == "singular values of the spectra"
    first = behind.get_lines()[0]
    inside = np.isin(spectra.frequencies, np.asarray(first.get_xdata()))
    assert np.asarray(first.get_ydata()) == pytest.approx(spectra.singular_values[inside, 0])


def test_correlations_are_transformed_on_a_fine_grid_and_peak_at_the_modes() -> None:
    modes = examples.modes()
    short = replace(modes.impulse_response(400, 20.0), kind="correlation")
    lines, curves = indicator_curves(short)
    assert lines[1] <= 20.0 / 8192
    for f in modes.frequencies[:2]:
        near = np.abs(lines - f) < 0.2
        assert abs(lines[near][np.argmax(curves[near, 0])] - f) < 20 / 400  # a line of the samples themselves


def test_modes_within_limits_keep_their_numbers() -> None:
    f = examples.modes().frequencies
    ax = plot.stabilization(examples.diagram(), examples.modes(), limits=(float(f[1]) - 0.1, float(f[3]) + 0.1))
    assert [text.get_text().split()[0] for text in ax.texts] == ["2", "3", "4"]
