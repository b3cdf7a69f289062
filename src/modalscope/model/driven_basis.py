"""What poles can contribute to records: driven by measured inputs, and set going by what each run found at its ends.

With c_j the shape of a pole, l_j what drives it and d = [U; ends] the drives of a run, Y = sum_j c_j (l_j' d) / (x - s_j) + conj + D U.
Every drive of every pole is two real columns, the same for all outputs; the shapes tie their coefficients together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.modal_basis import ModalBasis

__all__ = ["DrivenBasis", "Run", "driven_basis"]

#: Lines that are turned into columns at a time.
_CHUNK = 16_384


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """The lines of one run.

    Parameters
    ----------
    points : array of complex, (F,)
        Where they lie in the plane of the poles.
    outputs : array of complex, (F, l)
    inputs : array of complex, (F, m)
    ends : array of complex, (F,)
        What the first and the last state of the run act through: x in the z-plane, 1 in the s-plane.
    """

    points: ComplexArray
    outputs: ComplexArray
    inputs: ComplexArray
    ends: ComplexArray


@dataclass(frozen=True, eq=False, slots=True)
class DrivenBasis(ModalBasis):
    """Real columns of the direct terms and of every pole under every drive, on as many rows as they need.

    The rows are compressed when it is made: the norm of what is left of the data is that on all lines.

    Parameters
    ----------
    terms : array, (K, m)
        The inputs, which every output has for itself: D.
    functions : array, (K, 2 n (m + R))
        The two functions of every pole, drive by drive: inputs first, then the ends of every run.
    data : array, (K, l, 1)
    drives : int
        m + R.
    """

    drives: int = 1

    @property
    def by_drive(self) -> RealArray:
        """The functions (K, m + R, 2 n)."""
        return self.functions.reshape(len(self.functions), self.drives, self.functions.shape[1] // self.drives)

    @property
    def reach(self) -> RealArray:
        """Root mean square over the drives of the norm of each pole's functions, (n,)."""
        each = self.by_drive.reshape(len(self.functions), self.drives, -1, 2)
        return np.asarray(np.sqrt(np.sum(each**2, axis=(0, 1, 3)) / self.drives))

    @property
    def by_pole(self) -> RealArray:
        """The functions of each pole under all drives, (K, n, 2 (m + R))."""
        each = self.by_drive.reshape(len(self.functions), self.drives, -1, 2).transpose(0, 2, 1, 3)
        return np.ascontiguousarray(each).reshape(len(each), each.shape[1], 2 * self.drives)

    def compressed(self) -> DrivenBasis:
        """Return the basis itself: it is compressed already."""
        return self

    def fit_participation(self, shapes: Array) -> tuple[ComplexArray, RealArray]:
        """Fit what drives each pole to known shapes, with D of every output, by least squares over all rows.

        Parameters
        ----------
        shapes : array of complex, (l, n)

        Returns
        -------
        participation : array of complex, (n, m + R)
            Of the inputs, then of the ends of every run.
        terms : array, (1, l, m)
            D.
        """
        t, outputs = self.terms.shape[1], self.data.shape[1]
        R = np.asarray(
            np.linalg.qr(np.hstack([self.terms, self.functions, self.data[:, :, 0]]), mode="r"), dtype=np.float64
        )
        width = t + self.functions.shape[1]
        lower = R[t:, t:width].reshape(len(R) - t, self.drives, -1)
        known = np.concatenate([_tied(lower, shapes[o]) for o in range(outputs)])
        theta = _least(known, R[t:, width:].T.reshape(-1, 1))[:, 0]
        rest = np.stack([_tied(R[:t, t:width].reshape(t, self.drives, -1), c) @ theta for c in shapes], axis=1)
        direct = np.linalg.lstsq(R[:t, :t], R[:t, width:] - rest, rcond=None)[0]
        return _complex(theta, self.drives), np.asarray(direct.T[None], dtype=np.float64)

    def fit_shapes(self, participation: Array) -> tuple[ComplexArray, RealArray]:
        """Fit shapes to known participation of all drives: shapes (l, n) and D (1, l, m)."""
        n, t = self.functions.shape[1] // (2 * self.drives), self.terms.shape[1]
        each = self.by_drive.reshape(len(self.functions), self.drives, n, 2)
        turned = np.einsum("kdj,jd->kj", each[..., 0] - 1j * each[..., 1], participation)
        columns = np.hstack([self.terms, np.stack([turned.real, -turned.imag], axis=2).reshape(len(turned), -1)])
        found = _least(columns, self.data[:, :, 0])
        return np.asarray((found[t::2] + 1j * found[t + 1 :: 2]).T), found[:t].T[None]

    def fit_ends(self, shapes: Array, participation: Array, terms: Array) -> ComplexArray:
        """Fit what the ends of the runs give to each pole, (n, R), the rest being known: participation (n, m) of the inputs."""
        inputs = participation.shape[1]
        forced = self._sum(self.by_drive[:, :inputs], shapes, participation) + self.terms @ terms[0].T
        free = self.by_drive[:, inputs:]
        R = _factor(np.hstack([free.reshape(len(free), -1), self.data[:, :, 0] - forced]))
        width = free.shape[1] * free.shape[2]
        known = np.concatenate([_tied(R[:, :width].reshape(len(R), free.shape[1], -1), c) for c in shapes])
        return _complex(_least(known, R[:, width:].T.reshape(-1, 1))[:, 0], free.shape[1])

    def of_terms(self, coefficients: RealArray) -> RealArray:
        """Return coefficients (m, l) of the inputs as D, (1, l, m)."""
        return np.ascontiguousarray(coefficients.T)[None]

    def rebuilt(self, shapes: Array, participation: Array, terms: Array) -> RealArray:
        """Return what shapes, participation and D give, in the rows of the data; ends that are not given are fitted."""
        if participation.shape[1] < self.drives:
            ends = self.fit_ends(shapes, participation, terms)
            participation = np.hstack([participation, ends])
        forced = self._sum(self.by_drive, shapes, participation)
        return np.asarray((forced + self.terms @ np.asarray(terms)[0].T)[:, :, None])

    @staticmethod
    def _sum(functions: RealArray, shapes: Array, participation: Array) -> RealArray:
        """Return sum_j c_j (l_j' d) g_j of every output, (K, l)."""
        each = functions.reshape(*functions.shape[:2], -1, 2)
        of_pole = np.einsum("kdj,jd->kj", each[..., 0] - 1j * each[..., 1], participation)
        return np.asarray((of_pole @ np.asarray(shapes).T).real)


def driven_basis(runs: Sequence[Run], poles: Array) -> DrivenBasis:
    """Return the columns that poles give on the lines of some runs.

    Parameters
    ----------
    runs : sequence of Run
        Of the same outputs and inputs.
    poles : array of complex, (n,)
        In the plane of the points; one of each pair, and real ones.
    """
    parts = [_triangle(run, poles) for run in runs]
    inputs, n, total = runs[0].inputs.shape[1], len(poles), len(runs)
    rows = np.cumsum([0, *(len(part) for part in parts)])
    functions = np.zeros((rows[-1], inputs + total, 2 * n))
    for r, part in enumerate(parts):
        own = part[:, inputs : inputs + 2 * n * (inputs + 1)].reshape(len(part), inputs + 1, 2 * n)
        functions[rows[r] : rows[r + 1], :inputs] = own[:, :inputs]
        functions[rows[r] : rows[r + 1], inputs + r] = own[:, inputs]
    stacked = np.vstack(parts)
    outputs = runs[0].outputs.shape[1]
    return DrivenBasis(
        terms=stacked[:, :inputs],
        functions=functions.reshape(rows[-1], -1),
        data=stacked[:, stacked.shape[1] - outputs :, None],
        drives=inputs + total,
    )


def _triangle(run: Run, poles: Array) -> RealArray:
    """Return the triangular factor of [U, functions of every pole under every drive, Y] over the lines of a run, in pieces."""
    R: RealArray = np.zeros((0, 0))
    for start in range(0, max(len(run.points), 1), _CHUNK):
        s = slice(start, start + _CHUNK)
        x, U = run.points[s, None], run.inputs[s]
        own, pair = 1 / (x - poles), 1 / (x - np.conj(poles))
        alone = np.asarray(poles).imag == 0
        g = np.stack([np.where(alone, own, own + pair), np.where(alone, 0, 1j * (own - pair))], axis=2)
        drives = np.hstack([U, run.ends[s, None]])
        driven = (drives[:, :, None] * g.reshape(len(x), 1, -1)).reshape(len(x), -1)
        columns = np.hstack([U, driven, run.outputs[s]])
        stacked = np.vstack([columns.real, columns.imag])
        stacked = np.vstack([R, stacked]) if R.size else stacked
        R = _factor(stacked)
    return R


def _tied(functions: RealArray, shape: Array) -> RealArray:
    """Return the columns (K, d 2 n) of Re l and Im l of every drive in an output where the poles have this shape (n,).

    With c l = a + j b a pole gives a g1 + b g2, that is Re(c l (g1 - j g2)).
    """
    rows, drives, width = functions.shape
    each = functions.reshape(rows, drives, width // 2, 2)
    turned = (each[..., 0] - 1j * each[..., 1]) * shape
    return np.stack([turned.real, -turned.imag], axis=3).reshape(rows, -1)


def _complex(theta: Array, drives: int) -> ComplexArray:
    """Return (n, drives) from real and imaginary parts that run drive by drive."""
    pairs = theta.reshape(drives, -1, 2)
    return np.asarray((pairs[..., 0] + 1j * pairs[..., 1]).T)


def _least(known: RealArray, target: RealArray) -> RealArray:
    """Least squares of smallest norm, columns scaled to length one; the rows are compressed first."""
    count = known.shape[1]
    if not count:
        return np.zeros((0, target.shape[1]))
    scale = np.linalg.norm(known, axis=0)
    scale = np.where(scale > 0, scale, 1)
    both = np.hstack([known / scale, target])
    R = _factor(both)
    return np.asarray(np.linalg.lstsq(R[:, :count], R[:, count:], rcond=None)[0] / scale[:, None])


def _factor(columns: RealArray) -> RealArray:
    """Return the triangular factor of columns; the columns themselves where they are wide."""
    if len(columns) <= columns.shape[1]:
        return columns
    return np.asarray(np.linalg.qr(columns, mode="r"), dtype=np.float64)
