"""Find which runs were driven at the same place, from their responses: those of one place agree in total, of several only line by line.

Near a resonance the response to a force anywhere is the mode shape times a factor: it differs from mode to mode where the places
differ. With rows a, b of two runs and the products p_n = <a, b> over short blocks n of neighbouring lines and all outputs,

    G = sum |p_n| / sum |a_n| |b_n|                 likeness block by block (noise lowers it)
    W = |sum p_n| / sqrt(sum |a_n|^2 sum |b_n|^2)   likeness in total

W is about G for one place whatever the noise, and below it for two. Channels that were turned or exchanged in a run lower W, too: the
largest W over such changes counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from modalscope.data.channels import AUTO
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.impacts import find_hits

#: Lines of a block, or so many that it holds this number of values, so that two blocks of noise seldom look alike.
_LINES, _VALUES = 4, 16

#: The chance at which a block of noise counts as alike.
_CHANCE = 1e-3

#: Runs are at other places where 1 - W / G exceeds this and this many times 1 - G. Of 400 pairs of random runs at one place (3 to 11
#: modes, 1 to 6 outputs, 5 to 60 dB, hits and random forces) none does; of 400 at two places 86 % of the hits do, 74 % of the others.
_APART, _NOISE = 0.05, 2.0

#: Samples of a run that are examined: enough lines for its resonances.
_SAMPLES = 1 << 16


def named_by_place(parts: Sequence[Any], names: Sequence[str]) -> tuple[list[Any], tuple[Note, ...]]:
    """Return parts of a test with one input, labelled by place (after `names`, those of their files) where they were driven at several.

    They are unchanged, without a note, for other data, other labels, one place, or several places within one part.
    """
    if not _one_input(parts):
        return list(parts), ()
    places = same_places(parts)
    runs = np.cumsum([0, *(part.runs if isinstance(part, Signals) else 1 for part in parts)])
    of_part = [set(places[start:stop]) - {None} for start, stop in pairwise(runs)]
    if any(len(own) != 1 for own in of_part) or len(set.union(*of_part)) == 1:
        return list(parts), ()
    place = [int(k) for own in of_part for k in own if k is not None]
    who = "; ".join(
        f"place {k + 1} ({', '.join(name for name, own in zip(names, place, strict=True) if own == k)})"
        for k in sorted(set(place))
    )
    text = (
        f"the files answer forces at several places, alike line by line, as wholes not, and all call them {parts[0].input_dofs[0]}. "
        f"The inputs are named {who}: --input-dofs gives each file's own"
    )
    named = [replace(part, input_dofs=[f"place {k + 1}"], groups=AUTO) for part, k in zip(parts, place, strict=True)]
    return named, (Note("places", {"places": float(len(set(place)))}, text),)


def _one_input(parts: Sequence[Any]) -> bool:
    """Whether parts are records, or responses on one set of lines, of the same outputs and one input."""
    first = parts[0]
    if len(parts) < 2 or not isinstance(first, Signals | FrequencyResponse) or len(first.input_dofs) != 1:
        return False
    alike = all(
        type(part) is type(first) and part.input_dofs == first.input_dofs and part.output_dofs == first.output_dofs
        for part in parts
    )
    if not alike or isinstance(first, Signals):
        return alike and len({part.sampling_rate for part in parts}) == 1
    return all(np.array_equal(part.frequencies, first.frequencies) for part in parts)


def same_places(parts: Sequence[Any]) -> list[int | None]:
    """Return the number of the place for every run of every part, from 0 in order of appearance; None for one with an overloaded hit.

    All parts have the same outputs and lines, and one input each.
    """
    if isinstance(parts[0], FrequencyResponse):
        return list(_clusters(_over_noise(parts)))
    good = [k for part in parts for k in _well_hit(part)]
    count = min(*(part.samples for part in parts), _SAMPLES)
    spectra = [[np.fft.rfft(x[:, :count], axis=1)[:, 1:-1] for x in part.by_run()] for part in parts]
    outputs, u = (np.concatenate(side)[good] for side in zip(*spectra, strict=True))
    size = np.maximum(np.abs(u), np.finfo(float).tiny)
    usual = np.exp(np.mean(np.log(size), axis=0))  # of the forces, so that lines without one do not count
    found = iter(_clusters(outputs * (usual * u.conj() / size**2)))
    return [next(found) if kept else None for kept in good]


def _well_hit(part: Signals) -> list[bool]:
    """Return for every run whether its force can be used: overloaded hits cannot."""
    forces = part.by_run()[1]
    assert forces is not None
    spoilt = {hit.run for hit in find_hits(forces[:, :, 0]) if hit.unfit} if find_excitation(part) == "impact" else ()
    return [run not in spoilt for run in range(part.runs)]


def _over_noise(parts: Sequence[FrequencyResponse]) -> ComplexArray:
    """Return responses in units of their noise where that is known."""
    rows = np.stack([part.values[:, :, 0] for part in parts])
    noise = [np.sum(part.variance, axis=(1, 2)) for part in parts if part.variance is not None]
    return rows / np.sqrt(np.sum(noise, axis=0))[:, None] if len(noise) == len(parts) else rows


def _clusters(rows: ComplexArray) -> list[int]:
    """Return the number of the place of every run; a run belongs to the place of any run with which it agrees."""
    count = len(rows)
    agree = np.eye(count, dtype=bool)
    for i in range(count):
        for j in range(i):
            agree[i, j] = not _apart(rows[i], rows[j])
    _, found = connected_components(csr_array(agree), directed=False)
    numbers = {place: k for k, place in enumerate(dict.fromkeys(found.tolist()))}
    return [numbers[place] for place in found.tolist()]


def _apart(a: ComplexArray, b: ComplexArray) -> bool:
    """Whether two runs, (lines, outputs), were driven at other places."""
    lines = max(_LINES, -(-_VALUES // a.shape[1]))
    blocks = len(a) // lines
    if blocks == 0:
        return False
    a, b = (x[: blocks * lines].reshape(blocks, lines, -1) for x in (a, b))
    products = np.einsum("nfi,nfi->n", a.conj(), b)
    first, second = (np.sum(x.real**2 + x.imag**2, axis=(1, 2)) for x in (a, b))
    sizes = np.sqrt(first * second)
    significant = np.abs(products) ** 2 > (1 - _CHANCE ** (1 / (a[0].size - 1))) * sizes**2
    if not significant.any():
        return False
    alike = float(np.sum(np.abs(products[significant])) / np.sum(sizes[significant]))
    cross = np.einsum("nfi,nfj->ij", a[significant].conj(), b[significant])
    whole = _explained(cross) / np.sqrt(np.sum(first[significant]) * np.sum(second[significant]))
    return bool(1 - whole / alike > _APART + _NOISE * (1 - alike))


def _explained(cross: ComplexArray) -> float:
    """Return the largest sum of products over channels as they are, turned, or two of them exchanged."""
    own = np.diag(cross)
    straight = abs(complex(np.sum(own)))
    turned = float(np.sum(np.abs(own.real)))
    exchanged: RealArray = np.abs(np.sum(own) - own[:, None] - own + cross + cross.T)
    return max(straight, turned, float(np.max(exchanged[~np.eye(len(own), dtype=bool)], initial=0.0)))
