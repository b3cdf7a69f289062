"""Responses that stay in their file through few combinations of their outputs, in memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from modalscope.blocks.combinations import found_combinations, labelled
from modalscope.model.checks import RealArray
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.memory import check_fits
from modalscope.model.notes import Note
from modalscope.model.stored_response import StoredResponse

__all__ = ["combined"]

#: Combinations: what diagrams of eighty states need.
COUNT = 120

#: Copies of the sketch's size that are there at a time.
_COPIES = 3


@dataclass(frozen=True)
class _Rows:
    """A stored response as rows of outputs; see `OutputRows`."""

    stored: StoredResponse

    @property
    def outputs(self) -> int:
        """How many there are."""
        return len(self.stored.output_dofs)

    @property
    def columns(self) -> int:
        """Samples of one output, input by input."""
        return self.stored.samples * len(self.stored.input_dofs)

    def parts(self) -> Iterator[tuple[slice, RealArray]]:
        """Yield outputs as rows."""
        return self.stored.parts()


def combined(stored: StoredResponse, count: int = COUNT) -> tuple[ImpulseResponse, Note]:
    """Return the response of combinations of the outputs, and what they leave out.

    Poles, participation and everything that is judged over all outputs together are those of the whole; shapes belong to the
    combinations, see `modalscope.modal.full_field`.

    Parameters
    ----------
    stored : StoredResponse
    count : int
        How many.

    Raises
    ------
    DataError
        Samples that do not read, or a sketch that is too large for the memory.
    """
    rows = _Rows(stored)
    check_fits(
        f"combinations of {rows.outputs} outputs of {rows.columns} samples each",
        8.0 * _COPIES * 16 * count * rows.columns,
        "Store fewer samples.",
    )
    found = found_combinations(rows, count, keep=False)
    few = len(found.columns)
    values: RealArray = found.columns.reshape(few, stored.samples, -1).transpose(1, 0, 2)
    text = (
        f"{rows.outputs} stored outputs are seen through {few} combinations, which leave out {found.discarded:.2g} of their energy; "
        "full_field gives the shapes of all of them"
    )
    note = Note("combinations", {"outputs": rows.outputs, "combinations": few, "discarded": found.discarded}, text)
    return labelled(stored.part(0, 1), values, None, few), note
