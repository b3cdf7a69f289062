"""Floor 1: from records to responses, and their quality."""

from modalscope.model.entries import plain_methods
from modalscope.preprocess.conditioning import decimate, detrend, differentiate, filter_band, integrate
from modalscope.preprocess.correlation import correlation_blocks, estimate_correlation
from modalscope.preprocess.findings import Finding
from modalscope.preprocess.forces import PrincipalForces, force_correlation, partial_coherence, principal_forces
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.harmonics_removed import remove_harmonics
from modalscope.preprocess.impacts import exponential_decay
from modalscope.preprocess.local_models import LocalEstimate, local_models
from modalscope.preprocess.markov import estimate_markov
from modalscope.preprocess.merging import merge
from modalscope.preprocess.observer import Observer, estimate_observer
from modalscope.preprocess.one_sided import half_spectra
from modalscope.preprocess.quality import examine
from modalscope.preprocess.setups import merge_setups
from modalscope.preprocess.singular_spectra import Decomposition, decomposition

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

plain_methods(Decomposition, Observer)
