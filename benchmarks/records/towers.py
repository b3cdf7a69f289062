"""A tower of eleven known modes, measured in setups: two sensors at its top stay, two others rove over its storeys."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter, ss2tf

from modalscope.data import ModalModel, Signals
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.functions.poles import poles_from

#: Storeys, each with a place in x and one in y.
STOREYS = 16


class Tower(NamedTuple):
    """Its modes, shapes real, and a record of every setup."""

    modes: ModalModel
    setups: list[Signals]


def tower(seed: int, *, rate: float = 12.0, minutes: float = 15.0, setups: int = 15, noise: float = 0.05) -> Tower:
    """Return four bending modes in x, four in y and three of torsion: .33 to 4.4 Hz, .6 to 1.5 %; forces differ."""
    rng = np.random.default_rng(seed)
    f, shapes = _shapes(rng)
    order = np.argsort(f)
    f, shapes, zeta = f[order], shapes[:, order], rng.uniform(0.006, 0.015, f.size)
    labels = [f"{k + 1}:+{axis}" for axis in "XY" for k in range(STOREYS)]
    tops = [STOREYS - 1, 2 * STOREYS - 1]
    roving = [k for k in range(len(labels)) if k not in tops]
    filters = [_filter(w, z, rate) for w, z in zip(2 * np.pi * f, zeta, strict=True)]
    settle, count = int(200 * rate), int(60 * minutes * rate)
    records = []
    for j in range(setups):
        rows = tops + roving[2 * j : 2 * j + 2]
        forces = rng.standard_normal((count + settle, len(labels))) * rng.uniform(0.5, 2, len(labels))
        q = np.column_stack([lfilter(b, a, x) for (b, a), x in zip(filters, (forces @ shapes).T, strict=True)])
        y = rng.uniform(0.3, 3) * q[settle:] @ shapes[rows].T
        y += noise * y.std(axis=0) * rng.standard_normal(y.shape)
        named = [labels[k] for k in rows]
        records.append(Signals(outputs=y, sampling_rate=rate, output_dofs=named, quantities="acceleration"))
    return Tower(ModalModel(poles=poles_from(f, zeta), shapes=shapes, output_dofs=labels), records)


def _shapes(rng: np.random.Generator) -> tuple[RealArray, RealArray]:
    z = np.arange(1, STOREYS + 1) / STOREYS
    f, shapes = [], []
    for b, ratio in zip((1.8751, 4.6941, 7.8548, 10.9955), (1, 3.2, 6.9, 10.6), strict=True):  # of a cantilever
        s = (np.sinh(b) - np.sin(b)) / (np.cosh(b) + np.cos(b))
        bent = (np.cosh(b * z) - np.cos(b * z) - s * (np.sinh(b * z) - np.sin(b * z))) / 2
        across = rng.normal(scale=0.1)
        shapes += [np.r_[bent, across * bent], np.r_[-across * bent, bent]]
        f += [0.33 * ratio, 0.41 * ratio]
    for n in range(3):
        twisted = np.sin((2 * n + 1) * np.pi / 2 * z)
        shapes.append(np.r_[rng.uniform(0.3, 0.8) * twisted, 0.9 * twisted])
        f.append(0.6 * (2 * n + 1))
    return np.array(f) * (1 + 0.02 * rng.normal(size=len(f))), np.array(shapes).T


def _filter(w: float, zeta: float, rate: float) -> tuple[Array, Array]:
    """Return the filter from a held modal force to the modal acceleration."""
    A = np.array([[0, 1], [-(w**2), -2 * zeta * w]])
    both = expm(np.block([[A, np.array([[0.0], [1.0]])], [np.zeros((1, 3))]]) / rate)
    b, a = ss2tf(both[:2, :2], both[:2, 2:], A[1:], np.ones((1, 1)))
    return b[0], a
