"""Hold ambient setups: records of one structure with some sensors moved and others fixed as references."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from modalscope.data.channels import (
    AUTO,
    Channels,
    Chosen,
    Groups,
    SourcePath,
    check_groups,
    check_source,
    choose_channels,
    chosen_groups,
    source_of,
)
from modalscope.data.geometry import check_labels, indices_of
from modalscope.data.records import Records, SeveralRecords, Signals, as_records
from modalscope.numerics.checks import check_each, check_kind, freeze
from modalscope.numerics.errors import DataError


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Setups(SeveralRecords):
    """Ambient records of one structure, taken one after another: some sensors stayed, the references, the others moved.

    Parameters
    ----------
    parts : sequence of Signals
        One per setup, without inputs, at one sampling rate.
    references : sequence of labels, optional
        Outputs that every setup has; by default all that every setup has.
    groups : sequence of labels, "auto" or None
        One label per setup: what disagrees between groups is repeatability. By default every setup is a group of its own.
    source_path : path or paths, optional
        The files that they were read from; by default those of the parts.

    Raises
    ------
    DataError
        No setup, no common output, measured inputs, or other sampling rates, quantities or units.

    Examples
    --------
    >>> import numpy as np
    >>> first, second = (
    ...     Signals(outputs=np.ones((8, 2)), sampling_rate=4.0, output_dofs=["1Z", d]) for d in ("2Z", "3Z")
    ... )
    >>> setups = Setups(parts=(first, second))
    >>> setups.references, setups.output_dofs, setups.groups
    (('1:+Z',), ('1:+Z', '2:+Z', '3:+Z'), ('setup 1', 'setup 2'))
    """

    parts: tuple[Signals, ...]
    references: tuple[str, ...] = None  # type: ignore[assignment]
    groups: Groups = AUTO
    source_path: SourcePath = field(default=None, compare=False)

    def __post_init__(self) -> None:
        parts = check_each("setups", self.parts, "records, one per setup")
        for part in parts:
            check_kind("each of the setups", part, Signals)
        if not parts:
            raise DataError("setups need at least one record", "the list is empty", "Give at least one record.")
        common = check_setups(parts)
        given = range(len(common)) if self.references is None else self.references
        chosen = [common[i] for i in indices_of("reference that every setup has,", given, common)]
        default = tuple(f"setup {k + 1}" for k in range(len(parts)))
        freeze(
            self,
            parts=tuple(parts),
            references=check_labels("references", chosen, len(chosen), "y"),
            groups=check_groups(self.groups, len(parts), "setup", default),
            source_path=check_source(self.source_path) or source_of(parts),
        )

    @property
    def output_dofs(self) -> tuple[str, ...]:
        """Labels of all outputs that some setup has, in the order in which they come first."""
        return tuple(dict.fromkeys(dof for part in self.parts for dof in part.output_dofs))

    @property
    def input_dofs(self) -> tuple[str, ...]:
        """None were measured."""
        return ()

    @property
    def quantities(self) -> tuple[str | None, ...]:
        """Displacement, velocity, acceleration or None, of every output."""
        known = {dof: q for part in self.parts for dof, q in zip(part.output_dofs, part.quantities, strict=True)}
        return tuple(known[dof] for dof in self.output_dofs)

    @property
    def quantity(self) -> str | None:
        """The quantity of all outputs; None when it is not known or not the same for all."""
        return self.quantities[0] if len(set(self.quantities)) == 1 else None

    @property
    def units(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Units of the outputs; there are no inputs."""
        known = {dof: unit for part in self.parts for dof, unit in zip(part.output_dofs, part.units[0], strict=True)}
        return tuple(known[dof] for dof in self.output_dofs), ()

    @property
    def recordings(self) -> tuple[Signals, ...]:
        """The records of all setups: a test is one record or several."""
        return self.parts

    def _mapped(self, each: Callable[[Any], Any]) -> Setups:
        return replace(self, parts=tuple(map(each, self.parts)))

    def select(self, outputs: Chosen = None, inputs: Chosen = None, exclude: Chosen = None) -> Setups:
        """Return some of the channels; a setup that keeps none of its outputs is left out.

        Parameters
        ----------
        outputs, inputs : labels or indices, optional
            Channels to keep; all by default. There are no inputs.
        exclude : labels, optional
            Channels to leave out.

        Raises
        ------
        DataError
            A channel that is not there, or no reference left.
        """
        rows, _ = choose_channels(self.output_dofs, (), outputs, inputs, exclude)
        wanted = {self.output_dofs[i] for i in rows}
        kept = [k for k, part in enumerate(self.parts) if wanted & set(part.output_dofs)]
        parts = [self.parts[k].select(outputs=[d for d in self.parts[k].output_dofs if d in wanted]) for k in kept]
        references = tuple(dof for dof in self.references if dof in wanted)
        if not references:
            raise DataError(
                "a choice of outputs:", f"no reference remains of {', '.join(self.references)}", "Keep one."
            )
        return replace(self, parts=tuple(parts), references=references, groups=chosen_groups(self.groups, kept))


def as_test(data: Any) -> Records | Setups:
    """Return the records of one test: `Setups` where none has inputs and their outputs differ, `Records` else.

    Raises `DataError`: anything else, or records that do not belong together.
    """
    if isinstance(data, Setups):
        return data
    if isinstance(data, list | tuple) and len(data) > 1 and all(isinstance(part, Signals) for part in data):
        silent = not any(part.input_dofs for part in data)
        if silent and len({frozenset(part.output_dofs) for part in data}) > 1:
            return Setups(parts=tuple(data))
    return as_records(data)


def setups_of(data: Any) -> tuple[Signals, ...]:
    """Return the records of ambient setups; none of any other data."""
    return data.parts if isinstance(data, Setups) else ()


def check_setups(parts: list[Signals]) -> tuple[str, ...]:
    """Return the outputs that all setups have; a `DataError` where records are none: inputs, other rates, quantities or units."""
    first = parts[0]
    known: dict[str, tuple[Any, ...]] = {}
    for number, part in enumerate(parts, 1):
        if part.input_dofs:
            remedy = "Merge their frequency responses: merge([...])."
            raise DataError("ambient setups:", f"setup {number} has inputs", remedy)
        if part.sampling_rate != first.sampling_rate:
            fault = f"setup 1 has {first.sampling_rate:g} Hz, setup {number} {part.sampling_rate:g} Hz"
            raise DataError("setups need one sampling rate", fault, "Decimate the faster records.")
        for dof, quantity, unit in zip(part.output_dofs, part.quantities, part.units[0], strict=True):
            if known.setdefault(dof, (quantity, unit)) != (quantity, unit):
                words = [" in ".join(filter(None, each)) or "neither" for each in (known[dof], (quantity, unit))]
                fault = f"{dof} has {words[0]} in one and {words[1]} in setup {number}"
                asked = "a channel needs the same quantity and unit in all setups"
                raise DataError(asked, fault, "Convert them to one.")
    return common_outputs(parts)


def common_outputs(parts: Sequence[Channels]) -> tuple[str, ...]:
    """Return the outputs that all setups, or the modes of all, have; none is a `DataError`."""
    common = tuple(dof for dof in parts[0].output_dofs if all(dof in part.output_dofs for part in parts))
    if not common:
        asked = "setups are merged through outputs that all have"
        raise DataError(asked, "they have none in common", "Give references the same labels in all.")
    return common
