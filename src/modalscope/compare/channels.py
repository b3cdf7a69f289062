"""Rules about channels: dead, turned in sign, or bad. Each names its evidence.

dead channel
    Zero throughout (it is left out before anything is identified), or explained by no mode: its fit error is above .9
    where the median is below .3.
swapped sign
    At a driving point a structure cannot give energy: Im of the accelerance (Re of the mobility, -Im of the receptance) is
    positive in sum. Reciprocity: H_ij = H_ji; a correlation below -.8 means that one side is turned. A single response that is
    the opposite of what the modes of all others say (correlation below -.3) is turned by itself.
bad channel
    Its fit error is above .25 and three times the median.
"""

from __future__ import annotations

import numpy as np

from modalscope.compare.causes import Cause
from modalscope.compare.plan import Response
from modalscope.model.checks import Array, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.signals import Signals
from modalscope.pipeline import Data

__all__ = ["channel_causes", "sign_causes", "without_dead"]

_DEAD, _HEALTHY = 0.9, 0.3
_BAD, _TIMES = 0.25, 3.0
_RECIPROCAL, _OPPOSITE, _PASSIVE = -0.8, -0.3, -0.5


def without_dead(data: Data) -> tuple[Data, list[Cause]]:
    """Return the data without channels that are zero throughout, and one finding for each."""
    if isinstance(data, Signals):
        rows = np.any(data.outputs.reshape(-1, data.outputs.shape[-1]), axis=0)
        inputs = data.inputs
        columns = None if inputs is None else np.any(inputs.reshape(-1, inputs.shape[-1]), axis=0)
    else:
        rows, columns = np.any(data.values, axis=(0, 2)), np.any(data.values, axis=(0, 1))
    causes, kept = [], {}
    for side, alive, labels in (("output", rows, data.output_dofs), ("input", columns, data.input_dofs)):
        if alive is None or alive.all() or not alive.any():
            continue
        kept[f"{side}s"] = [int(i) for i in np.flatnonzero(alive)]
        causes += [
            Cause("dead channel", f"{side} {labels[i]} is zero throughout and was left out", labels[i])
            for i in np.flatnonzero(~alive)
        ]
    return (data.select(**kept) if kept else data), causes


def channel_causes(response: Response, rebuilt: Array) -> list[Cause]:
    """Judge every channel by what the consensus modes leave of it."""
    left = np.abs(response.values - rebuilt) ** 2
    size = np.abs(response.values) ** 2
    causes: list[Cause] = []
    for side, axes, labels in (("output", (0, 2), response.output_dofs), ("input", (0, 1), response.input_dofs)):
        if len(labels) < 3:  # too few to say which is the odd one
            continue
        error = np.sqrt(left.sum(axis=axes) / np.maximum(size.sum(axis=axes), 1e-300))
        median = float(np.median(error))
        for i in np.flatnonzero(error > max(_BAD, _TIMES * median)):
            dead = error[i] > _DEAD and median < _HEALTHY
            evidence = (
                f"{side} {labels[i]}: the modes leave {100 * error[i]:.0f} % of it, {100 * median:.2g} % of the others"
            )
            causes.append(Cause("dead channel" if dead else "bad channel", evidence, labels[i]))
    return causes + _turned_alone(response, rebuilt, size)


def _turned_alone(response: Response, rebuilt: Array, size: Array) -> list[Cause]:
    """Single responses that are the opposite of what the others say."""
    H, R = response.values, rebuilt
    norm = np.sqrt(size.sum(axis=0) * np.sum(np.abs(R) ** 2, axis=0))
    inner = np.real(np.sum(H * np.conj(R), axis=0)) / np.maximum(norm, 1e-300)
    loud = np.sum(np.abs(R) ** 2, axis=0) > 0.01 * size.sum(axis=0)
    return [
        Cause(
            "swapped sign",
            f"output {response.output_dofs[o]}, input {response.input_dofs[i]}: "
            f"correlation {inner[o, i]:.2f} with what the modes of all others say",
            response.output_dofs[o],
        )
        for o, i in np.argwhere(loud & (inner < _OPPOSITE))
    ]


def sign_causes(response: Response) -> list[Cause]:
    """Find channels whose sign is turned, from driving points and reciprocity."""
    if isinstance(response, ImpulseResponse) and response.kind == "correlation":
        return []  # a turned channel turns its row and its column: nothing shows
    common = [dof for dof in response.output_dofs if dof in response.input_dofs]
    if not common:
        return []
    H = response.values[:, [response.output_dofs.index(d) for d in common]][
        :, :, [response.input_dofs.index(d) for d in common]
    ]
    causes = _from_driving_points(response, H, common)
    return causes or _from_reciprocity(H, common)


def _from_driving_points(response: Response, H: Array, common: list[str]) -> list[Cause]:
    if response.quantity is None:
        return []
    driving = np.diagonal(H, axis1=1, axis2=2)
    power = _power(response, driving)
    return [
        Cause("swapped sign", f"driving point {dof}: it gives energy ({100 * share:.0f} % of what it should take)", dof)
        for dof, share in zip(common, power, strict=True)
        if share < _PASSIVE
    ]


def _power(response: Response, driving: Array) -> RealArray:
    """Return sum / sum of magnitudes of the power taken at each driving point, -1 to 1."""
    if isinstance(response, FrequencyResponse):
        values = driving
    else:
        # lines of the samples, phases counted from the impulse
        steps = np.arange(response.samples) + response.first_sample
        f = np.fft.rfftfreq(2 * response.samples, 1 / response.sampling_rate)
        delay = steps[0] + (0.5 if response.kind == "pulse" else 0.0)
        values = np.fft.rfft(driving, n=2 * response.samples, axis=0)
        values = values * np.exp(-2j * np.pi * f / response.sampling_rate * delay)[:, None]
    turn = {"displacement": -1j, "velocity": 1.0, "acceleration": 1j}[response.quantity or "velocity"]
    taken = np.real(values * np.conj(turn))
    return np.asarray(taken.sum(axis=0) / np.maximum(np.abs(taken).sum(axis=0), 1e-300))


def _from_reciprocity(H: Array, common: list[str]) -> list[Cause]:
    k = len(common)
    negative: dict[int, list[float]] = {}
    for a in range(k):
        for b in range(a):
            x, y = H[:, a, b], H[:, b, a]
            c = float(np.real(np.vdot(y, x)) / max(float(np.linalg.norm(x) * np.linalg.norm(y)), 1e-300))
            if c < _RECIPROCAL:
                negative.setdefault(a, []).append(c)
                negative.setdefault(b, []).append(c)
    if not negative:
        return []
    most = max(len(v) for v in negative.values())
    named = [common[i] for i, v in sorted(negative.items()) if len(v) == most]
    words = " or ".join(named)
    value = np.mean([c for v in negative.values() for c in v])
    return [
        Cause(
            "swapped sign",
            f"{words}: H_ij and H_ji have a correlation of {value:.2f}; its output or its input is turned",
            named[0],
        )
    ]
