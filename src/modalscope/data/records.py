"""Hold records: samples of outputs and inputs in one run or several, of any lengths."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modalscope.data.channels import (
    AUTO,
    Channels,
    Chosen,
    Groups,
    SourcePath,
    check_groups,
    check_quantity,
    check_source,
    choose_channels,
    chosen_groups,
    names_base,
    one_channel,
    run_groups,
    source_of,
)
from modalscope.data.geometry import Geometry
from modalscope.data.kind_of_test import commonest, kind_of_test
from modalscope.data.shown import Shown
from modalscope.data.units import Convertible, motion_of
from modalscope.numerics.arguments import also_called
from modalscope.numerics.checks import (
    RealArray,
    check_count,
    check_each,
    check_kind,
    check_positive,
    freeze,
    real_array,
    stays_locked,
)
from modalscope.numerics.errors import DataError
from modalscope.numerics.handed import handed


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Sampled(Channels):
    """What a record in memory and one in its file have in common: a sampling rate, and quantities of the outputs."""

    sampling_rate: float
    quantities: tuple[str | None, ...] = None  # type: ignore[assignment]

    def _label(self, outputs: int, inputs: int) -> bool:
        given: Any = self.quantities
        alike = given is None or isinstance(given, str)
        each = [given] * outputs if alike else check_each("quantities", given, "one for all, or one per output")
        if len(each) != outputs:
            have = f"{len(each)} are given"
            raise DataError(f"quantities needs {outputs}", have, "Give one for all, or one per output.")
        rate = check_positive("sampling_rate", self.sampling_rate)
        freeze(self, sampling_rate=rate, quantities=tuple(check_quantity(quantity) for quantity in each))
        if (said := Channels._label(self, outputs, inputs)) and given is None:
            freeze(self, **self._quantity_of([motion_of(unit) for unit in self.units[0]]))
        return said

    @property
    @abstractmethod
    def samples(self) -> int:
        """Samples in a run."""

    @property
    def duration(self) -> float:
        """Length of a run in seconds."""
        return self.samples / self.sampling_rate

    @property
    def quantity(self) -> str | None:
        """The quantity of all outputs; None when it is not known or not the same for all."""
        return self.quantities[0] if len(set(self.quantities)) == 1 else None

    def _cut(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {**Channels._cut(self, outputs, inputs), "quantities": tuple(self.quantities[i] for i in outputs)}

    def _quantity_of(self, kinds: Sequence[str | None]) -> dict[str, Any]:
        return {"quantities": tuple(q or kind for q, kind in zip(self.quantities, kinds, strict=True))}


@also_called("outputs", "sampling_rate", quantity="quantities")
@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Signals(Sampled, Convertible):
    """Sampled outputs, and the inputs when they were measured.

    Parameters
    ----------
    outputs : array, (N,), (N, l) or (R, N, l)
        N samples of l outputs, or R runs of them; `Signals(outputs, sampling_rate)` is enough.
    inputs : array, (N,), (N, m) or (R, N, m), optional
        The inputs; None when only the response was measured.
    sampling_rate : float
        Samples per second.
    quantities : str or sequence of str, optional
        Displacement, velocity or acceleration: one for all outputs or one each. `quantity=` is accepted, too.
    groups : sequence of labels, "auto" or None
        One label per run: what disagrees between groups is repeatability. By default every run of several is one.

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
    groups: Groups = AUTO

    def __post_init__(self) -> None:
        outputs = _samples_of("outputs", self.outputs)
        inputs = None if self.inputs is None else _samples_of("inputs", self.inputs)
        if inputs is not None and inputs.shape[:-1] != outputs.shape[:-1]:
            fault = f"the shapes are {outputs.shape} and {inputs.shape}"
            remedy = "Cut both to the same samples; the last axis counts channels."
            raise DataError("outputs and inputs need the same runs and samples", fault, remedy)
        if outputs.shape[-2] < 2 or 0 in outputs.shape or (inputs is not None and 0 in inputs.shape):
            raise DataError("a record needs two samples", f"its shape is {outputs.shape}", "Measure a longer one.")
        runs = 1 if outputs.ndim == 2 else outputs.shape[0]
        freeze(self, outputs=outputs, inputs=inputs, groups=check_groups(self.groups, runs, "run", run_groups(runs)))
        self._label(outputs.shape[-1], 0 if inputs is None else inputs.shape[-1])

    @classmethod
    def from_frame(cls, frame: Any, **options: Any) -> Any:
        """Return the data of a data frame with names, units and rate, as `modalscope.from_frame` does.

        Parameters
        ----------
        frame : pandas.DataFrame, xarray.Dataset or the like
        **options
            As of `modalscope.from_frame`.
        """
        return handed("from_frame")(frame, **options)

    @property
    def samples(self) -> int:
        """Samples in a run."""
        return int(self.outputs.shape[-2])

    @property
    def runs(self) -> int:
        """Number of runs."""
        return 1 if self.outputs.ndim == 2 else int(self.outputs.shape[0])

    @property
    def kind_of_test(self) -> str:
        """What the record is of: "hammer", "shaker", "earthquake", "free decay" or "ambient"."""
        kind = kind_of_test(*self.by_run())
        return "earthquake" if kind == "shaker" and any(map(names_base, self.input_dofs)) else kind

    @property
    def recordings(self) -> tuple[Signals, ...]:
        """The record itself: a test is one record or several."""
        return (self,)

    def load(self) -> Signals:
        """Return the record itself: its samples are in memory."""
        return self

    def excerpt(self) -> Signals:
        """Return what of it is looked at: all, for it is in memory."""
        return self

    def by_run(self) -> tuple[RealArray, RealArray | None]:
        """Return outputs (R, N, l) and inputs (R, N, m), with R = 1 for a single run."""
        shape = (self.runs, self.samples, -1)
        return self.outputs.reshape(shape), None if self.inputs is None else self.inputs.reshape(shape)

    def _scaled(self, outputs: RealArray, inputs: RealArray) -> dict[str, Any]:
        return {"outputs": self.outputs * outputs, "inputs": None if self.inputs is None else self.inputs * inputs}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        chosen = None if self.inputs is None or not inputs else np.ascontiguousarray(self.inputs[..., inputs])
        return {"outputs": np.ascontiguousarray(self.outputs[..., outputs]), "inputs": chosen}


def _samples_of(side: str, values: Any) -> RealArray:
    """Return the samples of the outputs or of the inputs, checked."""
    return real_array(side, one_channel(values), f"(samples, {side}) or (runs, samples, {side})", (2, 3))


class SeveralRecords(Shown, Convertible):
    """What tests of several records have in common."""

    __slots__ = ()

    @property
    @abstractmethod
    def recordings(self) -> tuple[Signals, ...]:
        """All records: a test is one record or several."""

    @property
    def kind_of_test(self) -> str:
        """What most of the records are of; without forces "ambient" where they are not all alike."""
        kinds = [record.kind_of_test for record in self.recordings]
        if self.recordings[0].inputs is None:
            return kinds[0] if len(set(kinds)) == 1 else "ambient"
        return commonest(kinds, "shaker")

    @property
    def sampling_rate(self) -> float:
        """Samples per second, of all records."""
        return self.recordings[0].sampling_rate

    @property
    def samples(self) -> tuple[int, ...]:
        """Samples of every record."""
        return tuple(record.samples for record in self.recordings)

    @property
    def geometry(self) -> Geometry | None:
        """Where the channels are: that of the first record that knows it."""
        return next((record.geometry for record in self.recordings if record.geometry is not None), None)

    @property
    def processing(self) -> tuple[str, ...]:
        """What was done to the records so far, each step once."""
        return tuple(dict.fromkeys(step for record in self.recordings for step in record.processing))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Records(SeveralRecords):
    """Runs of one test: the same outputs at one sampling rate, any length, any of the inputs.

    Parameters
    ----------
    runs : sequence of Signals
        Several runs in one `Signals` are taken apart.
    groups : sequence of labels, "auto" or None
        One label per run; runs of the same label belong together. By default every run is a group of its own.
    source_path : path or paths, optional
        The files that they were read from; by default those of the runs.

    Raises
    ------
    DataError
        No run, or runs of different sampling rates, outputs, quantities or units, or some with inputs and some without.

    Examples
    --------
    >>> left = Signals(outputs=np.ones((4, 2)), inputs=np.ones((4, 1)), sampling_rate=8.0, input_dofs=["1:+Z"])
    >>> right = Signals(outputs=np.ones((6, 2)), inputs=np.ones((6, 1)), sampling_rate=8.0, input_dofs=["2:+Z"])
    >>> records = Records(runs=(left, right))
    >>> records.samples, records.input_dofs, records.inputs_of(1), records.groups
    ((4, 6), ('1:+Z', '2:+Z'), (1,), ('run 1', 'run 2'))
    """

    runs: tuple[Signals, ...]
    groups: Groups = AUTO
    source_path: SourcePath = field(default=None, compare=False)

    def __post_init__(self) -> None:
        parts = check_each("runs", self.runs, "records, one per run")
        for part in parts:
            check_kind("each of the runs", part, Signals)
        runs = [run for part in parts for run in runs_apart(part)]
        if not runs:
            raise DataError("runs need at least one record", "the list is empty", "Give at least one record.")
        _check_alike(runs)
        freeze(
            self,
            runs=tuple(runs),
            groups=check_groups(self.groups, len(runs), "run", _inherited(parts, len(runs))),
            source_path=check_source(self.source_path) or source_of(runs),
        )

    @property
    def output_dofs(self) -> tuple[str, ...]:
        """Labels of the outputs, of all runs."""
        return self.runs[0].output_dofs

    @property
    def input_dofs(self) -> tuple[str, ...]:
        """Labels of all inputs that some run has, in the order in which they come first."""
        return tuple(dict.fromkeys(dof for run in self.runs for dof in run.input_dofs))

    @property
    def quantities(self) -> tuple[str | None, ...]:
        """Displacement, velocity, acceleration or None, of every output."""
        return self.runs[0].quantities

    @property
    def quantity(self) -> str | None:
        """The quantity of all outputs; None when it is not known or not the same for all."""
        return self.runs[0].quantity

    @property
    def units(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Units of the outputs and of the inputs."""
        known = _input_units(self.runs)
        return self.runs[0].units[0], tuple(known[dof] for dof in self.input_dofs)

    @property
    def recordings(self) -> tuple[Signals, ...]:
        """The runs: a test is one record or several."""
        return self.runs

    def _mapped(self, each: Callable[[Signals], Signals]) -> Records:
        return replace(self, runs=tuple(map(each, self.runs)), groups=self.groups)

    def inputs_of(self, run: int) -> tuple[int, ...]:
        """Return where the inputs of a run stand among all of them.

        Parameters
        ----------
        run : int
            Which, counted from zero.

        Returns
        -------
        tuple of int
            For each of the run's own inputs its position in `input_dofs`.
        """
        chosen = check_count("run", run, least=0)
        if chosen >= len(self.runs):
            raise DataError(f"run {chosen}:", f"there are {len(self.runs)}, counted from 0", "Name one.")
        position = {dof: i for i, dof in enumerate(self.input_dofs)}
        return tuple(position[dof] for dof in self.runs[chosen].input_dofs)

    def stacked(self) -> tuple[Signals, ...]:
        """Return the runs of the same inputs and length as one record of several runs each, in the order in which they come first."""
        kinds: dict[tuple[Any, ...], list[int]] = {}
        for k, run in enumerate(self.runs):
            kinds.setdefault((run.input_dofs, run.samples), []).append(k)
        return tuple(self._stack(places) for places in kinds.values())

    def _stack(self, places: list[int]) -> Signals:
        runs = [self.runs[k] for k in places]
        if len(runs) == 1:
            return runs[0]
        return replace(
            runs[0],
            outputs=np.stack([run.outputs for run in runs]),
            inputs=None if runs[0].inputs is None else np.stack([np.asarray(run.inputs) for run in runs]),
            groups=chosen_groups(self.groups, places),
            source_path=self.source_path,
        )

    def select(self, outputs: Chosen = None, inputs: Chosen = None, exclude: Chosen = None) -> Records:
        """Return some of the channels; a run that keeps none of its inputs is left out, for what drove it is not known.

        Parameters
        ----------
        outputs, inputs : labels or indices, optional
            Channels to keep; all by default.
        exclude : labels, optional
            Channels to leave out, on whichever side they stand.

        Raises
        ------
        DataError
            A channel that is not there, or none left.
        """
        rows, columns = choose_channels(self.output_dofs, self.input_dofs, outputs, inputs, exclude)
        wanted = [self.input_dofs[i] for i in columns]
        kept, runs = [], []
        for k, run in enumerate(self.runs):
            own = [dof for dof in wanted if dof in run.input_dofs]
            if own or not run.input_dofs:
                kept.append(k)
                runs.append(run.select(outputs=rows, inputs=own))
        if not runs:
            raise DataError("a choice of inputs:", "no run has one of them", "Choose at least one input.")
        return replace(self, runs=tuple(runs), groups=chosen_groups(self.groups, kept))


def as_records(data: Any) -> Records:
    """Return a record, records of several runs, or a list of them as `Records`.

    Raises `DataError`: anything else, or runs that do not belong together.
    """
    kinds = (Signals, Records)
    given = (data,) if isinstance(data, kinds) else check_each("records", data, "Signals, Records, or a list of them")
    for part in given:
        check_kind("each of the records", part, kinds)
    if len(given) == 1 and isinstance(given[0], Records):
        return given[0]
    return Records(runs=tuple(run for part in given for run in part.recordings))


def runs_apart(part: Signals) -> list[Signals]:
    """Return the runs of a record, each by itself."""
    if part.outputs.ndim == 2:
        return [part]
    outputs, inputs = part.by_run()
    return [
        replace(part, outputs=y, inputs=None if inputs is None else inputs[k], groups=None)
        for k, y in enumerate(outputs)
    ]


def _inherited(parts: list[Signals], count: int) -> Groups:
    """Return the labels that the parts were given, and a group per run for those that have none of their own."""
    labels = run_groups(count)
    if labels is None:
        return parts[0].groups
    named: list[str] = []
    for part in parts:
        own = None if part.groups == run_groups(part.runs) else part.groups
        named += own or labels[len(named) : len(named) + part.runs]
    return tuple(named)


def _check_alike(runs: list[Signals]) -> None:
    """Raise when runs differ in what all of them share; the message says which run, and in what."""
    first = runs[0]
    for number, run in enumerate(runs[1:], 2):
        if not np.isclose(run.sampling_rate, first.sampling_rate, rtol=1e-9, atol=0):
            rates = f"run 1 has {first.sampling_rate:g} Hz, run {number} {run.sampling_rate:g} Hz"
            raise DataError("runs need one sampling rate", rates, "Decimate the faster records.")
        for what, one, other, change in (
            ("outputs", first.output_dofs, run.output_dofs, "Select the same outputs, in the same order, of each run"),
            ("quantities", first.quantities, run.quantities, "Convert the records to one"),
            ("units of the outputs", first.units[0], run.units[0], "Convert the records to one"),
        ):
            if one != other:
                raise DataError(f"runs of the same {what}:", _difference(one, other, number), f"{change}.")
        if bool(run.input_dofs) is not bool(first.input_dofs):
            silent = 1 if run.input_dofs else number
            raise DataError(
                "either all runs need inputs, or none",
                f"run {silent} has none and others have some",
                "Give inputs of zeros to a run in free decay; leave out a run whose forces were not measured.",
            )
    _input_units(runs)


def _difference(one: tuple[Any, ...], other: tuple[Any, ...], number: int) -> str:
    """Say in what the first run and another differ."""
    if len(one) != len(other):
        return f"run 1 has {len(one)}, run {number} {len(other)}"
    k = next(k for k in range(len(one)) if one[k] != other[k])
    return f"number {k + 1} is {one[k] or 'not known'} in run 1 and {other[k] or 'not known'} in run {number}"


def _input_units(runs: Iterable[Signals]) -> dict[str, str]:
    """Return the unit of every input, or raise when two runs have it in different ones."""
    units: dict[str, str] = {}
    for run in runs:
        for dof, unit in zip(run.input_dofs, run.units[1], strict=True):
            if units.setdefault(dof, unit) != unit:
                fault = f"one run has it in {units[dof] or 'no unit'}, another in {unit or 'no unit'}"
                raise DataError(f"input {dof} needs one unit", fault, "Convert the records to one unit.")
    return units
