"""Pictures: results drawn on Matplotlib axes. Nothing is identified here, and no global setting is changed."""

from modalscope.plot.animation import animate
from modalscope.plot.diagrams import fit_errors, indicator, stabilization
from modalscope.plot.intervals import certificate, intervals
from modalscope.plot.matrices import mac, singular_values
from modalscope.plot.methods import deviations, method_distances, method_map
from modalscope.plot.responses import response, spectra
from modalscope.plot.shapes import complexity, shape
from modalscope.plot.tracks import against, control_chart, tracks

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
    "method_distances",
    "method_map",
    "response",
    "shape",
    "singular_values",
    "spectra",
    "stabilization",
    "tracks",
]
