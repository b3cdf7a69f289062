"""Data _classes: measurements, models and results, checked when they are made, and what they convert to."""

from importlib import import_module

from modalscope.data.analysis import Analysis
from modalscope.data.geometry import Dof, Geometry, parse_dof
from modalscope.data.modes import ModalModel, Mode
from modalscope.data.notes import Candidate, Finding, Harmonic, Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.results import Result, StabilizationDiagram
from modalscope.data.sameness import Sameness, same_mode
from modalscope.data.setups import Setups
from modalscope.data.statespace import StateSpace
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.numerics.arguments import plain_methods
from modalscope.numerics.errors import DataError

__all__ = [
    "Candidate",
    "DataError",
    "Dof",
    "FrequencyResponse",
    "Geometry",
    "Harmonic",
    "ImpulseResponse",
    "ModalModel",
    "Mode",
    "Note",
    "Records",
    "Sameness",
    "Setups",
    "Signals",
    "StabilizationDiagram",
    "StateSpace",
    "StoredResponse",
    "StoredSignals",
    "as_records",
    "parse_dof",
    "same_mode",
]

import_module("modalscope.data.summaries")  # what data show of themselves

_classes = [globals()[name] for name in __all__ if isinstance(globals()[name], type) and name != "DataError"]
plain_methods(Analysis, Finding, Result, *_classes)
