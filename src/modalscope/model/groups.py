"""Groups: parts of a measurement that repeat it, so that what they disagree by can be told from its noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from modalscope.model.checks import DataError, check_each

__all__ = ["AUTO", "Groups", "check_groups", "chosen_groups", "input_groups", "run_groups"]

#: One label a part; None when the parts are not to be told apart.
Groups = tuple[str, ...] | None

#: What stands for the default.
AUTO: Any = "auto"

#: Fewer inputs than this say too little about how far they disagree.
_LEAST = 4


def input_groups(input_dofs: Sequence[str]) -> Groups:
    """Return a group an input column where there are at least four, else None."""
    return tuple(input_dofs) if len(input_dofs) >= _LEAST else None


def run_groups(count: int) -> Groups:
    """Return a group a run where there are several, else None."""
    return tuple(f"run {k + 1}" for k in range(count)) if count > 1 else None


def chosen_groups(groups: Groups, parts: Sequence[int]) -> Groups:
    """Return the labels of some of the parts."""
    return None if groups is None else tuple(groups[k] for k in parts)


def check_groups(groups: Any, count: int, part: str, default: Groups) -> Groups:
    """Return the groups of `count` parts: one label each, None, or the default for "auto".

    Parameters
    ----------
    groups : sequence of labels, "auto" or None
        Parts of the same label belong together.
    count : int
        How many parts there are.
    part : str
        What a part is, in words.
    default : tuple of str or None
        What "auto" stands for.

    Raises
    ------
    DataError
        Another number of labels than parts.
    """
    if groups is None or (isinstance(groups, str) and groups == AUTO):
        return default if groups is not None else None
    labels = tuple(str(label) for label in check_each("groups", groups, f"one label {part}"))
    if len(labels) != count:
        raise DataError(
            f"groups needs {count} labels, one {part}",
            f"{len(labels)} are given",
            'Give one each, groups=None for no groups, or groups="auto".',
        )
    return labels
