"""modalscope: from measured responses of a structure to its modes.

Every identification method is a row of one table: a block data matrix is factored, a realization (A, B, C, D) is read off,
the modal parameters follow. `methods()` lists the table; `identify` runs one cell at one order, `stabilize` at all orders,
and `select` reports the modes with the reasons for each.
"""

from modalscope import plot, systems
from modalscope.compare import Comparison, compare
from modalscope.identify import Identification, identify, realize
from modalscope.indicators import cmif, mac
from modalscope.io import read, write
from modalscope.methods import methods
from modalscope.model import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Signals,
    StabilizationDiagram,
    StateSpace,
)
from modalscope.report import report
from modalscope.select import select
from modalscope.stabilize import stabilize

__version__ = "0.1.0"

__all__ = [
    "Comparison",
    "DataError",
    "FrequencyResponse",
    "Geometry",
    "Identification",
    "ImpulseResponse",
    "ModalModel",
    "Signals",
    "StabilizationDiagram",
    "StateSpace",
    "cmif",
    "compare",
    "identify",
    "mac",
    "methods",
    "plot",
    "read",
    "realize",
    "report",
    "select",
    "stabilize",
    "systems",
    "write",
]
