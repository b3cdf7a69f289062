"""What a pole contributes to the measured responses: its size in all, and at its own frequency.

The residue of a pole is R = phi l', of norm |phi| |l|; outputs are divided by their root mean square, so that quiet ones count, too.
Poles are given as modes have them. In the data an exponential window's damping is still in them, and what was R at the impulse is
R exp(s t_0) at the first sample there is.
"""

from __future__ import annotations

import numpy as np

from modalscope.data.response import Response, output_scale
from modalscope.data.results import StabilizationDiagram
from modalscope.numerics.checks import Array, RealArray

__all__ = ["contributions", "of_diagram", "peak_sizes"]


def contributions(response: Response, poles: Array, shapes: Array, participation: Array) -> RealArray:
    """Return norm(the pole's own term) / norm(measured) of every pole, without building the terms.

    On lines the integral of |R / (j w - s)|^2 over w is pi |R|^2 / |Re s|, lines lying `step` apart in w. The sum over samples of
    |2 Re R exp(s t)|^2 is about |R|^2 fs / |Re s|, over no more than the samples there are.

    `poles` (p,): rad/s, with a window's damping taken off. `shapes` (p, l). `participation` (p, m): referred to the impulse itself.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> modes = chain5().modes()
    >>> response = modes.take([0]).impulse_response(2000, 20.0)
    >>> part = contributions(response, modes.poles[:1], modes.shapes.T[:1], modes.participation[:1])
    >>> bool(abs(part[0] - 1) < 0.1)
    True
    """
    size, decay = _in_the_data(response, poles, shapes, participation)
    total = np.linalg.norm(response.values / output_scale(response)[:, None])
    return np.asarray(size * np.sqrt(response.energy(decay)) / total)


def of_diagram(diagram: StabilizationDiagram) -> RealArray:
    """Return the contributions of all poles of a diagram to its response, (p,)."""
    return contributions(diagram.response, diagram.poles, diagram.shapes.T, diagram.participation)


def peak_sizes(response: Response, poles: Array, shapes: Array, participation: Array) -> RealArray:
    """Return |R| / |Re s| of every pole: the size of its own term at its frequency, outputs brought level; see `contributions`."""
    size, decay = _in_the_data(response, poles, shapes, participation)
    return size / decay


def _in_the_data(response: Response, poles: Array, shapes: Array, participation: Array) -> tuple[RealArray, RealArray]:
    """Return of every pole |R exp(s t_0)|, outputs brought level, and |Re s|, s as the data have it: with a window's damping."""
    own = poles - response.added_damping
    t0 = response.steps_late / (response.sampling_rate or 1.0)
    driven = response.driven(own, participation)
    size = np.linalg.norm(shapes / output_scale(response), axis=1) * driven * np.exp(own.real * t0)
    return size, np.maximum(np.abs(own.real), 1e-12 * np.abs(own))
