"""modalscope: from measured responses of a structure to its modes.

Every identification method is a row of one table: a block data matrix is factored, a realization (A, B, C, D) is read off,
the modal parameters follow. `methods()` lists the table; `identify` runs one cell at one order, `stabilize` at all orders,
and `select` reports the modes with the reasons for each. "The report", and equation numbers without another source, are those
of J.-N. Juang, Mathematical Correlation of Modal Parameter Identification Methods via System Realization Theory, NASA TM 87720 (1986).
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any
from warnings import warn

from modalscope.identification import FASTER, FURTHER
from modalscope.numerics.handed import hand_down

if TYPE_CHECKING:  # what readers and type checkers see; each is loaded from the same place when it is first asked for
    from modalscope import datasets as datasets, systems as systems
    from modalscope.analysis import monitoring as monitoring
    from modalscope.analysis.checking.certificate import Certificate as Certificate
    from modalscope.analysis.checking.certify import certify as certify
    from modalscope.analysis.checking.dwell import Dwell as Dwell, tuned_dwell as tuned_dwell
    from modalscope.analysis.checking.validation import Validation as Validation, validate as validate
    from modalscope.analysis.comparing import Comparison as Comparison, compare as compare
    from modalscope.analysis.planning.next_measurement import (
        NextMeasurement as NextMeasurement,
        next_measurement as next_measurement,
    )
    from modalscope.analysis.planning.placement import Placement as Placement, place as place
    from modalscope.analysis.workflow.analyze import analyze as analyze
    from modalscope.analysis.workflow.full_field import FullField as FullField, full_field as full_field
    from modalscope.analysis.workflow.mass_change import scale_by_mass as scale_by_mass
    from modalscope.analysis.workflow.pairing import comac as comac, pair_modes as pair_modes
    from modalscope.analysis.workflow.realize import realize as realize
    from modalscope.analysis.workflow.replay import replay as replay
    from modalscope.analysis.workflow.setups import merge_modes as merge_modes
    from modalscope.analysis.workflow.shapes import fit_residues as fit_residues
    from modalscope.data import (
        DataError as DataError,
        FrequencyResponse as FrequencyResponse,
        Geometry as Geometry,
        ImpulseResponse as ImpulseResponse,
        ModalModel as ModalModel,
        Note as Note,
        Records as Records,
        Sameness as Sameness,
        Setups as Setups,
        Signals as Signals,
        StabilizationDiagram as StabilizationDiagram,
        StateSpace as StateSpace,
        StoredResponse as StoredResponse,
        StoredSignals as StoredSignals,
        indicators as indicators,
        same_mode as same_mode,
    )
    from modalscope.data.analysis import Analysis as Analysis
    from modalscope.data.indicators import mac as mac, mac_std as mac_std
    from modalscope.data.results import Result as Result
    from modalscope.data.sensors import (
        EquationsOfMotion as EquationsOfMotion,
        equations_of_motion as equations_of_motion,
        first_order_form as first_order_form,
    )
    from modalscope.identification.diagrams import stabilize as stabilize
    from modalscope.identification.identify import Identification as Identification, identify as identify
    from modalscope.identification.method_names import methods as methods
    from modalscope.identification.pipeline import factor as factor
    from modalscope.identification.prepare import prepare as prepare
    from modalscope.identification.sweep import sweep as sweep
    from modalscope.interfaces import plot as plot
    from modalscope.interfaces.plot.web.alive import widget as widget
    from modalscope.interfaces.reporting import report as report
    from modalscope.io import from_frame as from_frame, read as read, write as write
    from modalscope.numerics.executors import working as working
    from modalscope.selection import likelihood as likelihood
    from modalscope.selection.judging.bands import merge_bands as merge_bands
    from modalscope.selection.judging.refine import refine as refine
    from modalscope.selection.judging.select import select as select
    from modalscope.signals import preprocess as preprocess
    from modalscope.signals.preprocess import (
        estimate_correlation as estimate_correlation,
        estimate_frf as estimate_frf,
        estimate_markov as estimate_markov,
        merge as merge,
    )
    from modalscope.signals.preprocess.ods import ods as ods

__version__ = "0.2.0"

#: Where each name of the face lives.
_HOMES = {
    "analysis.comparing": ("Comparison", "compare"),
    "analysis.checking.dwell": ("Dwell", "tuned_dwell"),
    "identification.identify": ("Identification", "identify"),
    "identification.pipeline": ("factor",),
    "identification.prepare": ("prepare",),
    "selection.judging.refine": ("refine",),
    "identification.sweep": ("sweep",),
    "identification.method_names": ("methods",),
    "io": ("from_frame", "read", "write"),
    "selection.judging.bands": ("merge_bands",),
    "analysis.checking.certificate": ("Certificate",),
    "selection.judging.select": ("select",),
    "identification.diagrams": ("stabilize",),
    "analysis.checking.validation": ("Validation", "validate"),
    "data.indicators": ("mac", "mac_std"),
    "analysis.planning.next_measurement": ("NextMeasurement", "next_measurement"),
    "analysis.planning.placement": ("Placement", "place"),
    "analysis.workflow.mass_change": ("scale_by_mass",),
    "analysis.workflow.pairing": ("comac", "pair_modes"),
    "analysis.workflow.setups": ("merge_modes",),
    "analysis.workflow.shapes": ("fit_residues",),
    "data": (
        "DataError",
        "FrequencyResponse",
        "Geometry",
        "ImpulseResponse",
        "ModalModel",
        "Note",
        "Records",
        "Sameness",
        "Setups",
        "Signals",
        "StabilizationDiagram",
        "StateSpace",
        "StoredResponse",
        "StoredSignals",
        "same_mode",
    ),
    "numerics.executors": ("working",),
    "data.analysis": ("Analysis",),
    "data.results": ("Result",),
    "interfaces.plot.web.alive": ("widget",),
    "signals.preprocess": ("estimate_correlation", "estimate_frf", "estimate_markov", "merge"),
    "signals.preprocess.ods": ("ods",),
    "data.sensors": ("EquationsOfMotion", "equations_of_motion", "first_order_form"),
    "interfaces.reporting": ("report",),
    "analysis.workflow.analyze": ("analyze",),
    "analysis.checking.certify": ("certify",),
    "analysis.workflow.full_field": ("FullField", "full_field"),
    "analysis.workflow.realize": ("realize",),
    "analysis.workflow.replay": ("replay",),
}

#: What data classes, preprocessing and sweeps ask of packages above them: see `modalscope.numerics.handed`.
hand_down(**FASTER, **FURTHER)
hand_down(
    columns_of="modalscope.selection.judging.description:columns_of",
    drawn="modalscope.interfaces.plot.shown:drawn",
    from_frame="modalscope.io:from_frame",
    write="modalscope.io:write",
    glance="modalscope.interfaces.plot.shown:glance",
    examine="modalscope.signals.doctor:examine",
    grades="modalscope.selection.judging.grades:grades",
    living="modalscope.interfaces.plot.web.alive:living",
    report="modalscope.interfaces.reporting:report",
    table_of="modalscope.selection.judging.description:table_of",
    options_type_of="modalscope.identification.method_names:options_type_of",
    text_of="modalscope.selection.judging.description:text_of",
    verdict_of_result="modalscope.interfaces.plot.web.verdict:verdict_of_result",
)

#: Packages by the names that documents give them, until 1.0; so do their modules.
_NAMESPACES = {
    "datasets": "datasets",
    "doctor": "signals.doctor",
    "indicators": "data.indicators",
    "likelihood": "selection.likelihood",
    "monitoring": "analysis.monitoring",
    "plot": "interfaces.plot",
    "preprocess": "signals.preprocess",
    "systems": "systems",
}

#: Older names of `modalscope` that are found only in one of its namespaces.
_MOVED = {
    "cmif": "indicators",
    "decomposition": "preprocess",
    "examine": "preprocess",
    "filter_band": "preprocess",
    "half_spectra": "preprocess",
    "mmif": "indicators",
}

_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted([*_HOME_OF, *(set(_NAMESPACES) - {"doctor"})])


class _Namespaces(MetaPathFinder, Loader):
    """Imports of a package by the name that documents give it: `import modalscope.plot` is that of its room."""

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Return how a name of a namespace, or of a module in one, is loaded; None of all others."""
        head, _, rest = fullname.partition(".")
        name, _, inner = rest.partition(".")
        place = _NAMESPACES.get(name, name) if head == "modalscope" else name
        if place == name:
            return None
        return ModuleSpec(fullname, self, loader_state=f"modalscope.{place}{inner and '.'}{inner}")

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module itself, not a copy."""
        module = import_module(spec.loader_state)
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Give the module, which ran when it was imported, its own specification back."""
        given = module.__spec__
        module.__spec__ = None if given is None else given.loader_state


sys.meta_path.insert(0, _Namespaces())

if not TYPE_CHECKING:  # so that a name that is not there is a type checker's error, not Any

    def __getattr__(name: str) -> Any:
        """Load what is asked for: `import modalscope` alone costs neither numpy nor scipy."""
        if name in _HOME_OF:
            found = getattr(import_module(f"modalscope.{_HOME_OF[name]}"), name)
        elif name in _NAMESPACES:
            found = import_module(f"modalscope.{_NAMESPACES[name]}")
        elif name in _MOVED:
            place = f"modalscope.{_MOVED[name]}"
            warn(f"modalscope.{name} is now {place}.{name}", DeprecationWarning, stacklevel=2)
            return getattr(__getattr__(_MOVED[name]), name)
        else:
            raise AttributeError(f"module 'modalscope' has no attribute {name!r}")
        globals()[name] = found
        return found

    def __dir__() -> list[str]:
        return sorted(__all__)
