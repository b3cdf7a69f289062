"""Records that stay in their file: read a stretch at a time, checked as they are read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from modalscope.model.channels import Channels, check_quantity
from modalscope.model.checks import Array, DataError, RealArray, check_count, check_positive, freeze, real_stretch
from modalscope.model.memory import allowed_memory, check_fits
from modalscope.model.signals import Signals

__all__ = ["Picked", "Record", "Rows", "StoredSignals"]

#: Bytes of a stretch that stands for the whole record where it is looked at.
_EXCERPT = 64_000_000

#: A record that takes less than one in so many parts of the memory is taken into it.
_BESIDE = 16


#: A record in memory or in its file, and what is made of it.
Record = TypeVar("Record", Signals, "StoredSignals")


class Rows(Protocol):
    """Samples in rows and channels in columns, of which stretches can be read; it can be sent to another process."""

    @property
    def shape(self) -> tuple[int, int]:
        """Samples and channels."""

    @property
    def identity(self) -> str:
        """What tells whether it is still the same: file, size and date, and what is done to it."""

    def read(self, start: int, stop: int) -> Array:
        """Return the rows from `start` to before `stop`."""


@dataclass(frozen=True, eq=False, slots=True)
class Picked:
    """Some columns of rows, each multiplied by a factor.

    Parameters
    ----------
    rows : Rows
    columns : tuple of int
    factors : tuple of float, optional
        One a column that is picked.
    """

    rows: Rows
    columns: tuple[int, ...]
    factors: tuple[float, ...] | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Samples and columns that are picked."""
        return self.rows.shape[0], len(self.columns)

    @property
    def identity(self) -> str:
        """The rows' own, and what is picked."""
        return f"{self.rows.identity} columns {self.columns} times {self.factors}"

    def read(self, start: int, stop: int) -> Array:
        """Return some rows of these columns."""
        picked = self.rows.read(start, stop)[:, list(self.columns)]
        return picked if self.factors is None else picked * np.asarray(self.factors)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False, weakref_slot=True)
class StoredSignals(Channels):
    """Sampled outputs that stay where they are stored, however long they are.

    Correlations, filters and decimation go through them stretch by stretch; what needs all of them at once takes `load()`. `read` gives
    them of files that are too large for memory.

    Parameters
    ----------
    rows : Rows
        Where the samples come from.
    sampling_rate : float
        Samples per second.
    quantities : str or sequence of str, optional
        Displacement, velocity or acceleration, one an output.

    Raises
    ------
    DataError
        Fewer than two samples; while they are read, NaN or infinite samples.
    """

    rows: Rows
    sampling_rate: float
    quantities: tuple[str | None, ...] = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if not (hasattr(self.rows, "shape") and hasattr(self.rows, "read")):
            raise DataError(
                "rows of a stored record were asked",
                f"there is {type(self.rows).__name__}, of which no stretch can be read",
                "Read the file with stored=True, or give an object with shape, identity and read(start, stop).",
            )
        samples, count = self.rows.shape
        if samples < 2 or count < 1:
            raise DataError(
                "a record needs at least two samples of one channel",
                f"its shape is {self.rows.shape}",
                "Measure a longer record.",
            )
        given: Any = self.quantities
        each = (given,) * count if given is None or isinstance(given, str) else tuple(given)
        freeze(
            self,
            sampling_rate=check_positive("sampling_rate", self.sampling_rate),
            quantities=tuple(check_quantity(quantity) for quantity in each),
        )
        self._label(count, 0)

    @property
    def samples(self) -> int:
        """How many there are."""
        return int(self.rows.shape[0])

    @property
    def runs(self) -> int:
        """One: what is stored is one run."""
        return 1

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.samples / self.sampling_rate

    @property
    def quantity(self) -> str | None:
        """The quantity of all outputs; None when it is not known or not the same for all."""
        return self.quantities[0] if len(set(self.quantities)) == 1 else None

    @property
    def size(self) -> int:
        """Bytes that it takes in memory as a whole."""
        return self.samples * len(self.output_dofs) * 8

    def chunk(self, start: int, stop: int) -> RealArray:
        """Return the samples from `start` to before `stop`, or to the end, (samples, l).

        Parameters
        ----------
        start, stop : int

        Raises
        ------
        DataError
            NaN or infinite samples; complex ones.
        """
        first, last = check_count("start", start, least=0), check_count("stop", stop)
        read = real_stretch("outputs", f"sample {first}", self.rows.read(first, min(last, self.samples)))
        return np.asarray(read, dtype=np.float64)

    def load(self) -> Signals:
        """Return all of it in memory.

        Raises
        ------
        DataError
            More than may be taken.
        """
        check_fits(
            f"a record of {self.samples} samples in memory", 2.0 * self.size, "Give a band: it is decimated then."
        )
        return self.part(0, self.samples)

    def part(self, start: int, stop: int) -> Signals:
        """Return a stretch of it in memory.

        Parameters
        ----------
        start, stop : int
            From sample to before sample.
        """
        return Signals(
            outputs=self.chunk(start, stop),
            sampling_rate=self.sampling_rate,
            quantities=self.quantities,
            **self.labelled(),
        )

    def excerpt(self) -> Signals:
        """Return a stretch from the middle that is small beside memory: of a short record, all of it."""
        count = min(self.samples, max(_EXCERPT // (8 * len(self.output_dofs)), 2))
        start = (self.samples - count) // 2
        return self.part(start, start + count)

    def settled(self) -> Signals | StoredSignals:
        """Return the record in memory where it takes little of it; else as it is."""
        return self.load() if _BESIDE * self.size <= allowed_memory() else self

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {
            "rows": Picked(self.rows, tuple(outputs)),
            "quantities": tuple(self.quantities[i] for i in outputs),
        }
