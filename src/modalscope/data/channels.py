"""Define what records and responses share: labels, units, geometry, groups, source files, processing."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from importlib import import_module
from numbers import Number
from pathlib import Path
from typing import Any, Self, TypeAlias

import numpy as np

from modalscope.data.geometry import DofLike, Geometry, check_labels, indices_of
from modalscope.data.shown import Shown
from modalscope.numerics.checks import check_each, check_kind, check_path, freeze
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.functions.poles import QUANTITIES

#: One file; several where data of several were put together; None where data were made.
SourcePath: TypeAlias = Path | tuple[Path, ...] | None


def check_source(given: Any) -> SourcePath:
    """Return a name, or several, as paths; each once.

    Raises `DataError`: something that names no file.

    Examples
    --------
    >>> check_source(["a.npz", "a.npz"]) == Path("a.npz")
    True
    """
    names = given if isinstance(given, tuple | list) else () if given is None else (given,)
    paths = tuple(dict.fromkeys(check_path(name) for name in names))
    return paths if len(paths) > 1 else next(iter(paths), None)


def files_of(data: Any) -> tuple[Path, ...]:
    """Return the files that data came from, none where that is not known.

    `data`: with a `source_path`, or without.
    """
    held = getattr(data, "source_path", None)
    return held if isinstance(held, tuple) else () if held is None else (held,)


def source_of(parts: Iterable[Any]) -> SourcePath:
    """Return where data that are put together came from: the files of all parts."""
    return check_source([file for part in parts for file in files_of(part)])


#: One label per part; None when the parts are not to be told apart.
Groups = tuple[str, ...] | None

#: What stands for the default.
AUTO: Any = "auto"

#: Minimum number of inputs for an estimate of their scatter.
_MIN_GROUPS = 4


def input_groups(input_dofs: Sequence[str]) -> Groups:
    """Return a group per input column where there are at least four, else None."""
    return tuple(input_dofs) if len(input_dofs) >= _MIN_GROUPS else None


def run_groups(count: int) -> Groups:
    """Return a group per run where there are several, else None."""
    return tuple(f"run {k + 1}" for k in range(count)) if count > 1 else None


def chosen_groups(groups: Groups, parts: Sequence[int]) -> Groups:
    """Return the labels of some of the parts."""
    return None if groups is None else tuple(groups[k] for k in parts)


def check_groups(groups: Any, count: int, part: str, default: Groups) -> Groups:
    """Return the groups of `count` parts: one label each, None, or the default for "auto".

    `groups`: parts of the same label belong together. `count`: how many parts there are. `part`: what a part is, in words. `default`:
    what "auto" stands for.

    Raises `DataError`: another number of labels than parts.
    """
    if groups is None or (isinstance(groups, str) and groups == AUTO):
        return default if groups is not None else None
    labels = tuple(str(label) for label in check_each("groups", groups, f"one label per {part}"))
    if len(labels) != count:
        raise DataError(
            f"groups needs {count} labels, one per {part}", f"{len(labels)} are given", "Give all, or groups=None."
        )
    return labels


#: Where a Markov sequence came from (see `ImpulseResponse`).
KINDS = ("pulse", "dirac", "correlation", "free decay")

Units = tuple[tuple[str, ...], tuple[str, ...]]
_UNIT_FORMS = "one unit, or a pair for outputs and inputs"


#: Names of responses to a force, and the quantity of their outputs.
_RESPONSES = {
    "receptance": "displacement",
    "compliance": "displacement",
    "mobility": "velocity",
    "inertance": "acceleration",
    "accelerance": "acceleration",
}


def check_quantity(quantity: str | None) -> str | None:
    """Return the quantity, of a response by name that of its outputs, or raise when it is none of these, or None."""
    named = _RESPONSES.get(quantity.lower(), quantity) if isinstance(quantity, str) else quantity
    return None if named is None else check_choice("quantity", named, QUANTITIES)


def one_channel(values: Any, axes: int = 2) -> Any:
    """Return a single channel, given along one axis, with all its axes; others as they are."""
    listed = isinstance(values, list | tuple) and bool(values) and all(isinstance(v, Number) for v in values)
    return np.reshape(values, (-1, *[1] * (axes - 1))) if listed or getattr(values, "ndim", 0) == 1 else values


def derivatives_between(quantity: str | None, wanted: str) -> int:
    """Return how often `quantity` is differentiated to give `wanted`; an unknown quantity is an error."""
    check_choice("quantity", wanted, QUANTITIES)
    return QUANTITIES[wanted] - QUANTITIES[known_quantity(quantity, f"the response as {wanted}:")]


def known_quantity(quantity: str | None, asked: str, *, lost: str = "", otherwise: str = "") -> str:
    """Return the quantity of a response, or raise when it is not known: what is lost with it, and another way out."""
    if quantity is None:
        remedy = f'Give quantity="displacement", "velocity" or "acceleration" with the data{otherwise}.'
        raise DataError(asked, f"the quantity of the response is not known{lost}", remedy)
    return quantity


def _one_side(name: str, unit: str | Sequence[str] | None, count: int) -> tuple[str, ...]:
    if unit is None:
        return ("",) * count
    if isinstance(unit, str):
        return (unit,) * count
    each = check_each(f"units of the {name}", unit, "one unit, or one per channel")
    if len(each) != count:
        raise DataError(f"{name} needs {count} units", f"there are {len(each)}", "Give one, or one per channel.")
    return tuple(str(u) for u in each)


Chosen = Iterable[DofLike] | DofLike | None


def choose_channels(
    output_dofs: Sequence[str], input_dofs: Sequence[str], outputs: Chosen, inputs: Chosen, exclude: Chosen
) -> tuple[list[int], list[int]]:
    """Return the indices of the outputs and of the inputs that are chosen (see `Channels.select`)."""
    rows = list(range(len(output_dofs))) if outputs is None else indices_of("output", outputs, output_dofs)
    columns = list(range(len(input_dofs))) if inputs is None else indices_of("input", inputs, input_dofs)
    if exclude is not None:
        out = set(excluded_labels(output_dofs, input_dofs, exclude))
        rows = [i for i in rows if output_dofs[i] not in out]
        kept = [i for i in columns if input_dofs[i] not in out]
        if columns and not kept:
            raise DataError(f"excluding {', '.join(sorted(out))}:", "that leaves no input", "Exclude fewer.")
        columns = kept
    if not rows:
        raise DataError("a choice of channels needs at least one output", "none is left", "Exclude fewer channels.")
    return rows, columns


def excluded_labels(output_dofs: Sequence[str], input_dofs: Sequence[str], exclude: Chosen) -> tuple[str, ...]:
    """Return the labels of channels to exclude, on whichever side they stand; indices count the outputs first."""
    both = (*output_dofs, *(dof for dof in input_dofs if dof not in output_dofs))
    return () if exclude is None else tuple(both[i] for i in indices_of("channel to exclude", exclude, both))


#: Words for places that carry the motion of a base, as archives of strong motion call their channels, and words for places that ride on
#: the structure, whatever lies near them.
_BASE_WORDS = {
    *("ground", "grnd", "base", "table", "shaketable", "basement", "foundation", "footing", "footings", "freefield"),
    *("embankment", "abutment", "abut", "support", "pile", "pilecap"),
    *("boden", "fundament", "suelo", "sol", "fondation", "fondazione", "terreno"),
}
_STRUCTURE_WORDS = {"deck", "girder", "roof", "floor", "span", "near", "nr", "above", "top"}


def names_base(label: str) -> bool:
    """Whether a label names a place that moves the structure, rather than one that it moves.

    Examples
    --------
    >>> names_base("4 base of center column 360"), names_base("South embankment"), names_base("3 deck, near abutment")
    (True, True, False)
    >>> names_base("Ground level"), names_base("N Abut 90"), names_base("Ground floor slab, top")
    (True, True, False)
    """
    words = {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", label)}
    return (not _BASE_WORDS.isdisjoint(words) and _STRUCTURE_WORDS.isdisjoint(words)) or "free field" in label.lower()


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Channels(Shown, ABC):
    """Labels, units, geometry and history, common to `Signals`, `ImpulseResponse` and `FrequencyResponse`.

    Parameters
    ----------
    output_dofs, input_dofs : sequence of labels, optional
        Strings such as `3:+Z`, or pairs (node, direction). Without them the channels are called y1, y2, ... and u1, u2, ...
    units : str or (outputs, inputs), optional
        One unit for all outputs, of responses also that of all ("m/s2/N"), or a pair; each of its sides is one unit or one per channel.
        Records without inputs take a list of one per output, too. They say the quantity of the outputs where that is not given.
    geometry : Geometry, optional
        Where the channels are.
    processing : sequence of str, optional
        What was done to the data so far, in words.
    source_path : path or paths, optional
        The file that the data came from, or the files: none of them is overwritten.
    """

    output_dofs: tuple[str, ...] = None  # type: ignore[assignment]
    input_dofs: tuple[str, ...] = None  # type: ignore[assignment]
    units: Units = None  # type: ignore[assignment]
    geometry: Geometry | None = None
    processing: tuple[str, ...] = ()
    source_path: SourcePath = field(default=None, compare=False)

    def _label(self, outputs: int, inputs: int) -> bool:
        """Take labels and units, and return whether a unit stands for several channels: then it says their quantity, too."""
        units: Any = self.units
        pair = [units, None] if units is None or isinstance(units, str) else check_each("units", units, _UNIT_FORMS)
        said = any(isinstance(side, str) for side in pair)
        if not inputs and isinstance(units, list) and len(pair) == outputs:
            pair = [pair, None]
        if len(pair) != 2:
            raise DataError(f"units needs {_UNIT_FORMS}", f"{len(pair)} are given", 'Give units=("m/s2", "N").')
        if self.geometry is not None:
            check_kind("geometry", self.geometry, Geometry)
        steps = [self.processing] if isinstance(self.processing, str) else self.processing
        freeze(
            self,
            output_dofs=check_labels("output_dofs", self.output_dofs, outputs, "y"),
            input_dofs=check_labels("input_dofs", self.input_dofs, inputs, "u"),
            units=(_one_side("outputs", pair[0], outputs), _one_side("inputs", pair[1], inputs)),
            processing=tuple(str(step) for step in check_each("processing", steps, "one text per step")),
            source_path=check_source(self.source_path),
        )
        return said

    def _cut(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        """Return the changed fields for a choice of channels; data classes add their own arrays."""
        return {
            "output_dofs": tuple(self.output_dofs[i] for i in outputs),
            "input_dofs": tuple(self.input_dofs[i] for i in inputs),
            "units": (tuple(self.units[0][i] for i in outputs), tuple(self.units[1][i] for i in inputs)),
        }

    def labelled(self) -> dict[str, Any]:
        """Return labels, units, geometry, history and file by name, for other data of the same channels."""
        return {each.name: getattr(self, each.name) for each in fields(Channels)}

    def to_xarray(self) -> Any:
        """Return an xarray Dataset: the same arrays with names, labels, frequencies or times on their axes.

        Raises
        ------
        DataError
            xarray is missing: the extra `netcdf` brings it; or data that stay in their file.
        """
        return import_module("modalscope.data.named_axes").dataset(self)

    def processed(self, step: str) -> Self:
        """Return the same data with one more step of processing written down.

        Parameters
        ----------
        step : str
            What was done, in words.
        """
        return replace(self, processing=(*self.processing, step))

    def select(self, outputs: Chosen = None, inputs: Chosen = None, exclude: Chosen = None) -> Self:
        """Return some of the channels, named by label or counted from zero.

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
        return replace(self, **self._cut(rows, columns), **self._arrays(rows, columns))

    @abstractmethod
    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        """Return the arrays for a choice of channels."""
