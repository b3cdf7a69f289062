"""Compare the runs of a test: whether they were driven at one place, and whether outputs changed sign or were exchanged.

Near a resonance the response to a force at any place is the mode shape times a factor. If two runs were driven at different places, the
ratio of their factors differs from mode to mode. With the responses a, b of two runs and the products p_n = <a, b> over short blocks n
of neighbouring lines and all outputs,

    G = sum |p_n| / sum |a_n| |b_n|                 likeness block by block; noise lowers it
    W = |sum p_n| / sqrt(sum |a_n|^2 sum |b_n|^2)   likeness of the whole band

W is about G for one place whatever the noise, and below it for two. Outputs that changed sign or were exchanged in one of the runs lower
W, too; therefore W is the largest over such changes.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.signals.doctor.findings import finding
from modalscope.signals.preprocess.excitation import find_excitation
from modalscope.signals.preprocess.impacts import find_hits
from modalscope.signals.preprocess.spectra import Segments, cross_spectra

#: Minimum lines and minimum values (lines times outputs) of a block: of n random values the squared correlation is 1 / n in the mean.
_MIN_BLOCK_LINES, _MIN_BLOCK_VALUES = 4, 16

#: Probability that a block of noise counts as alike. The squared correlation of two blocks of n values of complex white noise exceeds x
#: with probability (1 - x)^(n - 1), so that the limit is x = 1 - _FALSE_ALARM^(1 / (n - 1)).
_FALSE_ALARM = 1e-3

#: Two runs count as driven at different places when 1 - W / G exceeds _MIN_DIFFERENCE + _NOISE_FACTOR (1 - G). The study behind both
#: numbers: of 400 pairs of random runs at one place (3 to 11 modes, 1 to 6 outputs, 5 to 60 dB, hits and random forces) none does; of 400
#: pairs at two places 86 % of those with hits do, and 74 % of those with random forces.
_MIN_DIFFERENCE, _NOISE_FACTOR = 0.05, 2.0

#: Maximum number of samples of a run that are examined. Every run is compared with every other, and 32 767 lines resolve the resonances of
#: a test.
_MAX_SAMPLES = 1 << 16

#: Minimum real correlation of an output of one run with the negative of its usual response, or with the usual response of another output
#: (chosen: single runs have no averages, so that noise lowers all correlations). Two outputs count as exchanged only if this correlation
#: is larger by the second factor than that of each of them with its own usual response.
_MIN_LIKENESS, _MIN_EXCHANGE_RATIO = 0.5, 2.0


def place_numbers(signals: Signals) -> list[int | None]:
    """Return the number of the place of every run, from 0 in the order of appearance; None for a run with an overloaded hit."""
    usable = _usable_runs(signals)
    outputs, inputs = signals.by_run()
    assert inputs is not None
    y, u = (np.fft.rfft(x[:, :_MAX_SAMPLES], axis=1)[usable, 1:-1] for x in (outputs, inputs))
    size = np.maximum(np.abs(u), np.finfo(float).tiny)
    mean = np.exp(np.mean(np.log(size), axis=0))  # responses times the usual force: lines without force do not count
    places = iter(_clusters(y * (mean * u.conj() / size**2)))
    return [next(places) if use else None for use in usable]


def _usable_runs(part: Signals) -> list[bool]:
    """Return whether the force of every run can be used; that of an overloaded hit is not known."""
    forces = part.by_run()[1]
    assert forces is not None
    unfit = {hit.run for hit in find_hits(forces[:, :, 0]) if hit.unfit} if find_excitation(part) == "impact" else ()
    return [run not in unfit for run in range(part.runs)]


def _clusters(rows: ComplexArray) -> list[int]:
    """Return the number of the place of every run, (runs, lines, outputs); a run belongs to the place of any run with which it agrees.

    Components are numbered in the order of their first run.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    agree = np.eye(len(rows), dtype=bool)
    for i, j in combinations(range(len(rows)), 2):
        agree[i, j] = not _differ(rows[i], rows[j])
    return list(connected_components(csr_array(agree), directed=False)[1].tolist())


def _differ(a: ComplexArray, b: ComplexArray) -> bool:
    """Return whether two runs, (lines, outputs), were driven at different places; False where no block stands out of noise."""
    lines = max(_MIN_BLOCK_LINES, -(-_MIN_BLOCK_VALUES // a.shape[1]))
    blocks = len(a) // lines
    if blocks == 0:
        return False
    a, b = (x[: blocks * lines].reshape(blocks, lines, -1) for x in (a, b))
    products = np.einsum("nfi,nfi->n", a.conj(), b)
    first, second = (np.sum(x.real**2 + x.imag**2, axis=(1, 2)) for x in (a, b))
    sizes = np.sqrt(first * second)
    significant = np.abs(products) ** 2 > (1 - _FALSE_ALARM ** (1 / (a[0].size - 1))) * sizes**2
    if not significant.any():
        return False
    G = float(np.sum(np.abs(products[significant])) / np.sum(sizes[significant]))
    cross = np.einsum("nfi,nfj->ij", a[significant].conj(), b[significant])
    W = _largest_product(cross) / np.sqrt(np.sum(first[significant]) * np.sum(second[significant]))
    return bool(1 - W / G > _MIN_DIFFERENCE + _NOISE_FACTOR * (1 - G))


def _largest_product(cross: ComplexArray) -> float:
    """Return the largest |sum p_n| over changes of one run: none, any signs of its outputs, or two of them exchanged.

    `cross` (l, l): products of output i of one run with output j of the other.
    """
    products = np.diag(cross)
    as_given = abs(complex(np.sum(products)))
    any_signs = float(np.sum(np.abs(products.real)))
    exchanged: RealArray = np.abs(np.sum(products) - products[:, None] - products + cross + cross.T)
    return max(as_given, any_signs, float(np.max(exchanged[~np.eye(len(products), dtype=bool)], initial=0.0)))


def changed_runs(signals: Signals) -> list[Finding]:
    """Find runs of a test with one input that were driven at other places, or whose outputs changed sign or were exchanged."""
    if signals.runs < 2 or len(signals.input_dofs) > 1:
        return []
    places = place_numbers(signals)
    different = sorted({place for place in places if place is not None})
    if len(different) < 2:
        return _changed_channels(signals) if signals.runs > 2 else []  # of two runs neither is the usual one
    runs = [", ".join(str(k + 1) for k, p in enumerate(places) if p == place) for place in different]
    return [finding("places", *signals.input_dofs, runs=" | ".join(runs), count=len(runs))]


def _changed_channels(signals: Signals) -> list[Finding]:
    """Compare the outputs of every run with the median of the other runs by their real correlations."""
    outputs, inputs = signals.by_run()
    assert inputs is not None
    tiny = np.finfo(float).tiny
    # a Hann window would hide a hit at the start of its run
    window = "hann" if find_excitation(signals) == "random" else "none"
    segments = Segments.of(signals.samples, signals.samples, window=window)
    rows = []
    for y, u in zip(outputs, inputs, strict=True):
        S = cross_spectra(y[None], u[None], signals.sampling_rate, segments)
        rows.append(S.cross[:, :, 0] / np.maximum(np.sqrt(S.inputs[:, 0, 0].real), tiny)[:, None])
    shape = np.array(rows)
    shape /= np.maximum(np.linalg.norm(shape, axis=1, keepdims=True), tiny)
    findings, dofs = [], signals.output_dofs
    for r in range(signals.runs):
        others = np.delete(shape, r, axis=0)
        usual = np.median(others.real, axis=0) + 1j * np.median(others.imag, axis=0)
        # [i, j]: the usual response of output i with output j of this run
        likeness = (usual.conj().T @ shape[r]).real / np.maximum(np.linalg.norm(usual, axis=0), tiny)[:, None]
        same = np.diag(likeness)
        for i, dof in enumerate(dofs):
            if same[i] < -_MIN_LIKENESS:
                findings.append(finding("polarity: run", dof, run=r + 1))
            findings += [
                finding("swapped: run", dofs[j], dof, run=r + 1)
                for j in range(i)
                if min(likeness[i, j], likeness[j, i]) > max(_MIN_LIKENESS, _MIN_EXCHANGE_RATIO * max(same[i], same[j]))
            ]
    return findings
