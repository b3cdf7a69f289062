"""Records: what the sensors and the exciters gave, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.model.channels import Channels, check_quantity
from modalscope.model.checks import (
    DataError,
    RealArray,
    check_each,
    check_positive,
    freeze,
    real_array,
)
from modalscope.model.groups import AUTO, Groups, check_groups, run_groups
from modalscope.model.shown import Convertible

__all__ = ["Signals"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Signals(Channels, Convertible):
    """Sampled outputs, and the inputs when they were measured.

    Parameters
    ----------
    outputs : array, (N, l) or (R, N, l)
        N samples of l outputs, or R runs of them.
    inputs : array, (N, m) or (R, N, m), optional
        The inputs; None when only the response was measured.
    sampling_rate : float
        Samples per second.
    quantities : str or sequence of str, optional
        Displacement, velocity or acceleration: one for all outputs or one each.
    groups : sequence of labels, "auto" or None
        One label a run: what disagrees between groups is repeatability. By default every run of several is one.

    Raises
    ------
    DataError
        Wrong axes, fewer than two samples, NaN or infinite samples, repeated labels.

    Examples
    --------
    >>> record = Signals(outputs=[[0.0], [1.0], [0.5]], sampling_rate=100.0)
    >>> record.samples, record.duration, record.output_dofs
    (3, 0.03, ('y1',))
    """

    outputs: RealArray
    inputs: RealArray | None = None
    sampling_rate: float
    quantities: tuple[str | None, ...] = None  # type: ignore[assignment]
    groups: Groups = AUTO

    def __post_init__(self) -> None:
        outputs = real_array("outputs", self.outputs, "(samples, outputs) or (runs, samples, outputs)", (2, 3))
        inputs = None
        if self.inputs is not None:
            inputs = real_array("inputs", self.inputs, "(samples, inputs) or (runs, samples, inputs)", (2, 3))
            if inputs.shape[:-1] != outputs.shape[:-1]:
                raise DataError(
                    "outputs and inputs need the same runs and samples",
                    f"the shapes are {outputs.shape} and {inputs.shape}",
                    "Cut both to the same samples; the last axis counts channels.",
                )
        if outputs.shape[-2] < 2 or 0 in outputs.shape or (inputs is not None and 0 in inputs.shape):
            raise DataError(
                "a record needs at least two samples of one channel",
                f"its shape is {outputs.shape}",
                "Measure a longer record.",
            )
        given: Any = self.quantities
        count = outputs.shape[-1]
        alike = given is None or isinstance(given, str)
        quantities = [given] * count if alike else check_each("quantities", given, "one for all, or one an output")
        if len(quantities) != count:
            raise DataError(
                f"quantities needs {count}, one an output",
                f"{len(quantities)} are given",
                "Give one for all, or one each.",
            )
        runs = 1 if outputs.ndim == 2 else outputs.shape[0]
        freeze(
            self,
            outputs=outputs,
            inputs=inputs,
            sampling_rate=check_positive("sampling_rate", self.sampling_rate),
            quantities=tuple(check_quantity(q) for q in quantities),
            groups=check_groups(self.groups, runs, "a run", run_groups(runs)),
        )
        self._label(count, 0 if inputs is None else inputs.shape[-1])

    @property
    def samples(self) -> int:
        """Samples in a run."""
        return int(self.outputs.shape[-2])

    @property
    def runs(self) -> int:
        """Number of runs."""
        return 1 if self.outputs.ndim == 2 else int(self.outputs.shape[0])

    @property
    def duration(self) -> float:
        """Length of a run in seconds."""
        return self.samples / self.sampling_rate

    @property
    def quantity(self) -> str | None:
        """The quantity of all outputs; None when it is not known or not the same for all."""
        return self.quantities[0] if len(set(self.quantities)) == 1 else None

    def excerpt(self) -> Signals:
        """Return what of it is looked at: all, for it is in memory."""
        return self

    def by_run(self) -> tuple[RealArray, RealArray | None]:
        """Return outputs (R, N, l) and inputs (R, N, m), with R = 1 for a single run."""
        shape = (self.runs, self.samples, -1)
        return self.outputs.reshape(shape), None if self.inputs is None else self.inputs.reshape(shape)

    def _cut(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {**Channels._cut(self, outputs, inputs), "quantities": tuple(self.quantities[i] for i in outputs)}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        chosen = None if self.inputs is None or not inputs else np.ascontiguousarray(self.inputs[..., inputs])
        return {"outputs": np.ascontiguousarray(self.outputs[..., outputs]), "inputs": chosen}
