"""Intervals of a comparison tried on simulations of its own case, by the method that fits best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.comparing.agreement import Group
from modalscope.comparing.run import MethodResult
from modalscope.judging.certificate import Certificate, certified
from modalscope.judging.replicates import replicates_of
from modalscope.model.signals import Signals

__all__ = ["Tried", "certified_best", "interval_trouble"]


@dataclass(frozen=True, eq=False, slots=True)
class Tried:
    """The certificate of one method.

    Parameters
    ----------
    method : str
        As in `MethodResult.name`.
    certificate : Certificate
    """

    method: str
    certificate: Certificate


def certified_best(results: Sequence[MethodResult], records: Sequence[Signals | None], replicates: int) -> Tried | None:
    """Return the certificate of the method that fits best of those whose deviations are known; None where none was asked.

    Parameters
    ----------
    results : sequence of MethodResult
    records : sequence of Signals or None
        Behind the responses of each, where they are correlations.
    replicates : int
    """
    able = [
        (r, signals)
        for r, signals in zip(results, records, strict=True)
        if r.exact and r.moved is not None and r.modes is not None and r.diagram is not None
    ]
    if not replicates or not able:
        return None
    best, signals = min(able, key=lambda pair: np.inf if pair[0].fit_error is None else pair[0].fit_error)
    assert best.diagram is not None
    assert best.modes is not None
    made = replicates_of(best.diagram, best.modes, signals)
    return Tried(best.name, certified(made, replicates, np.random.default_rng(0)))


def interval_trouble(group: Group, frequency_noise: float, damping_noise: float, tried: Tried | None) -> str:
    """Say what is wrong with the interval of a mode: it is not known, or its certificate refutes it; nothing otherwise.

    Parameters
    ----------
    group : Group
    frequency_noise, damping_noise : float
        Deviations; NaN where they are not known.
    tried : Tried, optional
    """
    unknown = [w for w, v in (("frequency", frequency_noise), ("damping", damping_noise)) if not np.isfinite(v)]
    if unknown:
        return f"no deviation of its {' and '.join(unknown)} is known"
    if tried is None or tried.method not in group.members or tried.certificate.holds[group.members[tried.method]]:
        return ""
    return "its interval does not hold, by its certificate"
