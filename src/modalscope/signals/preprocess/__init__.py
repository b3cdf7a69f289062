"""From records to responses: spectra, frequency responses, correlations, Markov parameters, conditioning, bands, setups."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from modalscope.data.notes import Finding
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.setups import Setups
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.numerics.arguments import plain_methods
from modalscope.numerics.handed import handed
from modalscope.signals.preprocess.conditioning import decimate, detrend, differentiate, filter_band, integrate
from modalscope.signals.preprocess.correlation import correlation_blocks, estimate_correlation, half_spectra
from modalscope.signals.preprocess.forces import PrincipalForces, force_correlation, partial_coherence, principal_forces
from modalscope.signals.preprocess.frf import estimate_frf
from modalscope.signals.preprocess.harmonics_removed import remove_harmonics
from modalscope.signals.preprocess.impacts import exponential_decay
from modalscope.signals.preprocess.local_models import LocalEstimate, local_models
from modalscope.signals.preprocess.markov import Observer, estimate_markov, estimate_observer
from modalscope.signals.preprocess.merging import merge
from modalscope.signals.preprocess.setups import merge_setups
from modalscope.signals.preprocess.singular_spectra import Decomposition, decomposition

if TYPE_CHECKING:
    examine: Callable[[Signals | StoredSignals | StoredResponse | Records | Setups | Response], tuple[Finding, ...]]

__all__ = [
    "Decomposition",
    "Finding",
    "LocalEstimate",
    "Observer",
    "PrincipalForces",
    "correlation_blocks",
    "decimate",
    "decomposition",
    "detrend",
    "differentiate",
    "estimate_correlation",
    "estimate_frf",
    "estimate_markov",
    "estimate_observer",
    "examine",
    "exponential_decay",
    "filter_band",
    "force_correlation",
    "half_spectra",
    "integrate",
    "local_models",
    "merge",
    "merge_setups",
    "partial_coherence",
    "principal_forces",
    "remove_harmonics",
]

plain_methods(Decomposition, Finding, Observer)


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Give `examine` of the doctor, a layer above, under its public name."""
        if name == "examine":
            return handed("examine")
        raise AttributeError(f"module 'modalscope.preprocess' has no attribute {name!r}")
