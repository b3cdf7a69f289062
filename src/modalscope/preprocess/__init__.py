"""Floor 1: from records to responses, and their quality."""

from modalscope.preprocess.conditioning import decimate, detrend, differentiate, filter_band, integrate
from modalscope.preprocess.correlation import correlation_blocks, estimate_correlation, half_spectra
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.impacts import exponential_decay

__all__ = [
    "correlation_blocks",
    "decimate",
    "detrend",
    "differentiate",
    "estimate_correlation",
    "estimate_frf",
    "exponential_decay",
    "filter_band",
    "half_spectra",
    "integrate",
]
