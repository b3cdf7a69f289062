"""From records to responses: spectra, frequency responses, correlations, Markov parameters, conditioning, bands, setups."""

from itertools import chain
from typing import TYPE_CHECKING, Any

from modalscope.numerics.handed import handed, later

if TYPE_CHECKING:
    from collections.abc import Callable

    from modalscope.data.notes import Finding as Finding
    from modalscope.data.records import Records, Signals
    from modalscope.data.response import Response
    from modalscope.data.setups import Setups
    from modalscope.data.stored import StoredResponse, StoredSignals
    from modalscope.signals.preprocess.conditioning import (
        decimate as decimate,
        detrend as detrend,
        differentiate as differentiate,
        filter_band as filter_band,
        integrate as integrate,
    )
    from modalscope.signals.preprocess.correlation import (
        correlation_blocks as correlation_blocks,
        estimate_correlation as estimate_correlation,
        half_spectra as half_spectra,
    )
    from modalscope.signals.preprocess.frf import estimate_frf as estimate_frf
    from modalscope.signals.preprocess.harmonics_removed import remove_harmonics as remove_harmonics
    from modalscope.signals.preprocess.impacts import exponential_decay as exponential_decay
    from modalscope.signals.preprocess.local_polynomials import (
        LocalEstimate as LocalEstimate,
        local_models as local_models,
    )
    from modalscope.signals.preprocess.markov import estimate_markov as estimate_markov
    from modalscope.signals.preprocess.merging import merge as merge
    from modalscope.signals.preprocess.setups import merge_setups as merge_setups
    from modalscope.signals.preprocess.singular_spectra import (
        Decomposition as Decomposition,
        decomposition as decomposition,
    )

    examine: Callable[[Signals | StoredSignals | StoredResponse | Records | Setups | Response], tuple[Finding, ...]]

#: Names of each module.
_HOMES: dict[str, tuple[str, ...]] = {
    "modalscope.data.notes": ("Finding",),
    "conditioning": ("decimate", "detrend", "differentiate", "filter_band", "integrate"),
    "correlation": ("correlation_blocks", "estimate_correlation", "half_spectra"),
    "frf": ("estimate_frf",),
    "harmonics_removed": ("remove_harmonics",),
    "impacts": ("exponential_decay",),
    "local_polynomials": ("LocalEstimate", "local_models"),
    "markov": ("estimate_markov",),
    "merging": ("merge",),
    "setups": ("merge_setups",),
    "singular_spectra": ("Decomposition", "decomposition"),
}

__all__ = sorted(["examine", *chain.from_iterable(_HOMES.values())])

if not TYPE_CHECKING:
    _later = later("modalscope.preprocess", _HOMES)

    def __getattr__(name: str) -> Any:
        """Load what is asked for; `examine` is that of the doctor, a layer above, under its public name."""
        return handed("examine") if name == "examine" else _later(name)
