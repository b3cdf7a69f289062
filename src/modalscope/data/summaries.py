"""Summarize each data class in one line, a picture and a table."""

from __future__ import annotations

from modalscope.data.geometry import Geometry
from modalscope.data.modes import ModalModel
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Records, Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.results import Result, StabilizationDiagram
from modalscope.data.setups import Setups
from modalscope.data.shown import cells_of, counted, said_of, summary_of
from modalscope.data.statespace import StateSpace
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.numerics.handed import handed


@summary_of.register
def _(thing: Geometry) -> str:
    sizes = ((thing.nodes, "node"), (thing.lines, "line"), (thing.faces, "face"))
    return f"geometry: {', '.join(counted(len(parts), word) for parts, word in sizes)}"


@summary_of.register
def _(thing: StabilizationDiagram) -> str:
    size = f"{counted(len(thing.poles), 'pole')} at {counted(len(thing.orders), 'order')}"
    return f"stabilization diagram: {size}, of {summary_of(thing.response)}"


@summary_of.register
def _(thing: StateSpace) -> str:
    time = "continuous" if thing.dt is None else f"sampled every {thing.dt:g} s"
    sizes = ((thing.order, "state"), (len(thing.C), "output"), (thing.B.shape[1], "input"))
    return f"state-space model: {time}, {', '.join(counted(number, word) for number, word in sizes)}"


@summary_of.register
def _(thing: FrequencyResponse) -> str:
    low, high = thing.span
    return f"frequency responses{_kind(thing)}: {counted(thing.lines, 'line')} from {low:g} to {high:g} Hz, {_sides(thing)}"


@summary_of.register
def _(thing: ImpulseResponse) -> str:
    at = f"{thing.samples} samples at {thing.sampling_rate:g} Hz"
    return f"impulse responses{_kind(thing)} ({thing.kind}): {at}, {_sides(thing)}"


@summary_of.register
def _(thing: RecordSpectra) -> str:
    low, high = thing.span
    return f"records of {counted(len(thing.durations), 'run')} on {thing.count} lines from {low:g} to {high:g} Hz, {_sides(thing)}"


@summary_of.register
def _(thing: ModalModel) -> str:
    f = thing.frequencies
    span = f" from {f.min():.4g} to {f.max():.4g} Hz" if len(thing) else ""
    return f"modes{_kind(thing)}: {counted(len(thing), 'mode')}{span}, {_sides(thing)}"


@summary_of.register
def _(thing: Signals) -> str:
    runs = "" if thing.runs == 1 else f"{thing.runs} runs of "
    return f"records: {runs}{thing.samples} samples at {thing.sampling_rate:g} Hz, {_outputs_and_inputs(thing)}"


@summary_of.register
def _(thing: StoredSignals) -> str:
    return f"stored records: {thing.samples} samples at {thing.sampling_rate:g} Hz, {_outputs_and_inputs(thing)}"


@summary_of.register
def _(thing: StoredResponse) -> str:
    return f"stored impulse responses ({thing.kind}): {thing.samples} samples at {thing.sampling_rate:g} Hz, {_sides(thing)}"


@summary_of.register
def _(thing: Records) -> str:
    lengths = ", ".join(map(str, thing.samples[:4])) + (", ..." if len(thing.samples) > 4 else "")
    runs = f"{counted(len(thing.runs), 'run')} of {lengths} samples"
    return f"records: {runs} at {thing.sampling_rate:g} Hz, {_outputs_and_inputs(thing)}"


@summary_of.register
def _(thing: Setups) -> str:
    lengths = ", ".join(map(str, thing.samples[:4])) + (", ..." if len(thing.samples) > 4 else "")
    references = counted(len(thing.references), "reference")
    parts = f"{counted(len(thing.parts), 'setup')} of {lengths} samples"
    return f"ambient setups: {parts} at {thing.sampling_rate:g} Hz, {references}, {_outputs_and_inputs(thing)}"


@summary_of.register
def _(thing: Result) -> str:
    return f"result: {summary_of(thing.modes)}; {counted(len(thing.notes), 'note')}, {counted(len(thing.findings), 'finding')}"


@cells_of.register
def _(thing: ModalModel | Result) -> list[list[str]]:
    return list(handed("table_of")(thing.modes if isinstance(thing, Result) else thing))


@said_of.register
def _(thing: Result) -> tuple[str, ...]:
    if not thing.diagrams:
        return ()
    verdict = handed("verdict_of_result")(thing)
    return (*verdict.taken, *verdict.unexplained, *verdict.graded, *verdict.warnings)


def _kind(thing: FrequencyResponse | ImpulseResponse | ModalModel | Signals | StoredSignals | Records | Setups) -> str:
    return f" ({thing.quantity})" if thing.quantity else ""


def _sides(thing: FrequencyResponse | ImpulseResponse | StoredResponse | ModalModel | RecordSpectra) -> str:
    return f"{counted(len(thing.output_dofs), 'output')}, {counted(len(thing.input_dofs), 'input')}"


def _outputs_and_inputs(thing: Signals | StoredSignals | Records | Setups) -> str:
    inputs = counted(len(thing.input_dofs), "input") if thing.input_dofs else "no inputs"
    return f"{counted(len(thing.output_dofs), 'output')}{_kind(thing)}, {inputs}"
