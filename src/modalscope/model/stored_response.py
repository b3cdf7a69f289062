"""Impulse responses of more outputs than memory holds: they stay in their file, and come some outputs at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol

import numpy as np

from modalscope.model.channels import KINDS, Channels, check_quantity
from modalscope.model.checks import (
    Array,
    DataError,
    RealArray,
    check_choice,
    check_count,
    check_number,
    check_positive,
    freeze,
    real_stretch,
)
from modalscope.model.impulse import ImpulseResponse

__all__ = ["OutputBlocks", "StoredResponse"]

#: Numbers that are read together, at least; whole pieces of the file where these are larger.
_AT_A_TIME = 4_000_000

#: Bytes of the outputs that stand for all where they are looked at.
_EXCERPT = 64_000_000


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
            "stored responses of (samples, outputs, inputs) were asked",
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
        first, last = check_count("start", start, least=0), min(check_count("stop", stop), len(self.output_dofs))
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
        count = max(_EXCERPT // (8 * self.samples * len(self.input_dofs)), 1)
        first = max((len(self.output_dofs) - count) // 2, 0)
        return self.part(first, first + count)

    def parts(self) -> Iterator[tuple[slice, RealArray]]:
        """Yield which outputs, and their samples as rows, (outputs, N m): whole pieces of the file, checked as they are read."""
        each = self.samples * len(self.input_dofs)
        together = max(int(self.blocks.together), 1)
        step = together * max(_AT_A_TIME // (each * together), 1)
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
