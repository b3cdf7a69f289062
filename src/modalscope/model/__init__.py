"""Data classes: measurements, models and results, checked when they are made, and what they convert to."""

from importlib import import_module

from modalscope.model.analysis import Analysis
from modalscope.model.candidates import Candidate, Harmonic
from modalscope.model.checks import DataError
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.entries import plain_methods
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.geometry import Geometry
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.labels import Dof, parse_dof
from modalscope.model.mode import Mode
from modalscope.model.modes import ModalModel
from modalscope.model.notes import Note
from modalscope.model.records import Records, as_records
from modalscope.model.result import Result
from modalscope.model.setups import Setups
from modalscope.model.signals import Signals
from modalscope.model.statespace import StateSpace
from modalscope.model.stored import StoredSignals
from modalscope.model.stored_response import StoredResponse

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
    "Setups",
    "Signals",
    "StabilizationDiagram",
    "StateSpace",
    "StoredResponse",
    "StoredSignals",
    "as_records",
    "parse_dof",
]

import_module("modalscope.model.summaries")  # what data show of themselves

plain_methods(
    Analysis,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Note,
    Records,
    Result,
    Setups,
    Signals,
    StabilizationDiagram,
    StateSpace,
    StoredResponse,
    StoredSignals,
)
