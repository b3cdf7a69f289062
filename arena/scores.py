"""Scores: which modes of a list are right, and what that makes of many lists, with intervals.

A reported mode and a known one are the same where their frequencies differ by no more than the half-power half-bandwidth of the
known one (or what its set says in its place) and, where both have shapes, the MAC exceeds .8. One rule for all: no list is paired
by what it claims of itself. The pairs are those of the largest number with the smallest distance, one to one. What stays is `twice`
where a known mode would fit, else `false` in a set whose modes are all known, and `other` in a set where they are not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from arena.sets import Reference

__all__ = ["judged", "share", "totals", "wilson"]

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


def judged(
    reference: Reference, labels: Sequence[str], band: tuple[float, float] | None, run: dict[str, Any]
) -> dict[str, Any]:
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
    f, zeta = f[order], np.array([math.nan if x is None else x for x in run["damping_ratios"]], float)[order]
    far = abs(f[:, None] - reference.frequencies) / np.maximum(reference.reach, 1e-300)
    fits = far <= 1
    mac = np.full(far.shape, np.nan)
    if reference.shapes is not None and shapes is not None and shapes.shape[0] == reference.shapes.shape[0] > 1:
        mac = _mac(shapes, reference)
        fits &= mac > _ALIKE
    pairs = {}
    if fits.size:
        rows, columns = linear_sum_assignment(np.where(fits, far - 10, 0))
        pairs = {int(i): int(k) for i, k in zip(rows, columns, strict=True) if fits[i, k]}
    modes = [_mode(i, f, zeta, mac, fits, pairs, reference, run, order) for i in range(len(f))]
    told = {"status": "done", "human": run["human"], "versions": run.get("versions", []), "modes": modes}
    return told | {"missed": [rounded(x) for k, x in enumerate(reference.frequencies) if k not in pairs.values()]}


def _shapes(run: dict[str, Any], order: list[int], labels: Sequence[str]) -> np.ndarray | None:
    """Return the shapes of a run (l, n) on the rows of the known ones, where it has any; NaN as zero."""
    if not run.get("shapes_real"):
        return None
    parts = [np.array(run[name], float).reshape(len(run["frequencies"]), -1) for name in ("shapes_real", "shapes_imag")]
    found = np.nan_to_num(parts[0] + 1j * parts[1])[order].T
    own = run.get("labels")
    if own is not None and list(own) != list(labels) and set(labels) <= set(own):
        found = found[[own.index(label) for label in labels]]
    return found


def _mode(
    i: int,
    f: np.ndarray,
    zeta: np.ndarray,
    mac: np.ndarray,
    fits: np.ndarray,
    pairs: dict[int, int],
    reference: Reference,
    run: dict[str, Any],
    order: list[int],
) -> dict[str, Any]:
    """Return one mode: its values, what it is, and how far off."""
    told: dict[str, Any] = {"f": rounded(f[i]), "zeta": rounded(zeta[i])}
    for name, key in (("frequency_interval", "f_ends"), ("damping_interval", "zeta_ends")):
        ends = run.get(name)
        if ends is not None and all(x is not None for x in ends[order[i]]):
            told[key] = [rounded(x) for x in ends[order[i]]]
    told["marked"] = bool(run["marked"][order[i]]) if "marked" in run else False
    k = pairs.get(i)
    if k is None:
        told["is"] = "twice" if fits.size and fits[i].any() else "false" if reference.complete else "other"
        told["wrong"] = told["is"] != "other"
        return told
    known = {"f": reference.frequencies[k], "zeta": reference.damping[k]}
    exact = reference.kind == "exact" and not math.isfinite(reference.tolerance[k])
    told |= {
        "is": "found",
        "known": rounded(known["f"]),
        "f_error": rounded(abs(f[i] - known["f"]) / reference.reach[k], 4),
    }
    if math.isfinite(reference.tolerance[k]):
        told["f_within"] = bool(abs(f[i] - known["f"]) <= reference.tolerance[k])
    if math.isfinite(known["zeta"]) and math.isfinite(zeta[i]):
        told["zeta_error"] = rounded(abs(zeta[i] / known["zeta"] - 1), 4)
    if math.isfinite(mac[i, k]):
        told["shape_error"] = rounded(max(1 - mac[i, k], 0.0), 4)
    for key in ("f", "zeta"):
        if f"{key}_ends" in told and math.isfinite(known[key]) and exact:
            low, high = told[f"{key}_ends"]
            told[f"{key}_held"] = bool(low <= known[key] <= high)
    told["wrong"] = told.get("zeta_error", 0.0) > _DAMPING and not told.get("zeta_held", False)
    return told


def over_bound(about: dict[str, Any], mode: dict[str, Any]) -> list[float | None]:
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


def totals(results: Iterable[tuple[dict[str, Any], dict[str, Any]]]) -> dict[str, Any]:
    """Return the scores of one program over sets: pairs of a set's entry (`known`, `complete`) and of its run as `judged` returns it.

    A program that fails, or takes more than the limits, misses all modes of the set.
    """
    given = [(about, run) for about, run in results if run["status"] != "cannot"]
    modes = [mode for _, run in given for mode in run.get("modes", [])]
    found, counts = (
        [len(about["known"]) - len(run.get("missed", about["known"])) for about, run in given],
        [len(a["known"]) for a, _ in given],
    )
    told: dict[str, Any] = {
        "sets": len(given),
        "modes": sum(counts),
        "found": sum(found),
        "found_interval": share(found, counts),
    }
    told |= {"missed": sum(counts) - sum(found), "failed": sum(run["status"] != "done" for _, run in given)}
    told |= {name: sum(mode["is"] == name for mode in modes) for name in ("false", "twice")}
    told["wrong_without_a_word"] = sum(mode["wrong"] and not mode["marked"] for mode in modes)
    told["reported"] = sum(mode["is"] != "other" for mode in modes)
    for key in ("f", "zeta", "shape"):
        errors = [mode[f"{key}_error"] for mode in modes if mode.get(f"{key}_error") is not None]
        told[f"{key}_error"] = rounded(float(np.median(errors)), 3) if errors else None
    over = [over_bound(about, mode) for about, run in given for mode in run.get("modes", []) if mode["is"] == "found"]
    columns = [column[np.isfinite(column)] for column in np.array(over, float).reshape(-1, 3).T]
    told["over_bound"] = [rounded(float(np.median(column)), 3) if column.size else None for column in columns]
    within = [mode["f_within"] for mode in modes if "f_within" in mode]
    told["f_within"] = [sum(within), len(within)]
    for key in ("f", "zeta"):
        held = [mode[f"{key}_held"] for mode in modes if f"{key}_held" in mode]
        told[f"{key}_held"], told[f"{key}_coverage"] = [sum(held), len(held)], wilson(sum(held), len(held))
        widths = [
            (mode[f"{key}_ends"][1] - mode[f"{key}_ends"][0]) / 2 / mode[key] for mode in modes if f"{key}_held" in mode
        ]
        told[f"{key}_half_width"] = rounded(float(np.median(widths)), 3) if widths else None
    return told | {"human": sum(run.get("human", 0) for _, run in given)}
