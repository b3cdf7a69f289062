"""Rules about channels: dead, turned in sign, or bad. Each names its evidence.

dead channel
    Zero throughout (it is left out before anything is identified), or explained by no mode: its fit error is above .9
    where the median is below .3.
swapped sign
    At a driving point a structure cannot give energy: Im of the accelerance (Re of the mobility, -Im of the receptance) is
    positive in sum. Reciprocity: H_ij = H_ji; a correlation below -.8 means that one side is turned. A single response is turned
    when more than 2 % of the residues is beyond rank one (a shape times a participation), and less than a third of that with
    its sign changed.
bad channel
    Its fit error is above .25 and three times the median, and the modes leave no more than three times what the best model leaves.
"""

from __future__ import annotations

import numpy as np

from modalscope.comparing.causes import Cause
from modalscope.identification.prepare import Data
from modalscope.model.channels import QUANTITIES
from modalscope.model.checks import Array, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.response import Response
from modalscope.model.signals import Signals

__all__ = ["channel_causes", "sign_causes", "without_dead"]

_DEAD, _HEALTHY = 0.9, 0.3
_BAD, _TIMES = 0.25, 3.0
_RECIPROCAL, _PASSIVE = -0.8, -0.5
_MIXED, _REPAIRED = 0.02, 1 / 3

#: Decay of the window over the record, in nepers.
_WINDOW = 5.0


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


def channel_causes(response: Response, rebuilt: Array, poles: Array, best: float = np.inf) -> list[Cause]:
    """Judge every channel by what the consensus modes leave of it.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
    rebuilt : array, shape of the response
    poles : array of complex, (n,)
        Of the consensus as they are in the data, rad/s.
    best : float
        What the best model of any order leaves. When the modes leave much more, real poles carry the rest, and no channel is blamed for it.
    """
    left = np.abs(response.values - rebuilt) ** 2
    size = np.abs(response.values) ** 2
    causes: list[Cause] = []
    if np.sqrt(left.sum() / size.sum()) > _TIMES * best:
        return _turned_alone(response, poles)
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
    return causes + _turned_alone(response, poles)


def _turned_alone(response: Response, poles: Array) -> list[Cause]:
    """Name the single response whose sign, when turned, makes the residues of rank one that were not."""
    _, outputs, inputs = response.values.shape
    if min(outputs, inputs) < 2 or max(outputs, inputs) < 3 or not poles.size:
        return []
    residues = _free_residues(response, poles)
    before = _beyond_rank_one(residues)
    after = np.empty((outputs, inputs))
    for o, i in np.ndindex(outputs, inputs):
        turned = residues.copy()
        turned[:, o, i] *= -1
        after[o, i] = _beyond_rank_one(turned)
    best = float(after.min())
    if before < _MIXED or best > _REPAIRED * before:
        return []
    # with two inputs the one response of a sensor cannot be told from its other one
    named = np.argwhere(after <= 1.5 * best + 1e-12)
    o = int(named[0, 0])
    sides = " or ".join(f"output {response.output_dofs[a]} with input {response.input_dofs[b]}" for a, b in named[:4])
    evidence = f"{sides}: turned, it lowers what no single shape explains from {100 * before:.2g} to {100 * best:.2g} %"
    return [Cause("swapped sign", evidence, response.output_dofs[o])]


def _free_residues(response: Response, poles: Array) -> Array:
    """Return residues (n, l, m) of every channel by least squares, not tied to a shape."""
    basis = response.basis(poles)
    columns = np.hstack([basis.terms, basis.functions])
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    rows, outputs, inputs = basis.data.shape
    found = np.linalg.lstsq(columns / scale, basis.data.reshape(rows, -1), rcond=None)[0] / scale[:, None]
    modal = found[basis.terms.shape[1] :].reshape(-1, 2, outputs, inputs)
    return np.asarray(modal[:, 0] + 1j * modal[:, 1])


def _beyond_rank_one(residues: Array) -> float:
    """Return the median over modes of the share of the squared residue that its largest singular direction leaves."""
    s2 = np.linalg.svd(residues, compute_uv=False) ** 2
    return float(np.median(1 - s2[:, 0] / np.maximum(s2.sum(axis=1), 1e-300)))


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
    """Return the power taken at each driving point over the sum of its magnitudes, -1 to 1; strong lines count more."""
    if isinstance(response, FrequencyResponse):
        s, values = 2j * np.pi * response.frequencies, driving
    else:
        # an exponential window keeps the mobility positive real, at s = alpha + j w, and the end of the record out of it
        t = (np.arange(response.samples) + response.first_sample) / response.sampling_rate
        t = t + (0.5 / response.sampling_rate if response.kind == "pulse" else 0.0)
        alpha = _WINDOW / t[-1]
        f = np.fft.rfftfreq(2 * response.samples, 1 / response.sampling_rate)
        s = alpha + 2j * np.pi * f
        values = np.fft.rfft(driving * np.exp(-alpha * t)[:, None], n=2 * response.samples, axis=0)
        values = values * np.exp(-2j * np.pi * f * t[0])[:, None]
    power = 1 - QUANTITIES[response.quantity or "velocity"]
    with np.errstate(divide="ignore", invalid="ignore"):
        mobility = np.nan_to_num(values * s[:, None] ** power)
    taken = np.real(mobility) * np.abs(values) ** 2
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
