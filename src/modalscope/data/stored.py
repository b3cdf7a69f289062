"""Hold records and responses that stay in their file and are read in stretches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, NoReturn, Protocol, TypeVar

import numpy as np

from modalscope.data.channels import KINDS, Channels, check_quantity
from modalscope.data.records import Sampled, Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.numerics.checks import Array, RealArray, check_count, check_number, check_positive, freeze, real_stretch
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import allowed_memory, check_fits

#: Size of the excerpt of a record that is examined.
_EXCERPT_BYTES = 64_000_000

#: Stretches of a record whose content tells it from others of the same size and date, and samples of each.
_FINGERPRINT_STRETCHES, _FINGERPRINT_SAMPLES = 64, 64

#: A record is read into memory when this many would fit.
_MIN_RECORDS_IN_MEMORY = 16


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

    `factors`: one per column that is picked.
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
class StoredSignals(Sampled):
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
        Displacement, velocity or acceleration, one per output.

    Raises
    ------
    DataError
        Fewer than two samples; while they are read, NaN or infinite samples.
    """

    rows: Rows

    def __post_init__(self) -> None:
        if not (hasattr(self.rows, "shape") and hasattr(self.rows, "read")):
            raise DataError(
                "rows of a stored record:",
                f"there is {type(self.rows).__name__}, of which no stretch can be read",
                "Read the file with stored=True, or give an object with shape, identity and read(start, stop).",
            )
        samples, count = self.rows.shape
        if samples < 2 or count < 1:
            raise DataError("a record needs two samples", f"its shape is {self.rows.shape}", "Measure a longer one.")
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
    def size(self) -> int:
        """Bytes that it takes in memory as a whole."""
        return self.samples * len(self.output_dofs) * 8

    @property
    def fingerprint(self) -> str:
        """A hash of samples spread evenly over the record: of other content, but for a change that falls between them, it is another."""
        digest = sha256()
        last = max(self.samples - _FINGERPRINT_SAMPLES, 0)
        for start in np.unique(np.linspace(0, last, _FINGERPRINT_STRETCHES).astype(int)).tolist():
            digest.update(
                np.ascontiguousarray(self.rows.read(start, min(start + _FINGERPRINT_SAMPLES, self.samples))).tobytes()
            )
        return digest.hexdigest()

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
        first, last = check_count("start", start, least=0, most=self.samples - 1), check_count("stop", stop)
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

    @property
    def excerpt_samples(self) -> int:
        """How many samples are small beside memory: of a short record, all."""
        return min(self.samples, max(_EXCERPT_BYTES // (8 * len(self.output_dofs)), 2))

    def excerpt(self) -> Signals:
        """Return a stretch from the middle that is small beside memory: of a short record, all of it."""
        count = self.excerpt_samples
        start = (self.samples - count) // 2
        return self.part(start, start + count)

    def settled(self) -> Signals | StoredSignals:
        """Return the record in memory where it takes little of it; else as it is."""
        return self.load() if _MIN_RECORDS_IN_MEMORY * self.size <= allowed_memory() else self

    def _scaled(self, outputs: RealArray, inputs: RealArray) -> dict[str, Any]:
        return {"rows": Picked(self.rows, tuple(range(len(outputs))), tuple(map(float, outputs)))}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {"rows": Picked(self.rows, tuple(outputs))}


#: Minimum number of values that are read at a time; whole pieces of the file where these are larger.
_NUMBERS_AT_A_TIME = 4_000_000


class OutputBlocks(Protocol):
    """Samples, outputs and inputs, of which some outputs can be read."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Samples, outputs and inputs."""

    @property
    def together(self) -> int:
        """Outputs that lie in one piece of the file."""

    @property
    def identity(self) -> str:
        """What tells whether it is still the same: file, size and date."""

    def read(self, start: int, stop: int) -> Array:
        """Return the outputs from `start` to before `stop`, (N, outputs, m)."""


@dataclass(frozen=True, eq=False, slots=True)
class _Chosen:
    """Some outputs and inputs of what is stored; what lies between them is read and left."""

    blocks: OutputBlocks
    outputs: tuple[int, ...]
    inputs: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, int, int]:
        return self.blocks.shape[0], len(self.outputs), len(self.inputs)

    @property
    def together(self) -> int:
        return self.blocks.together

    @property
    def identity(self) -> str:
        return f"{self.blocks.identity} outputs {self.outputs} inputs {self.inputs}"

    def read(self, start: int, stop: int) -> Array:
        chosen = np.asarray(self.outputs[start:stop])
        first = int(chosen.min())
        return self.blocks.read(first, int(chosen.max()) + 1)[:, chosen - first][:, :, list(self.inputs)]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False, weakref_slot=True)
class StoredResponse(Channels):
    """Impulse responses, or free decays, that stay where they are stored, however many outputs there are.

    `identify`, `stabilize` and `sweep` see them through combinations of the outputs (two passes over the file); `full_field` writes the
    shapes of all outputs (a third). `read` gives them of Zarr folders that are too large for memory.

    Parameters
    ----------
    blocks : OutputBlocks
        Where the samples come from.
    sampling_rate : float
        Samples per second.
    kind : str
        As in `ImpulseResponse`.
    first_sample : int
        Sampling intervals from the impulse to the first sample.
    quantity : str, optional
        Displacement, velocity or acceleration.
    added_damping : float
        Decay rate in 1/s that an exponential window added to every pole.

    Raises
    ------
    DataError
        Fewer than two samples, no channel; while they are read, NaN or infinite samples.
    """

    blocks: OutputBlocks
    sampling_rate: float
    kind: str = "pulse"
    first_sample: int = 0
    quantity: str | None = None
    added_damping: float = 0.0

    def __post_init__(self) -> None:
        shape = tuple(getattr(self.blocks, "shape", ()))
        if len(shape) != 3 or not hasattr(self.blocks, "read"):
            self._refuse(f"there is {type(self.blocks).__name__}, of which no outputs can be read")
        if shape[0] < 2 or 0 in shape:
            self._refuse(f"its shape is {shape}")
        freeze(
            self,
            sampling_rate=check_positive("sampling_rate", self.sampling_rate),
            kind=check_choice("kind", self.kind, KINDS),
            first_sample=check_count("first_sample", self.first_sample, least=0),
            quantity=check_quantity(self.quantity),
            added_damping=check_number("added_damping", self.added_damping),
        )
        self._label(shape[1], shape[2])

    def _refuse(self, found: str) -> NoReturn:
        raise DataError(
            "stored responses of (samples, outputs, inputs):",
            found,
            "Read a Zarr folder with stored=True, or give an object with shape, together, identity and read(start, stop).",
        )

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.blocks.shape[0])

    @property
    def size(self) -> int:
        """Bytes that it takes in memory as a whole."""
        return 8 * int(np.prod([float(n) for n in self.blocks.shape]))

    def part(self, start: int, stop: int) -> ImpulseResponse:
        """Return the responses of outputs from `start` to before `stop` in memory.

        Parameters
        ----------
        start, stop : int

        Raises
        ------
        DataError
            NaN or infinite samples; complex ones.
        """
        outputs = len(self.output_dofs)
        first, last = check_count("start", start, least=0, most=outputs - 1), min(check_count("stop", stop), outputs)
        sides = (self.units[0][first:last], self.units[1])
        return ImpulseResponse(
            values=self._read(first, last),
            sampling_rate=self.sampling_rate,
            kind=self.kind,
            first_sample=self.first_sample,
            quantity=self.quantity,
            added_damping=self.added_damping,
            **{**self.labelled(), "output_dofs": self.output_dofs[first:last], "units": sides, "geometry": None},
        )

    def excerpt(self) -> ImpulseResponse:
        """Return outputs from the middle that are small beside memory: of few, all of them."""
        count = max(_EXCERPT_BYTES // (8 * self.samples * len(self.input_dofs)), 1)
        first = max((len(self.output_dofs) - count) // 2, 0)
        return self.part(first, first + count)

    def parts(self) -> Iterator[tuple[slice, RealArray]]:
        """Yield which outputs, and their samples as rows, (outputs, N m): whole pieces of the file, checked as they are read."""
        each = self.samples * len(self.input_dofs)
        together = max(int(self.blocks.together), 1)
        step = together * max(_NUMBERS_AT_A_TIME // (each * together), 1)
        for start in range(0, len(self.output_dofs), step):
            values = self._read(start, min(start + step, len(self.output_dofs)))
            rows = np.empty((values.shape[1], self.samples, values.shape[2]))
            for i in range(values.shape[2]):  # input by input: numpy copies pairs of numbers slowly
                rows[:, :, i] = values[:, :, i].T
            yield slice(start, start + len(rows)), rows.reshape(len(rows), -1)

    def _read(self, start: int, stop: int) -> Array:
        return real_stretch("values", f"output {self.output_dofs[start]}", self.blocks.read(start, stop))

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {"blocks": _Chosen(self.blocks, tuple(outputs), tuple(inputs))}
