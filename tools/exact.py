"""A second way to what pages of the documentation print: simulated structures from their matrices alone, peaks of measured spectra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.linalg as sla

from modalscope import systems
from modalscope.numerics.checks import RealArray

__all__ = [
    "collinearity",
    "damping",
    "hit_peaks",
    "least_damping",
    "receptance",
    "six_masses",
    "softened",
    "stiffness_over_mass",
    "storeys",
    "unit_mass",
]


def _undamped(structure: systems.Structure) -> tuple[RealArray, RealArray]:
    """Return the frequencies of K phi = w^2 M phi, Hz, and the shapes, phi^T M phi = 1, as columns."""
    squares, shapes = sla.eigh(structure.stiffness, structure.mass)
    return np.sqrt(squares) / (2 * np.pi), shapes


def _complex(structure: systems.Structure) -> tuple[RealArray, RealArray]:
    """Return the poles of the positive half plane and their shapes at the outputs, by frequency."""
    M, n = structure.mass, len(structure.mass)
    below = -np.linalg.solve(M, np.hstack([structure.stiffness, structure.damping]))
    poles, vectors = np.linalg.eig(np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), below]))
    kept = np.flatnonzero(poles.imag > 0)
    kept = kept[np.argsort(np.abs(poles[kept]))]
    return poles[kept], vectors[[structure.dofs.index(dof) for dof in structure.modes().output_dofs]][:, kept]


def storeys() -> RealArray:
    """Return sqrt(k / m) / pi sin((2 j - 1) pi / 22): five storeys, fixed below and free above, Hz."""
    return np.asarray(np.sqrt(3e8 / 2e5) / np.pi * np.sin((2 * np.arange(1, 6) - 1) * np.pi / 22))


def six_masses() -> RealArray:
    """Return the frequencies of six masses in a row, Hz."""
    return _undamped(systems.spring_chain(6))[0]


def unit_mass() -> RealArray:
    """Return the three amplitudes of which all shapes of three masses in a row are made, at unit modal mass."""
    return np.abs(_undamped(systems.spring_chain(3))[1][:, 0])


def stiffness_over_mass() -> RealArray:
    """Return the diagonal of M^-1 K of three masses."""
    structure = systems.three_masses()
    return np.diag(np.linalg.solve(structure.mass, structure.stiffness))


def damping() -> RealArray:
    """Return the damping ratios of five masses."""
    poles, _ = _complex(systems.chain5())
    return np.asarray(-poles.real / np.abs(poles))


def least_damping() -> RealArray:
    """Return the least of them."""
    return np.asarray([np.min(damping())])


def collinearity() -> RealArray:
    """Return ((Sxx - Syy)^2 + 4 Sxy^2) / (Sxx + Syy)^2 of the shapes of five masses, real parts x and imaginary parts y."""
    _, shapes = _complex(systems.chain5())
    x, y = np.sum(shapes.real**2, axis=0), np.sum(shapes.imag**2, axis=0)
    both = np.sum(shapes.real * shapes.imag, axis=0)
    return np.asarray(((x - y) ** 2 + 4 * both**2) / (x + y) ** 2)


def receptance() -> RealArray:
    """Return |(K - w^2 M + i w D)^-1| of the fifth mass of five at line 500 of 2000 from .2 to 8 Hz."""
    structure = systems.chain5()
    w = 2 * np.pi * np.linspace(0.2, 8, 2000)[500]
    stiffness = structure.stiffness - w**2 * structure.mass + 1j * w * structure.damping
    return np.abs(np.linalg.inv(stiffness)[[4], [4]])


def hit_peaks() -> RealArray:
    """Return the lines at which |sum Y conj(F)| / sum |F|^2 of the measured hits, whole and without a window, is largest, Hz."""
    held = np.load(Path(__file__).parents[1] / "examples" / "impact_hits" / "impact_hits.npz")
    force, moved = (np.fft.rfft(held[name], axis=1)[:, :, 0] for name in ("inputs", "outputs"))
    height = np.abs(np.sum(moved * force.conj(), axis=0)) / np.sum(np.abs(force) ** 2, axis=0)
    lines = np.fft.rfftfreq(held["inputs"].shape[1], 1 / float(held["sampling_rate"]))
    bands = [(lines >= low) & (lines < high) for low, high in ((400, 500), (500, 650), (650, 800), (800, 900))]
    return np.asarray([lines[band][np.argmax(height[band])] for band in bands])


def softened() -> RealArray:
    """Return by how many per cent the first seven frequencies of the frame change without the braces of its first storey."""
    sound, soft = (_undamped(each)[0] for each in (systems.iasc_asce(), systems.iasc_asce(without_braces=[1])))
    return np.asarray(100 * (soft / sound - 1))[:7]
