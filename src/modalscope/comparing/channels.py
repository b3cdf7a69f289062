"""Rules about channels: dead, turned in sign, or bad. Each names its evidence.

dead channel
    It never changes, but for rounding (`modalscope.preprocess.findings`); it is left out before anything is identified.
swapped sign
    By driving points and reciprocity (`modalscope.preprocess.polarity`). A single response is turned
    when more than 2 % of the residues is beyond rank one (a shape times a participation), and less than a third of that with
    its sign changed.
bad channel
    Its fit error is above .25 and three times the median, and the modes leave no more than three times what the best model leaves.
"""

from __future__ import annotations

import numpy as np

from modalscope.comparing.causes import Cause
from modalscope.identification.prepare import Data
from modalscope.model.checks import Array
from modalscope.model.response import Response
from modalscope.preprocess.findings import dead_channels, sides_of
from modalscope.preprocess.polarity import check_polarity

__all__ = ["channel_causes", "sign_causes", "without_dead"]

_PLACE = 0.25  # half bandwidths: poles nearer than that lie in one place
_BAD, _TIMES = 0.25, 3.0
_MIXED, _REPAIRED = 0.02, 1 / 3


def without_dead(data: Data) -> tuple[Data, list[Cause]]:
    """Return the data without dead channels, and one finding for each; data of dead channels alone stay as they are.

    A channel that is dead in one of several setups alone stays: another one may need it.
    """
    dead: dict[str, dict[str, str]] = {}
    kept: dict[str, list[str]] = {}
    for side, flat, labels in sides_of(data):
        found = {finding.channels[0]: finding.reason for finding in dead_channels(flat, labels)}
        found = found if len(found) < len(labels) else {}
        dead[side] = dead.get(side, {}) | found
        kept.setdefault(side, []).extend(dof for dof in labels if dof not in found)
    causes = [
        Cause("dead channel", f"{side} {dof} was left out: {why}", dof)
        for side, found in dead.items()
        for dof, why in found.items()
        if dof not in kept[side]
    ]
    if not causes:
        return data, []
    return data.select(**{f"{side}s": tuple(dict.fromkeys(dofs)) for side, dofs in kept.items()}), causes


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
            evidence = (
                f"{side} {labels[i]}: the modes leave {100 * error[i]:.0f} % of it, {100 * median:.2g} % of the others"
            )
            causes.append(Cause("bad channel", evidence, labels[i]))
    return causes + _turned_alone(response, poles)


def _turned_alone(response: Response, poles: Array) -> list[Cause]:
    """Name the single response whose sign, when turned, makes the residues of rank one that were not."""
    _, outputs, inputs = response.values.shape
    if min(outputs, inputs) < 2 or max(outputs, inputs) < 3 or not poles.size:
        return []
    # a response of the wrong sign makes two poles of one shape each out of every mode: one place counts once
    residues = _free_residues(response, _one_a_place(poles))
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


def _one_a_place(poles: Array) -> Array:
    """Return poles of which none lies within a quarter of its half bandwidth of another."""
    kept: list[complex] = []
    for pole in np.asarray(poles, dtype=complex):
        if all(abs(pole - other) > _PLACE * min(abs(pole.real), abs(other.real)) for other in kept):
            kept.append(complex(pole))
    return np.array(kept)


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
    """Find channels whose sign is turned, from driving points and reciprocity, by the rules of `modalscope.preprocess.polarity`."""
    turned = [finding for finding in check_polarity(response) if finding.kind == "polarity"]
    return [Cause("swapped sign", f"{' or '.join(f.channels)}: {f.reason}", f.channels[0]) for f in turned]
