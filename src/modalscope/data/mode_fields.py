"""Define the fields of modes: validation, selection, joining, candidates, and rows of tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import check_quantity, source_of
from modalscope.data.notes import notes_of
from modalscope.numerics.checks import (
    ComplexArray,
    IntArray,
    RealArray,
    check_count,
    check_each,
    check_kind,
    check_number,
    check_positive,
    complex_array,
    freeze,
    real_array,
    sealed,
)
from modalscope.numerics.errors import DataError
from modalscope.numerics.extras import optional_package

if TYPE_CHECKING:
    from modalscope.data.modes import ModalModel

# ---------------------------------------------------------------------------------------------------------- candidates
# What stands beside the modes of a result: candidates that were left out, and harmonics of turning machines.


class _Row:
    """Data that are one entry of a list in a JSON file: the frequency is told as `frequency_hz`."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as the JSON module writes them; null for what is not known."""
        row = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        known = {name: None if isinstance(v, float) and not np.isfinite(v) else v for name, v in row.items()}
        return {"frequency_hz": known.pop("frequency"), **known}

    @classmethod
    def from_dict(cls, entries: Mapping[str, Any]) -> Self:
        """Take back what `to_dict` gave; entries of later versions are left."""
        check_kind("an entry of the file", entries, Mapping)
        named = {"frequency" if name == "frequency_hz" else name: value for name, value in entries.items()}
        known = {each.name: named[each.name] for each in fields(cls) if each.name in named}  # type: ignore[arg-type]
        try:
            return cls(**known)
        except TypeError:  # an entry that has no default
            raise DataError(
                f"an entry of a {cls.__name__} was asked", f"it has only {', '.join(entries)}", "Write the file again."
            ) from None


@dataclass(frozen=True, kw_only=True, slots=True)
class Candidate(_Row):
    """A pole that looked like a mode and was not reported.

    `frequency`: hz. `gain`: by how many standard deviations the data are explained better with it; NaN where that is not known. `reason`:
    why it was left out, in one sentence. `remedy`: what to do to have it reported, or to be rid of it.
    """

    frequency: float
    damping_ratio: float
    gain: float = np.nan
    reason: str = ""
    remedy: str = ""

    def __post_init__(self) -> None:
        check_kind("reason", self.reason, str)
        check_kind("remedy", self.remedy, str)
        freeze(
            self,
            frequency=check_number("frequency", self.frequency),
            damping_ratio=check_number("damping_ratio", self.damping_ratio),
            gain=_or_unknown("gain", self.gain),
        )

    def __str__(self) -> str:
        return f"{self.frequency:.4g} Hz, {100 * self.damping_ratio:.3g} %: {self.reason}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Harmonic(_Row):
    """A line of a turning machine, which is no mode.

    `frequency`: hz. `order`: which multiple of the shaft line it is; None where there is no such line. `level`: its root mean square over
    that of all outputs together. `evidence`: what shows that it is no mode, in words.
    """

    frequency: float
    order: int | None = None
    level: float = np.nan
    evidence: str = ""

    def __post_init__(self) -> None:
        check_kind("evidence", self.evidence, str)
        freeze(
            self,
            frequency=check_number("frequency", self.frequency),
            order=None if self.order is None else check_count("order", self.order),
            level=_or_unknown("level", self.level),
        )

    def __str__(self) -> str:
        which = "" if self.order is None else f", order {self.order} of the shaft line"
        return f"{self.frequency:.4g} Hz{which}: {self.evidence}"


def _or_unknown(name: str, value: Any) -> float:
    """Return a finite number; NaN for None and NaN, and an infinite number as it is."""
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return np.nan
    return value if isinstance(value, float) and np.isinf(value) else check_number(name, value)


_Kind = TypeVar("_Kind", Candidate, Harmonic)


def _rows_of(name: str, kind: type[_Kind], values: Any) -> tuple[_Kind, ...]:
    each = check_each(name, values, f"a list of {kind.__name__}")
    for value in each:
        check_kind(f"each of {name}", value, (kind, Mapping))
    return tuple(value if isinstance(value, kind) else kind.from_dict(value) for value in each)


def candidates_of(values: Iterable[Candidate | Mapping[str, Any]]) -> tuple[Candidate, ...]:
    """Return candidates as a tuple; what `to_dict` gave becomes one again."""
    return _rows_of("left_out", Candidate, values)


def harmonics_of(values: Iterable[Harmonic | Mapping[str, Any]]) -> tuple[Harmonic, ...]:
    """Return harmonics as a tuple; what `to_dict` gave becomes one again."""
    return _rows_of("harmonics", Harmonic, values)


# ---------------------------------------------------------------------------------------------------------- mode table
# Modes as a table: text for people, a data frame for programs, and the names that every file gives to the columns.

#: Column -> field: one number a mode, or nothing.
COLUMNS = {
    "frequency_spread_hz": "frequencies_spread",
    "damping_ratio_spread": "damping_ratios_spread",
    "frequency_std_hz": "frequencies_std",
    "damping_ratio_std": "damping_ratios_std",
    "frequency_repeatability_hz": "frequencies_repeatability",
    "damping_ratio_repeatability": "damping_ratios_repeatability",
    "gain": "gain",
}


def known_columns(modes: ModalModel) -> dict[str, Any]:
    """Return what is known of each mode, by column: frequency, damping ratio, kind, deviations, gain, indicators."""
    optional = {column: getattr(modes, field) for column, field in COLUMNS.items()}
    return {
        "frequency_hz": modes.frequencies,
        "damping_ratio": modes.damping_ratios,
        "kind": modes.kinds,
        **{column: values for column, values in optional.items() if values is not None},
        **modes.indicators,
    }


def as_text(modes: ModalModel) -> str:
    """Return the modes as a text table: frequency, damping, deviations, gain, indicators."""
    rows = cells_of_modes(modes)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in rows)


def cells_of_modes(modes: ModalModel) -> list[list[str]]:
    """Return the table of modes as text, cell by cell, the first row its heads."""
    columns: dict[str, list[str]] = {
        "mode": [str(i + 1) for i in range(len(modes))],
        "f [Hz]": [f"{v:.4f}" for v in modes.frequencies],
        "zeta [%]": [f"{100 * v:.3f}" for v in modes.damping_ratios],
    }
    if any(kind != "mode" for kind in modes.kinds):
        columns["kind"] = list(modes.kinds)
    for word, frequencies, damping_ratios in (
        ("spread", modes.frequencies_spread, modes.damping_ratios_spread),
        ("+-noise", modes.frequencies_std, modes.damping_ratios_std),
        ("+-repeat", modes.frequencies_repeatability, modes.damping_ratios_repeatability),
    ):
        if frequencies is not None:
            columns[f"f {word}"] = [told(v) for v in frequencies]
        if damping_ratios is not None:
            columns[f"zeta {word}"] = [told(100 * v) for v in damping_ratios]
    if modes.gain is not None:
        columns["gain"] = [_fixed(v, 1) for v in modes.gain]
    for name, values in modes.indicators.items():
        columns[name] = [_fixed(v, 3) for v in values]
    return [list(columns), *map(list, zip(*columns.values(), strict=True))]


def told(deviation: float) -> str:
    """Return a deviation with two digits; a dash where it is withheld.

    Examples
    --------
    >>> told(0.01234), told(float("nan"))
    ('0.012', '-')
    """
    return f"{deviation:.2g}" if deviation == deviation else "-"


def _fixed(value: float, decimals: int) -> str:
    """Return a number with that many decimals; a dash where there is none, as of modes that no order of the diagram shows."""
    return f"{value:.{decimals}f}" if value == value else "-"


def as_dataframe(modes: ModalModel) -> Any:
    """Return the table as a pandas DataFrame, in the columns of the files (see `ModalModel.to_dataframe`)."""
    pandas = optional_package("to_dataframe", "pandas", "pandas")
    return pandas.DataFrame(known_columns(modes))


# --------------------------------------------------------------------------------------------------------- mode fields

#: Fields that hold one number a mode, or nothing.
PER_MODE = tuple(COLUMNS.values())

#: Fields that hold one number an output and input, or nothing: they belong to no mode.
DIRECT = ("feedthrough", "lower_residual", "upper_residual")


def checked_fields(modes: ModalModel) -> dict[str, Any]:
    """Return the validated fields, or raise for the first that does not fit the others."""
    poles = complex_array("poles", modes.poles, "(modes,)", 1)
    shapes = complex_array("shapes", modes.shapes, "(outputs, modes)", 2)
    if shapes.shape[1] != poles.size:
        raise DataError(
            f"{poles.size} poles need {poles.size} shapes as columns",
            f"shapes has shape {shapes.shape}",
            "Transpose or complete the shapes.",
        )
    part = _participation(modes.participation, poles.size)
    channels = (len(shapes), None if part is None else part.shape[1])
    for name, value, kind in (
        ("indicators", modes.indicators, Mapping),
        ("held_input", modes.held_input, bool),
        ("scaling", modes.scaling, str),
    ):
        check_kind(name, value, kind)
    if modes.converged is not None:
        check_kind("converged", modes.converged, bool)
    return {
        "poles": poles,
        "shapes": shapes,
        "participation": part,
        "shapes_std": _beside_shapes(modes.shapes_std, shapes.shape),
        "dt": None if modes.dt is None else check_positive("dt", modes.dt),
        **{name: _direct(name, getattr(modes, name), channels) for name in DIRECT},
        **{name: _a_mode(name, getattr(modes, name), poles.size) for name in PER_MODE},
        "indicators": {name: _a_mode(name, values, poles.size) for name, values in modes.indicators.items()},
        "reasons": _reasons(modes.reasons, poles.size),
        "quantity": check_quantity(modes.quantity),
        "notes": notes_of(modes.notes),
        "left_out": candidates_of(modes.left_out),
        "harmonics": harmonics_of(modes.harmonics),
        "unrefined": _unrefined(modes.unrefined, type(modes), poles.size),
    }


def _participation(values: ArrayLike | None, count: int) -> ComplexArray | None:
    if values is None:
        return None
    part = complex_array("participation", values, "(modes, inputs)", 2)
    if part.shape[0] != count:
        raise DataError(
            f"{count} poles need {count} rows of participation",
            f"participation has shape {part.shape}",
            "Transpose or complete it.",
        )
    return part


def _beside_shapes(values: ArrayLike | None, shape: tuple[int, ...]) -> RealArray | None:
    if values is None:
        return None
    array = real_array("shapes_std", values, "(outputs, modes)", 2, finite=False)
    if array.shape != shape:
        raise DataError(f"shapes_std needs the shape of shapes, {shape}", f"it has {array.shape}", "Give one each.")
    return array


def _direct(name: str, values: ArrayLike | None, channels: tuple[int, int | None]) -> RealArray | None:
    if values is None:
        return None
    array = real_array(name, values, "(outputs, inputs)", 2)
    outputs, inputs = channels
    if array.shape != (outputs, array.shape[1] if inputs is None else inputs):
        raise DataError(
            f"{name} needs one entry for each of {outputs} outputs and {inputs} inputs",
            f"its shape is {array.shape}",
            "Transpose or complete it.",
        )
    return array


def _a_mode(name: str, values: ArrayLike | None, count: int) -> RealArray | None:
    if values is None:
        return None
    array = real_array(name, values, "(modes,)", 1, finite=False)
    if array.size != count:
        raise DataError(f"{name} needs {count} entries, one a mode", f"it has {array.size}", "Give one a mode.")
    return array


def _reasons(values: Any, count: int) -> tuple[dict[str, Any], ...]:
    """Return the reasons, checked: none, or one a mode."""
    reasons = check_each("reasons", values, "one mapping a mode")
    if len(reasons) not in (0, count):
        raise DataError(f"{count} modes need {count} reasons or none", f"there are {len(reasons)}", "Give one a mode.")
    for reason in reasons:
        check_kind("each of the reasons", reason, Mapping)
    return tuple(dict(reason) for reason in reasons)


def _unrefined(before: Any, kind: type[ModalModel], count: int) -> ModalModel | None:
    if before is not None:
        check_kind("unrefined", before, kind)
        if len(before) != count:
            raise DataError(
                f"unrefined needs {count} modes, one for each that was refined",
                f"it has {len(before)}",
                "Give the same modes before refinement, in the same order.",
            )
    return before  # type: ignore[no-any-return]


def mode_indices(which: ArrayLike, count: int) -> IntArray:
    """Return the indices of the modes that are chosen by number or by one bool each."""
    index = np.atleast_1d(np.asarray(which))
    if index.dtype == bool and index.shape == (count,):
        return np.flatnonzero(index)
    if index.size == 0:
        return np.zeros(0, dtype=np.intp)
    if index.dtype.kind not in "iu" or index.ndim != 1:
        raise DataError(
            "modes were asked by number, counted from 0, or by one bool each",
            f"{which!r} was given to choose of {count}",
            "Give a list such as [0, 2], or a condition on all modes.",
        )
    if index.min() < -count or index.max() >= count:
        raise DataError(
            f"mode {index.max() if index.max() >= count else index.min()} was asked",
            f"there are {count}, counted from 0",
            "Choose modes that are there.",
        )
    return index.astype(np.intp) % count


def taken_fields(modes: ModalModel, index: IntArray) -> dict[str, Any]:
    """Return all that belongs to some of the modes."""
    first = {name: getattr(modes, name) for name in ("participation", *PER_MODE)}
    return {
        "poles": modes.poles[index],
        "shapes": sealed(np.take(modes.shapes, index, axis=1)),
        "shapes_std": None if modes.shapes_std is None else modes.shapes_std[:, index],
        **{name: None if values is None else values[index] for name, values in first.items()},
        "indicators": {name: values[index] for name, values in modes.indicators.items()},
        "reasons": tuple(modes.reasons[i] for i in index) if modes.reasons else (),
        "unrefined": None if modes.unrefined is None else modes.unrefined.take(index),
    }


def joined(parts: Sequence[ModalModel]) -> ModalModel:
    """Return all modes one after the other, such as those of several bands; the channels of all must be the same.

    What is not known of every part, and what belongs to a part as a whole (direct terms, residuals), is left out; notes,
    candidates and harmonics of all are kept.

    `parts`: at least one.
    """
    first = parts[0]
    known: dict[str, Any] = dict.fromkeys(DIRECT)
    for name, axis in (
        *((name, 0) for name in (*PER_MODE, "participation", "poles")),
        ("shapes", 1),
        ("shapes_std", 1),
    ):
        arrays = [getattr(part, name) for part in parts]
        known[name] = None if any(a is None for a in arrays) else np.concatenate(arrays, axis=axis)
    names = set.intersection(*(set(part.indicators) for part in parts))
    before = [part.unrefined for part in parts if part.unrefined is not None]
    converged = [part.converged for part in parts]
    return replace(
        first,
        **known,
        indicators={name: np.concatenate([part.indicators[name] for part in parts]) for name in sorted(names)},
        reasons=tuple(r for p in parts for r in p.reasons) if all(len(p.reasons) == len(p) for p in parts) else (),
        scaling=first.scaling if len({part.scaling for part in parts}) == 1 else "as in each part",
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        left_out=tuple(each for part in parts for each in part.left_out),
        harmonics=tuple(dict.fromkeys(each for part in parts for each in part.harmonics)),
        unrefined=joined(before) if len(before) == len(parts) else None,
        source_path=source_of(parts),
        converged=None if None in converged else all(converged),
    )
