"""Examine measured data before identification: run all checks of records and responses, and collect the findings."""

from __future__ import annotations

from modalscope.data.notes import Finding
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind
from modalscope.numerics.resources import one_thread
from modalscope.signals.doctor.responses import examine_response


@named()
@one_thread
def examine(
    data: Signals | StoredSignals | StoredResponse | Records | Setups | Response, *, whole: bool = False
) -> tuple[Finding, ...]:
    """Check data for common faults of measurement: each finding names channels, reason and remedy.

    The faults are overloaded, double and clipped hits; clipped, dead, noisy, duplicate, swapped and delayed channels; converter
    overflows, frozen channels, gaps, missing samples and spikes; force and response exchanged; transposed or conjugate arrays, values
    without phase, levels or angles instead of complex values; outlying lines, events that dominate a record without inputs, channels
    and records that change half-way, halves that repeat, clocks that differ, drift, wrong polarity, leakage, low coherence, responses
    that are not reciprocal, a wrong quantity, records too short for their damping. Some need certain data: polarity driving points,
    reciprocity two inputs at output dofs.

    Parameters
    ----------
    data : Signals, StoredSignals, StoredResponse, Records, Setups, FrequencyResponse or ImpulseResponse
        Of a stored record a stretch from its middle is examined, of stored responses some outputs.
    whole : bool
        Whether all of many outputs and inputs are searched for outlying lines and a wrong quantity, not a sample of them; see `sampled`.

    Returns
    -------
    tuple of Finding
        Empty for clean data.

    Examples
    --------
    >>> import numpy as np
    >>> y = np.random.default_rng(0).standard_normal((1000, 3))
    >>> y[:, 1] = 0.0
    >>> for finding in examine(Signals(outputs=y, sampling_rate=10.0)):
    ...     print(finding)
    dead: y2: it never changes. Check cable and sensor, or leave it out: exclude=['y2'].
    """
    kinds = (FrequencyResponse, ImpulseResponse, Signals, StoredSignals, StoredResponse, Records, Setups)
    check_kind("examine", data, kinds)
    if isinstance(data, StoredSignals | StoredResponse):
        data = data.excerpt()
    check_size(data)
    if isinstance(data, Response):
        return tuple(examine_response(data.picture(), whole=whole))
    from modalscope.signals.doctor.examine_record import examine_record  # responses need none of its checks

    if isinstance(data, Records | Setups):
        parts = data.stacked() if isinstance(data, Records) else data.parts
        return tuple(dict.fromkeys(finding for part in parts for finding in examine_record(part, whole)))
    return tuple(examine_record(data, whole))
