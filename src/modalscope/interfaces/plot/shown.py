"""Describe the picture of each kind of data and results: what `.plot()` draws, and what a notebook shows at a glance."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.analysis.checking.certificate import Certificate
from modalscope.analysis.checking.validation import Validation
from modalscope.analysis.comparing import Comparison
from modalscope.analysis.monitoring.change import Alarms
from modalscope.analysis.monitoring.history import History
from modalscope.analysis.monitoring.tracking import track
from modalscope.analysis.monitoring.tracks import Explained, Tracks
from modalscope.data import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Records,
    Setups,
    Signals,
    StabilizationDiagram,
    StateSpace,
)
from modalscope.data.results import Result
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.identification.identify import Identification
from modalscope.interfaces.plot._camera import oblique
from modalscope.interfaces.plot.diagrams import indicator_picture, stabilization_picture
from modalscope.interfaces.plot.intervals import certificate_picture
from modalscope.interfaces.plot.methods import map_picture
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import (
    Axis,
    Line,
    Marks,
    Panel,
    Picture,
    axis_of,
    axis_of_names,
    bars,
    plain,
    strokes,
)
from modalscope.interfaces.plot.responses import spectra_picture
from modalscope.interfaces.plot.shapes import shape_picture
from modalscope.interfaces.plot.tracks import against_picture, chart_picture, tracks_picture
from modalscope.interfaces.plot.web.svg import alone, svg
from modalscope.signals.preprocess import decomposition, estimate_frf

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Pixels of what a notebook shows at a glance.
_GLANCE = (640, 240)


def drawn(thing: Any, ax: Axes | None = None) -> Axes:
    """Draw an object by its type; `ax`: a new figure by default.

    Raises `DataError`: a type without a picture.
    """
    return painted(picture_of(thing), ax)


@singledispatch
def picture_of(thing: Any) -> Picture:
    """Return the picture of an object by its type.

    Results and diagrams: poles with modes. Modes: the first shape. Responses, identifications and records with inputs: the mode indicator.
    Other records: singular values of the spectra. Models: poles. Geometries: lines. Comparisons: the map. Certificates: intervals.
    Validations: fit errors. Histories and tracks: frequencies over time. Alarms: the chart. Explained tracks: against a covariate.

    Raises `DataError`: a type without a picture.
    """
    asked = f"a picture of {type(thing).__name__}:"
    raise DataError(asked, "this type has none", "Use one of the functions of modalscope.plot.")


@singledispatch
def glance_of(thing: Any) -> Picture | None:
    """Return the small picture of an object that a notebook shows, which costs little to compute; None where it has none."""
    return None


def glance(thing: Any) -> str:
    """Return the small picture of an object as SVG; empty text where it has none."""
    picture = glance_of(thing)
    return "" if picture is None else alone(svg(picture, *_GLANCE))


picture_of.register(Comparison, map_picture)
picture_of.register(Certificate, certificate_picture)
picture_of.register(Tracks, tracks_picture)
picture_of.register(Alarms, chart_picture)


@picture_of.register
def _(thing: Result) -> Picture:
    return stabilization_picture(thing.diagrams or (thing.diagram,), thing.modes)


@picture_of.register
def _(thing: StabilizationDiagram) -> Picture:
    return stabilization_picture([thing])


@picture_of.register
def _(thing: Identification) -> Picture:
    return indicator_picture(thing.response, thing.modes)


@picture_of.register
def _(thing: History) -> Picture:
    return tracks_picture(track(thing))


@picture_of.register
def _(thing: Explained) -> Picture:
    return against_picture(thing, thing.regressors[1])


@picture_of.register
def _(thing: ModalModel) -> Picture:
    return shape_picture(thing, 0)


@picture_of.register
def _(thing: FrequencyResponse | ImpulseResponse) -> Picture:
    return indicator_picture(thing)


@picture_of.register
def _(thing: Signals | Records | Setups) -> Picture:
    run = max(thing.recordings, key=lambda run: run.samples)
    return spectra_picture(decomposition(run)) if run.inputs is None else indicator_picture(estimate_frf(run))


@picture_of.register
def _(thing: StoredSignals | StoredResponse) -> Picture:
    return picture_of(thing.excerpt())


@picture_of.register
def _(thing: Validation) -> Picture:
    places = np.arange(len(thing.parts))
    sides = [100 * thing.fit_errors_with, 100 * thing.fit_errors]
    items = bars(places - 0.2, sides[0], 0.4, "pale", "included")
    items += bars(places + 0.2, sides[1], 0.4, "blue", "left out")
    upward = axis_of("unexplained [%]", sides, zero=True)
    panel = Panel(axis_of_names("left out", list(map(str, thing.parts))), upward, items, "cross-validation")
    return Picture([panel], "Unexplained part of what was left out")


@picture_of.register
def _(thing: StateSpace) -> Picture:
    poles = np.atleast_1d(thing.continuous_poles)
    real, hertz = poles.real, poles.imag / (2 * np.pi)
    marks = [Marks(real[side], hertz[side], ink) for side, ink in ((real < 0, "blue"), (real >= 0, "vermillion"))]
    across, upward = axis_of("real part [rad/s]", [real, [0.0]]), axis_of("imaginary part / 2π [Hz]", [hertz])
    middle = Line(np.zeros(2), np.array([upward.low, upward.high]), "muted")
    return Picture([Panel(across, upward, [middle, *marks], "poles")], "Poles of the model")


@picture_of.register
def _(thing: Geometry) -> Picture:
    places = thing.coordinates @ oblique().matrix
    x, y = places.T
    across, upward, lines = axis_of("", [x]), axis_of("", [y]), strokes(places[thing.lines], width=1.0)
    return Picture([Panel(across, upward, [lines, Marks(x, y)], equal=True, bare=True)], "Geometry")


@glance_of.register
def _(thing: FrequencyResponse) -> Picture:
    return indicator_picture(thing, kind="sum")


@glance_of.register
def _(thing: ImpulseResponse) -> Picture | None:
    values = thing.values.reshape(len(thing.values), -1)
    labels = [f"{output} / {column}" for output in thing.output_dofs for column in thing.input_dofs]
    return _over_time(thing.times, values, labels)


@glance_of.register
def _(thing: Signals) -> Picture | None:
    outputs = thing.by_run()[0][0]
    return _over_time(np.arange(len(outputs)) / thing.sampling_rate, outputs, list(thing.output_dofs))


@glance_of.register
def _(thing: StabilizationDiagram) -> Picture:
    return stabilization_picture([thing], indicator="none")


@glance_of.register
def _(thing: Result) -> Picture | None:
    return stabilization_picture(thing.diagrams, thing.modes, indicator="sum") if thing.diagrams else None


def _over_time(times: Any, values: Any, labels: list[str]) -> Picture | None:
    """Return the channel of the largest mean square over time; None where nothing is finite."""
    strongest = int(np.argmax(np.nansum(np.abs(values) ** 2, axis=0)))
    y = values[:, strongest]
    if len(y) < 2 or not np.isfinite(y).any():
        return None
    ends = Axis("time [s]", float(times[0]), float(times[-1]))
    panel = Panel(ends, axis_of(plain(labels[strongest], 16), [y]), [Line(times, y, "blue")])
    return Picture([panel], "Strongest channel over time")
