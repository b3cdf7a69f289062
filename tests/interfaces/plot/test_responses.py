from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from modalscope import plot
from modalscope.data import DataError
from modalscope.data.rebuilt import rebuilt
from tests.interfaces.plot import examples


def test_magnitude_stands_above_phase_with_both_curves() -> None:
    r = examples.response()
    ax = plot.response(r, examples.modes(), 1, 1)
    upper, lower = ax.figure.axes
    assert ax is upper
    assert upper.get_yscale() == "log"
    assert lower.get_xlabel() == "frequency [Hz]"
    measured, fit = upper.get_lines()
    assert np.asarray(measured.get_ydata()) == pytest.approx(np.abs(r.values[:, 1, 1]))
    assert np.asarray(fit.get_ydata()) == pytest.approx(np.abs(r.values[:, 1, 1]))  # rebuilt from the exact modes
    assert upper.get_title(loc="left") == f"output {r.output_dofs[1]}, input {r.input_dofs[1]}"


def test_the_fit_error_of_the_channel_is_told() -> None:
    r = examples.response()
    ax = plot.response(replace(r, values=r.values * 2), examples.modes(), 0, 0)
    assert ax.get_title(loc="right") == "unexplained 50 %"  # |2h - h| / |2h|


def test_channels_are_named_by_label_or_index_and_else_the_strongest_is_taken() -> None:
    r = examples.response()
    by_label = plot.response(r, output=r.output_dofs[3], input=r.input_dofs[1])
    assert by_label.get_title(loc="left") == plot.response(r, output=3, input=1).get_title(loc="left")
    loud = np.array(r.values)
    loud[:, 2, 0] *= 1000
    assert (
        plot.response(replace(r, values=loud)).get_title(loc="left")
        == f"output {r.output_dofs[2]}, input {r.input_dofs[0]}"
    )
    with pytest.raises(DataError, match="output 'nowhere'"):
        plot.response(r, output="nowhere")


def test_the_phase_keeps_its_value_whatever_the_scale_starts_at() -> None:
    r = examples.response()
    ax = plot.response(r, None, 0, 0)
    lower = ax.figure.axes[1]
    phase = np.asarray(lower.get_lines()[0].get_ydata())
    kept = phase[np.isfinite(phase)]
    assert np.exp(1j * np.radians(kept)) == pytest.approx(np.exp(1j * np.angle(r.values[:, 0, 0])), abs=1e-12)


def test_samples_are_drawn_over_time_with_their_difference_below() -> None:
    irf = examples.modes().impulse_response(100, 20.0)
    upper, lower = plot.response(irf, examples.modes(), 0, 0).figure.axes
    assert lower.get_xlabel() == "time [s]"
    assert lower.get_ylabel() == "residual"
    assert np.asarray(upper.get_lines()[0].get_xdata()) == pytest.approx(irf.times)
    assert not np.any(np.asarray(lower.get_lines()[0].get_ydata()))  # the same sum of the same modes


@pytest.mark.slow
def test_one_pair_of_axes_or_one_alone_can_be_given() -> None:
    figure = Figure()
    upper, lower = figure.subplots(2, 1)
    assert plot.response(examples.response(), examples.modes(), ax=(upper, lower)) is upper
    assert lower.get_lines()
    alone = Figure().add_subplot()
    plot.response(examples.response(), ax=alone)
    assert alone.get_xlabel() == "frequency [Hz]"


def test_an_identification_stands_for_its_modes() -> None:
    found = SimpleNamespace(modes=examples.modes())
    assert rebuilt(examples.response(), found.modes) == pytest.approx(examples.response().values)


def test_the_window_left_in_the_data_is_put_back_into_the_modes() -> None:
    # the data were weighted by exp(-2 t): every pole measured lies 2 rad/s further left than the structure's
    modes = examples.modes()
    damped = replace(modes, poles=modes.poles - 2.0)
    data = replace(damped.frequency_response(examples.response().frequencies), added_damping=2.0)
    assert rebuilt(data, modes) == pytest.approx(data.values)


def test_modes_of_other_channels_are_an_error() -> None:
    with pytest.raises(DataError, match="the data have 2 outputs and 2 inputs, the modes 4 and 2"):
        plot.response(examples.response().select(outputs=[0, 1]), examples.modes())


def test_the_phase_of_the_modes_lies_on_the_branch_of_the_measured_one() -> None:
    r = examples.response()
    lower = plot.response(replace(r, values=-r.values), examples.modes(), 0, 0).figure.axes[1]
    measured, fit = (np.asarray(line.get_ydata()) for line in lower.get_lines())
    near = np.interp(np.asarray(lower.get_lines()[1].get_xdata()), r.frequencies, np.arange(r.frequencies.size))
    kept = np.isfinite(fit)
    phase = np.degrees(np.angle(r.values[:, 0, 0]))[near[kept].round().astype(int)]
    assert np.exp(1j * np.radians(fit[kept])) == pytest.approx(np.exp(1j * np.radians(phase)), abs=1e-9)
    assert np.nanmax(np.abs(fit)) <= np.nanmax(np.abs(measured)) + 180


def test_coherence_has_a_panel_of_its_own_where_it_is_known() -> None:
    r = examples.response()
    coherence = np.linspace(0.2, 1, r.values[..., 0].size).reshape(r.values.shape[:2])
    ax = plot.response(replace(r, coherence=coherence), None, 2, 1)
    third = ax.figure.axes[2]
    assert third.get_ylabel() == "coherence"
    assert np.asarray(third.get_lines()[0].get_ydata()) == pytest.approx(coherence[:, 2])
    assert third.get_xlabel() == "frequency [Hz]"
    assert len(plot.response(r).figure.axes) == 2
