"""What changed from one run of a test to another."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import RealArray
from modalscope.model.signals import Signals
from modalscope.preprocess.findings import Finding
from modalscope.preprocess.places import same_places
from modalscope.preprocess.spectra import Segments, cross_spectra, window_samples

__all__ = ["changed_runs"]

#: Outputs of single runs, untouched by averaging, are this much like what they were in the others, or more.
_ALIKE = 0.5


def changed_runs(signals: Signals) -> list[Finding]:
    """Compare the runs of one test: forces elsewhere, an output of other sign than usual, or two that changed places.

    Parameters
    ----------
    signals : Signals
        With inputs.
    """
    if signals.runs < 2 or len(signals.input_dofs) > 1:
        return []
    elsewhere = _elsewhere(signals)
    return elsewhere or (_of_channels(signals) if signals.runs > 2 else [])


def _elsewhere(signals: Signals) -> list[Finding]:
    """Say which runs were driven at other places."""
    places = same_places([signals])
    driven = sorted({place for place in places if place is not None})
    if len(driven) < 2:
        return []
    runs = [", ".join(str(k + 1) for k, own in enumerate(places) if own == place) for place in driven]
    return [
        Finding(
            "places",
            signals.input_dofs,
            f"runs {' | '.join(runs)} are as if driven at {len(runs)} places: alike line by line, as wholes not",
            "Give every place a file, or its own label: input_dofs, --input-dofs.",
        )
    ]


def _of_channels(signals: Signals) -> list[Finding]:
    """Compare every run with what is usual."""
    outputs, inputs = signals.by_run()
    assert inputs is not None
    w = window_samples("hann", signals.samples)
    segments = Segments([0], w, w)
    rows = []
    for y, u in zip(outputs, inputs, strict=True):
        S = cross_spectra(y[None], u[None], signals.sampling_rate, segments)
        rows.append(S.cross[:, :, 0] / np.maximum(np.sqrt(S.inputs[:, 0, 0].real), np.finfo(float).tiny)[:, None])
    shape = np.array(rows)
    shape /= np.maximum(np.linalg.norm(shape, axis=1, keepdims=True), np.finfo(float).tiny)
    found = []
    for r in range(signals.runs):
        usual = np.median(np.delete(shape, r, axis=0).real, axis=0) + 1j * np.median(
            np.delete(shape, r, axis=0).imag, axis=0
        )
        size = np.maximum(np.linalg.norm(usual, axis=0), np.finfo(float).tiny)
        likeness = (usual.conj().T @ shape[r]).real / size[:, None]
        found += _changed(likeness, signals, r)
    return found


def _changed(likeness: RealArray, signals: Signals, run: int) -> list[Finding]:
    """Read off the real correlations (usual output, output of this run) what changed in a run."""
    found, own = [], np.diag(likeness)
    for i, dof in enumerate(signals.output_dofs):
        if own[i] < -_ALIKE:
            found.append(
                Finding(
                    "polarity",
                    (dof,),
                    f"in run {run + 1} it has the opposite sign of the other runs",
                    "Turn its sign in that run, or leave the run out.",
                )
            )
        found += [
            Finding(
                "swapped",
                (signals.output_dofs[j], dof),
                f"in run {run + 1} they have changed places",
                "Exchange them in that run, or leave the run out.",
            )
            for j in range(i)
            if min(likeness[i, j], likeness[j, i]) > max(_ALIKE, 2 * own[i], 2 * own[j])
        ]
    return found
