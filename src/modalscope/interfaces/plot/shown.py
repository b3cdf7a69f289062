"""Draw each kind of data and results by `.plot()`."""

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
from modalscope.interfaces.plot._style import BLUE, MUTED, PALE, VERMILLION, dress, frameless, new_axes
from modalscope.interfaces.plot.diagrams import indicator, stabilization
from modalscope.interfaces.plot.intervals import certificate
from modalscope.interfaces.plot.methods import method_map
from modalscope.interfaces.plot.responses import spectra
from modalscope.interfaces.plot.shapes import shape
from modalscope.interfaces.plot.tracks import against, control_chart, tracks
from modalscope.signals.preprocess import decomposition, estimate_frf

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@singledispatch
def drawn(thing: Any, ax: Axes | None = None) -> Axes:
    """Draw an object by its type.

    Results and diagrams: poles with modes. Modes: the first shape. Responses, identifications and records with inputs: the mode indicator.
    Other records: singular values of the spectra. Models: poles. Geometries: lines. Comparisons: the map. Certificates: intervals.
    Validations: fit errors. Histories and tracks: frequencies over time. Alarms: the chart. Explained tracks: against a covariate.

    `ax`: a new figure by default.

    Raises `DataError`: a type without a picture.
    """
    asked = f"a picture of {type(thing).__name__} was asked"
    raise DataError(asked, "this type has none", "Use one of the functions of modalscope.plot.")


drawn.register(Comparison, method_map)
drawn.register(Certificate, certificate)
drawn.register(Tracks, tracks)
drawn.register(Alarms, control_chart)


@drawn.register
def _(thing: Result, ax: Any = None) -> Any:
    return stabilization(thing.diagram, thing.modes, ax)


@drawn.register
def _(thing: StabilizationDiagram, ax: Any = None) -> Any:
    return stabilization(thing, None, ax)


@drawn.register
def _(thing: Identification, ax: Any = None) -> Any:
    return indicator(thing.response, thing.modes, ax)


@drawn.register
def _(thing: History, ax: Any = None) -> Any:
    return tracks(track(thing), ax)


@drawn.register
def _(thing: Explained, ax: Any = None) -> Any:
    return against(thing, ax=ax)


@drawn.register
def _(thing: ModalModel, ax: Any = None) -> Any:
    return shape(thing, ax=ax)


@drawn.register(FrequencyResponse)
@drawn.register(ImpulseResponse)
def _(thing: FrequencyResponse | ImpulseResponse, ax: Any = None) -> Any:
    return indicator(thing, ax=ax)


@drawn.register
def _(thing: Signals, ax: Any = None) -> Any:
    return spectra(decomposition(thing), ax) if thing.inputs is None else indicator(estimate_frf(thing), ax=ax)


@drawn.register(StoredSignals)
@drawn.register(StoredResponse)
def _(thing: StoredSignals | StoredResponse, ax: Any = None) -> Any:
    return drawn(thing.excerpt(), ax)


@drawn.register
def _(thing: Records, ax: Any = None) -> Any:
    return drawn(max(thing.runs, key=lambda run: run.samples), ax)


@drawn.register
def _(thing: Setups, ax: Any = None) -> Any:
    return drawn(max(thing.parts, key=lambda part: part.samples), ax)


@drawn.register
def _(thing: Validation, ax: Any = None) -> Any:
    ax, places = new_axes(ax), np.arange(len(thing.parts))
    ax.bar(places - 0.2, 100 * thing.fit_errors_with, 0.4, color=PALE, label="included")
    ax.bar(places + 0.2, 100 * thing.fit_errors, 0.4, color=BLUE, label="left out")
    ax.set_xticks(places, thing.parts, rotation=45 if len(thing.parts) > 6 else 0)
    ax.legend(frameon=False)
    dress(ax, title="cross-validation", xlabel="left out", ylabel="unexplained [%]")
    return ax


@drawn.register
def _(thing: StateSpace, ax: Any = None) -> Any:
    ax, poles = new_axes(ax), np.atleast_1d(thing.continuous_poles)
    ax.axvline(0, color=MUTED, linewidth=0.8)
    ax.scatter(poles.real, poles.imag / (2 * np.pi), s=26, color=np.where(poles.real < 0, BLUE, VERMILLION).tolist())
    dress(ax, title="poles", xlabel="real part [rad/s]", ylabel="imaginary part / 2π [Hz]")
    return ax


@drawn.register
def _(thing: Geometry, ax: Any = None) -> Any:
    ax, places = new_axes(ax), thing.coordinates @ oblique().matrix
    for line in thing.lines:
        ax.plot(*places[line].T, color=PALE, linewidth=1.2)
    ax.scatter(*places.T, s=22, color=BLUE, zorder=3)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xticks([])
    ax.set_yticks([])
    frameless(ax)
    return ax
