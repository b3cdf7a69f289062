"""Take records without forces that are free decays as what they are: from the release on, at the rate that their modes need."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.data.sizes import check_size
from modalscope.numerics.functions.damped_tones import Decay, decay_of, one_in


def as_free_decay(
    signals: Signals, judged: Signals | None = None
) -> tuple[Signals | ImpulseResponse, tuple[Note, ...]]:
    """Return a record as free decays, one column a run, and notes; unchanged where a run is none, or a force was measured.

    `judged`: the channels that decide it, where others will be excluded.

    The modes of a decay are exponentials themselves. As ambient vibration its correlations would average over what is left of it.
    """
    check_size(signals)
    outputs, inputs = signals.by_run()
    if inputs is not None:
        return signals, ()
    decays: list[Decay] = []
    for run in outputs if judged is None else judged.by_run()[0]:
        decay = decay_of(run)
        if decay is None or (decays and decay.step != decays[0].step):
            return signals, ()
        decays.append(decay)
    step, start = decays[0].step, decays[0].first / signals.sampling_rate
    samples = [decay.samples for decay in decays]
    if judged is not None:
        ends = (run - run[-max(len(run) // 10, 1) :].mean(axis=0) for run in outputs)
        samples = [one_in(y, step)[decay.first // step :] for y, decay in zip(ends, decays, strict=True)]
    shortest = min(map(len, samples))
    unexplained = max(decay.unexplained for decay in decays)
    where = f"from {start:.4g} s on" if len(decays) == 1 else f"of {len(decays)} runs, each from its release on"
    text = (
        f"Taken as a free decay {where}, no force: damped tones explain {100 * (1 - unexplained):.3g} % of it. "
        "If it is ambient vibration, say so: route='correlation', --route correlation"
    )
    fields: dict[str, Any] = signals.labelled() | {
        "input_dofs": tuple(f"run {k + 1}" for k in range(len(decays))),
        "units": (signals.units[0], None),
    }
    response = ImpulseResponse(
        values=np.stack([each[:shortest] for each in samples], axis=2),
        sampling_rate=signals.sampling_rate / step,
        kind="free decay",
        quantity=signals.quantity,
        **fields,
    )
    what = "cut to its free decay" + ("" if step == 1 else f", low-pass filtered, one sample in {step} kept")
    return response.processed(what), (Note("free decay", {"start": start, "step": step}, text),)
