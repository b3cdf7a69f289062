"""Scores: which modes of a list are right, and what that makes of many lists, with intervals.

A reported mode and a known one are the same where their frequencies differ by no more than the half-power half-bandwidth of the
known one (or what its set says in its place) and, where both have shapes, the MAC exceeds .8. One rule for all: no list is paired
by what it claims of itself. The pairs are those of the largest number with the smallest distance, one to one. What stays is `twice`
where a known mode would fit, else `false` in a set whose modes are all known, and `other` in a set where they are not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from statistics import median
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from arena.sets import Reference

__all__ = ["judged", "share", "totals", "wilson"]

Told = dict[str, Any]

#: The least MAC of a mode with itself.
_ALIKE = 0.8

#: Known frequencies that differ by less, relative, are one repeated mode.
_REPEATED = 1e-6

#: Damping that is off by more than this part, and outside an interval that the program gives, is wrong.
_DAMPING = 0.5

#: Draws of the bootstrap over sets.
_DRAWS = 2000

#: 95 %.
_Z = 1.959964


def rounded(x: Any, digits: int = 6) -> float | None:
    """Return a number to some digits, None where it is none."""
    return None if x is None or not math.isfinite(x) else float(f"{x:.{digits}g}")


def _mac(found: np.ndarray, reference: Reference) -> np.ndarray:
    """Return the MAC of shapes (l, n) with the known ones: of a repeated mode, with the nearest shape that its pair allows."""
    told = np.zeros((found.shape[1], reference.frequencies.size))
    for k, f in enumerate(reference.frequencies):
        q = np.linalg.qr(reference.shapes[:, abs(reference.frequencies - f) < _REPEATED * f])[0]
        told[:, k] = np.sum(abs(q.conj().T @ found) ** 2, axis=0)
    return told / np.maximum(np.sum(abs(found) ** 2, axis=0), 1e-300)[:, None]


def judged(reference: Reference, labels: Sequence[str], band: tuple[float, float] | None, run: Told) -> Told:
    """Return a run with the verdict on every mode and their counts.

    Parameters
    ----------
    reference : Reference
    labels : sequence of str
        Names of the rows of the known shapes.
    band : (float, float), optional
        Hz: modes beyond it do not count, for nobody.
    run : dict
        What `child.py` wrote.
    """
    if run["status"] != "done":
        return {name: run[name] for name in ("status", "text", "human") if name in run}
    f = np.array(run["frequencies"], float)
    order = [i for i in np.argsort(f, kind="stable") if band is None or band[0] <= f[i] <= band[1]]
    shapes = _shapes(run, order, labels)
    far = abs(f[order, None] - reference.frequencies) / np.maximum(reference.reach, 1e-300)
    fits, mac = far <= 1, np.full(far.shape, np.nan)
    if reference.shapes is not None and shapes is not None and shapes.shape[0] == reference.shapes.shape[0] > 1:
        mac = _mac(shapes, reference)
        fits &= mac > _ALIKE
    rows, columns = linear_sum_assignment(np.where(fits, far - 10, 0))
    pairs = {i: k for i, k in zip(rows, columns, strict=True) if fits[i, k]}
    modes = []
    for row, i in enumerate(order):
        told = _said(run, i)
        if (k := pairs.get(row)) is None:
            told["is"] = "twice" if fits[row].any() else "false" if reference.complete else "other"
            told["wrong"] = told["is"] != "other"
        else:
            zeta = math.nan if run["damping_ratios"][i] is None else run["damping_ratios"][i]
            told |= _found(told, f[i], zeta, mac[row, k], reference, k)
        modes.append(told)
    told = {"status": "done", "human": run["human"], "versions": run.get("versions", []), "modes": modes}
    return told | {"missed": [rounded(x) for k, x in enumerate(reference.frequencies) if k not in pairs.values()]}


def _shapes(run: Told, order: list[int], labels: Sequence[str]) -> np.ndarray | None:
    """Return the shapes of a run (l, n) on the rows of the known ones, where it has any; NaN as zero."""
    if not run.get("shapes_real"):
        return None
    parts = [np.array(run[name], float).reshape(len(run["frequencies"]), -1) for name in ("shapes_real", "shapes_imag")]
    found = np.nan_to_num(parts[0] + 1j * parts[1])[order].T
    own = run.get("labels")
    if own is not None and list(own) != list(labels) and set(labels) <= set(own):
        found = found[[own.index(label) for label in labels]]
    return found


def _said(run: Told, i: int) -> Told:
    """Return what a program says of one mode."""
    told = {"f": rounded(run["frequencies"][i]), "zeta": rounded(run["damping_ratios"][i])}
    for name, key in (("frequency_interval", "f_ends"), ("damping_interval", "zeta_ends")):
        if name in run and None not in (ends := run[name][i]):
            told[key] = [rounded(x) for x in ends]
    return told | {"marked": bool(run["marked"][i]) if "marked" in run else False}


def _found(told: Told, f: float, zeta: float, mac: float, reference: Reference, k: int) -> Told:
    """Return how far a mode is off the known one k, and whether its intervals hold that."""
    known = {"f": reference.frequencies[k], "zeta": reference.damping[k]}
    tolerance, off = reference.tolerance[k], abs(f - known["f"])
    found = {"is": "found", "known": rounded(known["f"]), "f_error": rounded(off / reference.reach[k], 4)}
    if math.isfinite(tolerance):
        found["f_within"] = bool(off <= tolerance)
    errors = {"zeta_error": abs(zeta / known["zeta"] - 1), "shape_error": max(1 - mac, 0.0)}
    found |= {name: rounded(error, 4) for name, error in errors.items() if math.isfinite(error)}
    for key in ("f", "zeta"):
        if (
            f"{key}_ends" in told
            and math.isfinite(known[key])
            and reference.kind == "exact"
            and "f_within" not in found
        ):
            low, high = told[f"{key}_ends"]
            found[f"{key}_held"] = bool(low <= known[key] <= high)
    return found | {"wrong": found.get("zeta_error", 0.0) > _DAMPING and not found.get("zeta_held", False)}


def over_bound(about: Told, mode: Told) -> list[float | None]:
    """Return errors of frequency, damping and 1 - MAC of a mode that was found over the bound in the entry of its set; None without one.

    Where modes are known exactly an error of one in frequency is the half bandwidth, zeta f.
    """
    if not about.get("bound"):
        return [None] * 3
    k = about["known"].index(mode["known"])
    f, zeta, bound = (about[name][k] for name in ("known", "known_damping", "bound"))
    units = zip(("f_error", "zeta_error", "shape_error"), (f * zeta, zeta, 1.0), bound, strict=True)
    return [None if least is None or key not in mode else mode[key] * unit / least for key, unit, least in units]


def wilson(hits: int, count: int) -> list[float] | None:
    """Return the 95 % interval of a share by Wilson's score, None of none.

    (p + z^2 / 2n -+ z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n).
    """
    if not count:
        return None
    p, w = hits / count, _Z**2 / count
    half = _Z * math.sqrt(p * (1 - p) / count + w / (4 * count))
    return [rounded(max((p + w / 2 + sign * half) / (1 + w), 0.0), 4) for sign in (-1, 1)]


def share(hits: Sequence[int], counts: Sequence[int]) -> list[float] | None:
    """Return the 95 % interval of sum(hits) / sum(counts) by the bootstrap over sets, with draws that are the same every time."""
    if not sum(counts):
        return None
    rng = np.random.default_rng(69)
    drawn = rng.integers(0, len(counts), (_DRAWS, len(counts)))
    a, n = np.array(hits)[drawn].sum(axis=1), np.array(counts)[drawn].sum(axis=1)
    return [rounded(x, 4) for x in np.quantile(a[n > 0] / n[n > 0], (0.025, 0.975))]


def totals(results: Iterable[tuple[Told, Told]]) -> Told:
    """Return the scores of one program over sets: pairs of a set's entry (`known`, `complete`) and of its run as `judged` returns it.

    A program that fails, or takes more than the limits, misses all modes of the set.
    """
    given = [(about, run) for about, run in results if run["status"] != "cannot"]
    modes = [mode for _, run in given for mode in run.get("modes", [])]
    counts = [len(about["known"]) for about, _ in given]
    found = [len(about["known"]) - len(run.get("missed", about["known"])) for about, run in given]
    told: Told = {"sets": len(given), "modes": sum(counts), "found": sum(found), "found_interval": share(found, counts)}
    told |= {"missed": sum(counts) - sum(found), "failed": sum(run["status"] != "done" for _, run in given)}
    told |= {name: sum(mode["is"] == name for mode in modes) for name in ("false", "twice")}
    told["wrong_without_a_word"] = sum(mode["wrong"] and not mode["marked"] for mode in modes)
    told["reported"] = sum(mode["is"] != "other" for mode in modes)
    told |= {key: _middle(mode.get(key) for mode in modes) for key in ("f_error", "zeta_error", "shape_error")}
    over = [over_bound(about, mode) for about, run in given for mode in run.get("modes", []) if mode["is"] == "found"]
    told["over_bound"] = [_middle(each[j] for each in over) for j in range(3)]
    within = [mode["f_within"] for mode in modes if "f_within" in mode]
    told["f_within"] = [sum(within), len(within)]
    for key in ("f", "zeta"):
        tried = [mode for mode in modes if f"{key}_held" in mode]
        held = [sum(mode[f"{key}_held"] for mode in tried), len(tried)]
        told |= {f"{key}_held": held, f"{key}_coverage": wilson(*held)}
        ends = ((mode[f"{key}_ends"], mode[key]) for mode in tried)
        told[f"{key}_half_width"] = _middle((high - low) / 2 / value for (low, high), value in ends)
    return told | {"human": sum(run.get("human", 0) for _, run in given)}


def _middle(values: Iterable[float | None]) -> float | None:
    """Return the median of what there is, None of nothing."""
    there = [x for x in values if x is not None and math.isfinite(x)]
    return rounded(median(there), 3) if there else None
