"""modalscope: from measured responses of a structure to its modes.

Every identification method is a row of one table: a block data matrix is factored, a realization (A, B, C, D) is read off,
the modal parameters follow. `methods()` lists the table; `identify` runs one cell at one order, `stabilize` at all orders,
and `select` reports the modes with the reasons for each. "The report", and equation numbers without another source, are those
of J.-N. Juang, Mathematical Correlation of Modal Parameter Identification Methods via System Realization Theory, NASA TM 87720 (1986).
"""

from modalscope import plot, systems
from modalscope.comparing import Comparison, compare
from modalscope.identification.dwell import Dwell, mmif, tuned_dwell
from modalscope.identification.identify import Identification, identify, realize
from modalscope.identification.table import methods
from modalscope.io import read, write
from modalscope.judging.bands import merge_bands
from modalscope.judging.select import select
from modalscope.judging.stabilize import stabilize
from modalscope.modal.indicators import cmif, mac
from modalscope.modal.shapes import fit_residues
from modalscope.model import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Note,
    Records,
    Signals,
    StabilizationDiagram,
    StateSpace,
)
from modalscope.model.version import VERSION
from modalscope.preprocess import (
    decomposition,
    estimate_correlation,
    estimate_frf,
    estimate_markov,
    examine,
    filter_band,
    half_spectra,
    merge,
)
from modalscope.realizations.sensors import EquationsOfMotion, equations_of_motion, first_order_form
from modalscope.reporting import report

__version__ = VERSION

__all__ = [
    "Comparison",
    "DataError",
    "Dwell",
    "EquationsOfMotion",
    "FrequencyResponse",
    "Geometry",
    "Identification",
    "ImpulseResponse",
    "ModalModel",
    "Note",
    "Records",
    "Signals",
    "StabilizationDiagram",
    "StateSpace",
    "cmif",
    "compare",
    "decomposition",
    "equations_of_motion",
    "estimate_correlation",
    "estimate_frf",
    "estimate_markov",
    "examine",
    "filter_band",
    "first_order_form",
    "fit_residues",
    "half_spectra",
    "identify",
    "mac",
    "merge",
    "merge_bands",
    "methods",
    "mmif",
    "plot",
    "read",
    "realize",
    "report",
    "select",
    "stabilize",
    "systems",
    "tuned_dwell",
    "write",
]
