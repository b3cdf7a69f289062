"""Compare the runs of a test: whether they were driven at one place, and whether outputs changed sign or were exchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.data.notes import Finding
from modalscope.data.records import Records, Signals
from modalscope.signals.doctor.findings import finding
from modalscope.signals.doctor.places import placed
from modalscope.signals.preprocess.excitation import find_excitation
from modalscope.signals.preprocess.impacts import find_hits
from modalscope.signals.preprocess.spectra import Segments, cross_spectra

#: Minimum real correlation of an output of one run with the negative of its usual response, or with the usual response of another output
#: (chosen: single runs have no averages, so that noise lowers all correlations). Two outputs count as exchanged only if this correlation
#: is larger by the second factor than that of each of them with its own usual response.
_MIN_LIKENESS, _MIN_EXCHANGE_RATIO = 0.5, 2.0


def changed_runs(signals: Signals) -> list[Finding]:
    """Find runs of a test with one input that were driven at other places, or whose outputs changed sign or were exchanged.

    Runs that are those of one place once their outputs are turned or exchanged back were driven at one place.
    """
    if signals.runs < 2 or len(signals.input_dofs) > 1:
        return []
    numbers, runs = _usable_runs(signals)
    found = placed(runs) if len(runs) > 1 else None
    # of two runs neither is the usual one
    changed, restored = _changed_channels(signals) if signals.runs > 2 else ([], signals)
    if found is None or found.kind != "several" or placed(_usable_runs(restored)[1]).kind != "several":
        return changed
    at = [
        [str(k) for k, p in zip(numbers, found.places, strict=True) if p == place]
        for place in range(max(found.places) + 1)
    ]
    return [finding("places", *signals.input_dofs, runs=" | ".join(map(", ".join, at)), count=len(at))]


def _usable_runs(signals: Signals) -> tuple[list[int], tuple[Signals, ...]]:
    """Return the numbers, from 1, and the runs whose force is known: that of an overloaded hit is not."""
    forces = signals.by_run()[1]
    assert forces is not None
    hits = find_hits(forces[:, :, 0]) if find_excitation(signals) == "impact" else []
    unfit, runs = {hit.run for hit in hits if hit.unfit}, Records(runs=(signals,)).runs
    numbers = [k for k in range(len(runs)) if k not in unfit]
    return [k + 1 for k in numbers], tuple(runs[k] for k in numbers)


def _changed_channels(signals: Signals) -> tuple[list[Finding], Signals]:
    """Return outputs of runs that are turned or exchanged against the median of the other runs, and the record with these as the others.

    They are compared by their real correlations.
    """
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
    findings, dofs, restored = [], signals.output_dofs, outputs.copy()
    for r in range(signals.runs):
        others = np.delete(shape, r, axis=0)
        usual = np.median(others.real, axis=0) + 1j * np.median(others.imag, axis=0)
        # [i, j]: the usual response of output i with output j of this run
        likeness = (usual.conj().T @ shape[r]).real / np.maximum(np.linalg.norm(usual, axis=0), tiny)[:, None]
        same = np.diag(likeness)
        for i, dof in enumerate(dofs):
            if same[i] < -_MIN_LIKENESS:
                findings.append(finding("polarity: run", dof, run=r + 1))
                restored[r, :, i] *= -1
        pairs = [
            (min(likeness[i, j], likeness[j, i]) / max(same[i], same[j], _MIN_LIKENESS / _MIN_EXCHANGE_RATIO), j, i)
            for i in range(len(dofs))
            for j in range(i)
            if min(likeness[i, j], likeness[j, i]) > max(_MIN_LIKENESS, same[i], same[j])
        ]
        findings += [
            finding("swapped: run", dofs[j], dofs[i], run=r + 1) for ratio, j, i in pairs if ratio > _MIN_EXCHANGE_RATIO
        ]
        if pairs:
            _, j, i = max(pairs)
            restored[r][:, [i, j]] = restored[r][:, [j, i]]
    return findings, replace(signals, outputs=restored)
