"""modalscope: from measured responses of a structure to its modes.

Every identification method is a row of one table: a block data matrix is factored, a realization (A, B, C, D) is read off,
the modal parameters follow. `methods()` lists the table; `identify` runs one cell at one order, `stabilize` at all orders,
and `select` reports the modes with the reasons for each. "The report", and equation numbers without another source, are those
of J.-N. Juang, Mathematical Correlation of Modal Parameter Identification Methods via System Realization Theory, NASA TM 87720 (1986).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any
from warnings import warn

from modalscope.numerics.handed import hand_down

if TYPE_CHECKING:  # what readers and type checkers see; each is loaded from the same place when it is first asked for
    from modalscope import (
        datasets as datasets,
        likelihood as likelihood,
        monitoring as monitoring,
        plot as plot,
        preprocess as preprocess,
        systems as systems,
    )
    from modalscope.checking.certificate import Certificate as Certificate
    from modalscope.checking.certify import certify as certify
    from modalscope.checking.selfcheck import selfcheck as selfcheck
    from modalscope.checking.validation import Validation as Validation, validate as validate
    from modalscope.comparing import Comparison as Comparison, compare as compare
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
        same_mode as same_mode,
    )
    from modalscope.data.analysis import Analysis as Analysis
    from modalscope.data.results import Result as Result
    from modalscope.identification.dwell import Dwell as Dwell, tuned_dwell as tuned_dwell
    from modalscope.identification.identify import Identification as Identification, identify as identify
    from modalscope.identification.method_names import methods as methods
    from modalscope.identification.pipeline import factor as factor
    from modalscope.identification.prepare import prepare as prepare
    from modalscope.identification.stabilize import stabilize as stabilize
    from modalscope.identification.sweep import sweep as sweep
    from modalscope.io import from_frame as from_frame, read as read, write as write
    from modalscope.judging.bands import merge_bands as merge_bands
    from modalscope.judging.refine import refine as refine
    from modalscope.judging.select import select as select
    from modalscope.modal import indicators as indicators
    from modalscope.modal.indicators import mac as mac, mac_std as mac_std
    from modalscope.modal.mass_change import scale_by_mass as scale_by_mass
    from modalscope.modal.pairing import comac as comac, pair_modes as pair_modes
    from modalscope.modal.setups import merge_modes as merge_modes
    from modalscope.modal.shapes import fit_residues as fit_residues
    from modalscope.numerics.executors import working as working
    from modalscope.plot.web.alive import widget as widget
    from modalscope.preprocess import (
        estimate_correlation as estimate_correlation,
        estimate_frf as estimate_frf,
        estimate_markov as estimate_markov,
        merge as merge,
    )
    from modalscope.preprocess.ods import ods as ods
    from modalscope.realizations.sensors import (
        EquationsOfMotion as EquationsOfMotion,
        equations_of_motion as equations_of_motion,
        first_order_form as first_order_form,
    )
    from modalscope.reporting import report as report
    from modalscope.workflow.analyze import analyze as analyze
    from modalscope.workflow.full_field import FullField as FullField, full_field as full_field
    from modalscope.workflow.realize import realize as realize
    from modalscope.workflow.replay import replay as replay

__version__ = "0.2.0"

#: Where each name of the face lives.
_HOMES = {
    "comparing": ("Comparison", "compare"),
    "identification.dwell": ("Dwell", "tuned_dwell"),
    "identification.identify": ("Identification", "identify"),
    "identification.pipeline": ("factor",),
    "identification.prepare": ("prepare",),
    "judging.refine": ("refine",),
    "identification.sweep": ("sweep",),
    "identification.method_names": ("methods",),
    "io": ("from_frame", "read", "write"),
    "judging.bands": ("merge_bands",),
    "checking.certificate": ("Certificate",),
    "judging.select": ("select",),
    "identification.stabilize": ("stabilize",),
    "checking.validation": ("Validation", "validate"),
    "modal.indicators": ("mac", "mac_std"),
    "modal.mass_change": ("scale_by_mass",),
    "modal.pairing": ("comac", "pair_modes"),
    "modal.setups": ("merge_modes",),
    "modal.shapes": ("fit_residues",),
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
    "plot.web.alive": ("widget",),
    "checking.selfcheck": ("selfcheck",),
    "preprocess": ("estimate_correlation", "estimate_frf", "estimate_markov", "merge"),
    "preprocess.ods": ("ods",),
    "realizations.sensors": ("EquationsOfMotion", "equations_of_motion", "first_order_form"),
    "reporting": ("report",),
    "workflow.analyze": ("analyze",),
    "checking.certify": ("certify",),
    "workflow.full_field": ("FullField", "full_field"),
    "workflow.realize": ("realize",),
    "workflow.replay": ("replay",),
}

#: What data classes, preprocessing and sweeps ask of packages above them: see `modalscope.numerics.handed`.
hand_down(
    columns_of="modalscope.judging.description:columns_of",
    deviating="modalscope.likelihood.deviations:OfPipeline",
    drawn="modalscope.plot.shown:drawn",
    examine="modalscope.doctor:examine",
    grades="modalscope.judging.grades:grades",
    living="modalscope.plot.web.alive:living",
    table_of="modalscope.judging.description:table_of",
    text_of="modalscope.judging.description:text_of",
    verdict_of_result="modalscope.plot.web.verdict:verdict_of_result",
)

#: What else there is, in namespaces.
_NAMESPACES = {
    "datasets": "datasets",
    "indicators": "modal.indicators",
    "likelihood": "likelihood",
    "monitoring": "monitoring",
    "plot": "plot",
    "preprocess": "preprocess",
    "systems": "systems",
}

#: Names that stood at the face and now stand in a namespace alone.
_MOVED = {
    "cmif": "indicators",
    "decomposition": "preprocess",
    "examine": "preprocess",
    "filter_band": "preprocess",
    "half_spectra": "preprocess",
    "mmif": "indicators",
}

_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted([*_HOME_OF, *_NAMESPACES])

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
