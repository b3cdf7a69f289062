"""Pair the modes of two sets by frequency and MAC, and compute their differences and COMAC."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.indicators import mac
from modalscope.data.modes import ModalModel
from modalscope.data.sameness import likeliest, log_ratios
from modalscope.numerics.arguments import POSITIVE, named
from modalscope.numerics.checks import IntArray, RealArray, complex_array
from modalscope.numerics.errors import DataError

#: Mean of 1 - MAC of a mode of two structures, or of a structure and its model: shapes above .9 are taken for correlated
#: (D. J. Ewins, "Modal Testing", 2000, section 7.2).
_MISFIT = 0.1


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Pairs:
    """Modes of two sets that belong together; `a` and `b` are cut to the outputs that both have.

    `first`, `second` (p,): the modes of each pair, counted from zero. `mac` (p,): modal assurance criterion of each pair.
    """

    a: ModalModel
    b: ModalModel
    first: IntArray
    second: IntArray
    mac: RealArray

    @property
    def frequency_change(self) -> RealArray:
        """f_b / f_a - 1 of each pair."""
        return self.b.frequencies[self.second] / self.a.frequencies[self.first] - 1

    @property
    def deviations(self) -> dict[str, RealArray]:
        """Differences in standard deviations of the difference, of "frequency" and "damping_ratio"; NaN where none is known."""
        fields = {"frequency": "frequencies", "damping_ratio": "damping_ratios"}
        return {name: _in_deviations(self, field) for name, field in fields.items()}

    @property
    def alone(self) -> tuple[IntArray, IntArray]:
        """Modes of the first and of the second set that have no partner."""
        first, second = np.arange(len(self.a)), np.arange(len(self.b))
        return np.setdiff1d(first, self.first), np.setdiff1d(second, self.second)

    @property
    def comac(self) -> RealArray:
        """Coordinate modal assurance criterion of every common output over the pairs; see `comac`."""
        return comac(self.a.shapes[:, self.first], self.b.shapes[:, self.second])

    def table(self) -> str:
        """Return the pairs, the modes without a partner, and the outputs where shapes agree least, as text."""
        lines = ["  a    b      f_a [Hz]      f_b [Hz]    df [%]  zeta_a [%]  zeta_b [%]    MAC   df/sd  dz/sd"]
        away = self.deviations
        for k, (i, j) in enumerate(zip(self.first, self.second, strict=True)):
            fa, fb = self.a.frequencies[i], self.b.frequencies[j]
            za, zb = 100 * self.a.damping_ratios[i], 100 * self.b.damping_ratios[j]
            sd = [
                f"{away[name][k]:.1f}" if np.isfinite(away[name][k]) else "-" for name in ("frequency", "damping_ratio")
            ]
            lines.append(
                f"{i + 1:3d}  {j + 1:3d}  {fa:12.4f}  {fb:12.4f}  {100 * self.frequency_change[k]:8.3f}  {za:10.3f}  {zb:10.3f}"
                f"  {self.mac[k]:5.3f}  {sd[0]:>6}  {sd[1]:>5}"
            )
        for name, modes, left in zip(("a", "b"), (self.a, self.b), self.alone, strict=True):
            lines += [
                f"only in {name}: mode {i + 1}, {modes.frequencies[i]:.4f} Hz, {100 * modes.damping_ratios[i]:.3f} %"
                for i in left
            ]
        if len(self.first):
            worst = int(np.argmin(self.comac))
            lines.append(f"COMAC: least at {self.a.output_dofs[worst]}, {self.comac[worst]:.3f}")
        return "\n".join(lines)


@named(a=ModalModel, b=ModalModel, tolerance=POSITIVE)
def pair_modes(a: ModalModel, b: ModalModel, *, tolerance: float = 0.1) -> Pairs:
    """Pair the modes of two sets that are the same, each at most once (see `same_mode`); the structure may have changed.

    A change of frequencies by the tolerance is two standard deviations; what is further apart makes no pair. Shapes count on the outputs
    that both sets have.

    Parameters
    ----------
    a, b : ModalModel
    tolerance : float
        Largest relative distance of two frequencies.

    Returns
    -------
    Pairs
        In the order of the first set.

    Raises
    ------
    DataError
        No output that both sets have.

    Examples
    --------
    >>> a = ModalModel(poles=[-1 + 100j, -1 + 200j], shapes=[[1.0, 1.0], [1.0, -1.0]])
    >>> b = ModalModel(poles=[-1 + 201j, -1 + 300j], shapes=[[1.0, 1.0], [-1.0, 2.0]])
    >>> found = pair_modes(a, b)
    >>> found.first.tolist(), found.second.tolist(), found.mac.round(6).tolist()
    ([1], [0], [1.0])
    """
    common = [dof for dof in a.output_dofs if dof in set(b.output_dofs)]
    if not common:
        raise DataError(
            "modes of two sets were to be paired",
            f"they have no output in common: {', '.join(a.output_dofs[:4])} and {', '.join(b.output_dofs[:4])}",
            "Give both sets the same labels for the same places.",
        )
    a, b = (modes if list(modes.output_dofs) == common else modes.select(outputs=common) for modes in (a, b))
    apart = np.abs(b.frequencies / a.frequencies[:, None] - 1)
    first, second = likeliest(np.where(apart <= tolerance, log_ratios(a, b, tolerance / 2, _MISFIT), -np.inf))
    like = mac(a.shapes, b.shapes)[first, second] if first.size else np.zeros(0)
    return Pairs(a=a, b=b, first=first, second=second, mac=like)


@named()
def comac(shapes_a: ArrayLike, shapes_b: ArrayLike) -> RealArray:
    """Coordinate modal assurance criterion (sum_r |a_ir b_ir*|)^2 / (sum_r |a_ir|^2 sum_r |b_ir|^2) of every output i over paired modes r.

    Shapes are brought to unit length first, so that every mode counts alike.

    Parameters
    ----------
    shapes_a, shapes_b : array, (l, p)
        Shapes of paired modes in the same order.

    Returns
    -------
    array, (l,)
        1 where an output moves alike in every pair; 0 for one that stands still in one set.

    Raises
    ------
    DataError
        Other outputs or modes in one set than in the other.

    References
    ----------
    Lieven and Ewins, "Spatial correlation of mode shapes, the coordinate modal assurance criterion (COMAC)", IMAC VI, 1988.
    """
    a = complex_array("shapes_a", shapes_a, "outputs, modes", 2)
    b = complex_array("shapes_b", shapes_b, "outputs, modes", 2)
    if a.shape != b.shape:
        raise DataError(
            "COMAC needs paired modes", f"the shapes are {a.shape} and {b.shape}", "Pair them first: pair_modes."
        )
    a, b = (x / np.maximum(np.linalg.norm(x, axis=0), 1e-300) for x in (a, b))
    both = np.sum(np.abs(a * np.conj(b)), axis=1) ** 2
    each = np.sum(np.abs(a) ** 2, axis=1) * np.sum(np.abs(b) ** 2, axis=1)
    return np.asarray(np.divide(both, each, out=np.zeros_like(both), where=each > 0))


def _in_deviations(pairs: Pairs, field: str) -> RealArray:
    """Return differences over the root of the sum of both variances, the wider deviation of each."""
    variance = np.zeros(len(pairs.first))
    for modes, which in ((pairs.a, pairs.first), (pairs.b, pairs.second)):
        known = [np.full(len(modes), np.nan)]
        known += [x for end in ("std", "repeatability") if (x := getattr(modes, f"{field}_{end}")) is not None]
        variance += np.fmax.reduce(known)[which] ** 2
    difference = getattr(pairs.b, field)[pairs.second] - getattr(pairs.a, field)[pairs.first]
    return np.asarray(difference / np.sqrt(variance))
