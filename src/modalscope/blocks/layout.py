"""Which samples, outputs and inputs the rows and columns of a Hankel matrix are, with the conditions of Eqs. 20-21 checked."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.checks import (
    DataError,
    IntArray,
    RealArray,
    check_count,
    check_each,
    real_array,
)

__all__ = ["block_entries", "block_shifts", "side_map", "side_weights"]


def block_shifts(name: str, shifts: Sequence[int] | None, blocks: int | None, other: str) -> list[int]:
    """Return the shifts of the blocks of one side: 0, 1, 2, ..., or those given, which must begin at 0 and have no common factor.

    If all shifts are multiples of p, the factor's blocks are C, C A^p, C A^2p, ..., and poles that A^p takes to one place are
    no longer told apart: the rank is lost although every mode is in the data.
    """
    if shifts is None:
        if blocks is None:
            raise DataError(f"a Hankel matrix needs {other} or {name}", "neither is given", f"Give {other}.")
        return list(range(check_count(other, blocks)))
    found = [check_count(name, s, least=0) for s in shifts]
    if not found or found[0] != 0 or any(b <= a for a, b in pairwise(found)):
        raise DataError(
            f"{name} needs whole numbers that increase from 0",
            f"they are {found[:8]}",
            "Start at 0 and give each shift once.",
        )
    if blocks is not None and blocks != len(found):
        raise DataError(
            f"{other}={blocks} was asked", f"{name} has {len(found)} entries, one a block", f"Give {name} alone."
        )
    factor = gcd(*found)
    if factor > 1:
        raise DataError(
            f"{name} needs shifts without a common factor",
            f"all are multiples of {factor}, and A^{factor} may have coinciding poles",
            "Add a shift that is not a multiple.",
        )
    return found


def block_entries(
    name: str, subsets: Sequence[Sequence[int]] | None, shifts: list[int], count: int, what: str
) -> IntArray:
    """Return shift and channel of every row (or column), (2, rows): all channels in each block, or the subsets given."""
    if subsets is None:
        return np.stack([np.repeat(shifts, count), np.tile(np.arange(count), len(shifts))]).astype(np.int64)
    sets = check_each(name, subsets, "one set of indices a block")
    chosen = [[check_count(name, c, least=0) for c in check_each(name, subset, "sets of indices")] for subset in sets]
    if len(chosen) != len(shifts):
        raise DataError(
            f"{name} needs {len(shifts)} sets, one a block", f"there are {len(chosen)}", "Give one a block."
        )
    if chosen[0] != list(range(count)):
        raise DataError(
            f"{name} needs all {count} {what} in the first block",
            f"it holds {chosen[0]}",
            "Leave channels out of later blocks only, or use select().",
        )
    if any(c < 0 or c >= count for subset in chosen for c in subset):
        raise DataError(f"{name} names {what} 0 to {count - 1}", "there is an index outside", "Correct the index.")
    if any(len(set(subset)) < len(subset) for subset in chosen):
        raise DataError(f"{name} names each of the {what} once a block", "one is repeated", "Give each once.")
    return np.array([(s, c) for s, subset in zip(shifts, chosen, strict=True) for c in subset], dtype=np.int64).T


def side_weights(name: str, weights: ArrayLike | None, entries: IntArray, count: int) -> RealArray | None:
    """Return positive weights of one side: one a channel, or one a row (a column)."""
    if weights is None:
        return None
    array = real_array(name, weights, "(channels,) or (rows,)", 1)
    if array.size not in (count, entries.shape[1]):
        raise DataError(
            f"{name} needs {count} or {entries.shape[1]} entries",
            f"it has {array.size}",
            "Give one a channel, or one a row.",
        )
    if np.any(array <= 0):
        raise DataError(
            f"{name} needs positive weights",
            f"the smallest is {array.min():g}",
            "Leave channels out with select() instead of weighting by 0.",
        )
    return array


def side_map(name: str, T: ArrayLike | None, entries: IntArray, count: int, whole: bool) -> RealArray | None:
    """Return a compression of one side: T_0 (q, channels), for each block when blocks are whole, or T_r (q, rows)."""
    if T is None:
        return None
    array = real_array(name, T, "(rows kept, rows)", 2)
    rows = entries.shape[1]
    allowed = (count, rows) if whole else (rows,)
    if array.shape[1] not in allowed:
        within = f"{count} columns (within blocks) or " if whole else ""
        raise DataError(
            f"{name} needs {within}{rows} columns (over whole columns of the matrix)",
            f"it has {array.shape[1]}",
            "Give one column for each row that is combined.",
        )
    if not np.all(np.any(array, axis=1)):
        raise DataError(f"{name} needs rows that combine something", "a row of it is zero", "Leave that row out.")
    return array
