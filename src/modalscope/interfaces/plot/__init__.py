"""Pictures: results drawn on Matplotlib axes. Nothing is identified here, and no global setting is changed."""

from modalscope.interfaces.plot.animation import animate
from modalscope.interfaces.plot.diagrams import fit_errors, indicator, stabilization
from modalscope.interfaces.plot.intervals import certificate, intervals
from modalscope.interfaces.plot.matrices import mac, singular_values
from modalscope.interfaces.plot.methods import deviations, method_map
from modalscope.interfaces.plot.places import places
from modalscope.interfaces.plot.responses import response, spectra
from modalscope.interfaces.plot.shapes import complexity, shape
from modalscope.interfaces.plot.tracks import against, control_chart, tracks

__all__ = [
    "against",
    "animate",
    "certificate",
    "complexity",
    "control_chart",
    "deviations",
    "fit_errors",
    "indicator",
    "intervals",
    "mac",
    "method_map",
    "places",
    "response",
    "shape",
    "singular_values",
    "spectra",
    "stabilization",
    "tracks",
]
