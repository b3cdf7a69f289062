"""The fields of modes: what each must be, and how they are cut and joined together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.candidates import candidates_of, harmonics_of
from modalscope.model.channels import check_quantity
from modalscope.model.checks import (
    ComplexArray,
    DataError,
    IntArray,
    RealArray,
    check_each,
    check_kind,
    check_positive,
    complex_array,
    real_array,
    sealed,
)
from modalscope.model.mode_table import COLUMNS
from modalscope.model.notes import notes_of
from modalscope.model.sources import source_of

if TYPE_CHECKING:
    from modalscope.model.modes import ModalModel

__all__ = ["DIRECT", "PER_MODE", "checked_fields", "joined", "mode_indices", "taken_fields"]

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

    Parameters
    ----------
    parts : sequence of ModalModel
        At least one.
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
