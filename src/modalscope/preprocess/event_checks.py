"""Events in records of random vibration: what is as strong as all the rest leaves nothing of the length that was recorded."""

from __future__ import annotations

import numpy as np

from modalscope.model.signals import Signals
from modalscope.preprocess.findings import Finding

__all__ = ["events"]

#: Stretches of a record, and the squared coefficient of variation of their power above which it has an event. Were every stretch's power
#: exponential, as that of a mode which outlasts it, 25 of a million records would have so much by chance.
_STRETCHES, _UNEVEN = 40, 4.0

#: A stretch belongs to the event where its power is so many times that of the usual one.
_LOUD = 4.0


def events(signals: Signals) -> list[Finding]:
    """Find an earthquake, a blow or a passage in a record without inputs, one run, that outweighs the rest.

    With p the power of equal stretches, averages over the record scatter as if it lasted T (sum p)^2 / (n sum p^2) = T / (1 + c^2). Every
    channel counts alike, its power over its mean; the median of channels is taken, for faults of single channels are other findings.

    Parameters
    ----------
    signals : Signals
    """
    outputs, inputs = signals.by_run()
    size = outputs.shape[1] // _STRETCHES
    if inputs is not None or len(outputs) != 1 or size < 2:
        return []
    y = outputs[0, : size * _STRETCHES] - outputs[0].mean(axis=0)
    power = np.mean(y.reshape(_STRETCHES, size, -1) ** 2, axis=1)
    each = np.median(power / np.maximum(power.mean(axis=0), np.finfo(float).tiny), axis=1)
    each = each / max(float(each.mean()), np.finfo(float).tiny)
    uneven = float(np.var(each))
    if uneven <= _UNEVEN:
        return []
    loud = each > _LOUD * np.median(each)
    seconds = size / signals.sampling_rate
    first, last = int(np.argmax(each)), int(np.argmax(each)) + 1
    while first > 0 and loud[first - 1]:
        first -= 1
    while last < _STRETCHES and loud[last]:
        last += 1
    share = 100 * float(each[first:last].sum() / each.sum())
    worth = signals.samples / signals.sampling_rate / (1 + uneven)
    return [
        Finding(
            "event",
            signals.output_dofs,
            f"{share:.0f} % of the power lies between {first * seconds:.4g} and {last * seconds:.4g} s: averages over the record are "
            f"worth no more than {worth:.3g} s of steady vibration",
            "Cut the event out, and give the parts before and after it as runs, merge([...]); or identify it by itself. A free decay is "
            "one from its release on: --rows FIRST- --columns \"time=1,decay=2-\", or ImpulseResponse(..., kind='free decay').",
        )
    ]
