"""Define the fields of modes: checks, choice, joining, and the sums over modes that give responses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from modalscope.data.channels import Channels, check_quantity, derivatives_between, source_of
from modalscope.data.notes import Candidate, Harmonic, Note, notes_of, rows_of
from modalscope.data.residual_terms import ResidualTerms
from modalscope.data.shown import figures
from modalscope.numerics.checks import (
    BoolArray,
    ComplexArray,
    IntArray,
    RealArray,
    check_count,
    check_each,
    check_kind,
    check_positive,
    check_shape,
    complex_array,
    freeze,
    optional_array,
    sealed,
)
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import HasPoles, is_real, to_discrete

#: Column -> field: one number per mode, or nothing.
COLUMNS = {
    "frequency_spread_hz": "frequencies_spread",
    "damping_ratio_spread": "damping_ratios_spread",
    "frequency_std_hz": "frequencies_std",
    "damping_ratio_std": "damping_ratios_std",
    "frequency_repeatability_hz": "frequencies_repeatability",
    "damping_ratio_repeatability": "damping_ratios_repeatability",
    "damping_ratio_lower": "damping_ratios_lower",
    "gain": "gain",
}

#: Columns of the degrees of freedom, (n, 2), in tables.
DEGREES = ("frequency_degrees", "damping_ratio_degrees")

#: Half width of the logarithm of a damping ratio, at most: its exponential is a number.
_MAX_LOG = 700.0

#: Fields that hold one number per mode, or nothing.
PER_MODE = tuple(COLUMNS.values())

#: Columns of `ModalModel.columns` that follow from others: readers leave them out.
DERIVED = (
    "frequency_95_low_hz",
    "frequency_95_high_hz",
    "damping_ratio_95_low",
    "damping_ratio_95_high",
    "grade",
    "reason",
)

#: Fields that hold one number per output and input, or nothing: they belong to no mode.
DIRECT = ("feedthrough", "lower_residual", "upper_residual")


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class ModeFields(Channels, HasPoles):
    """Poles, shapes and all that belongs to modes, checked (see `ModalModel` for the fields)."""

    poles: ComplexArray
    shapes: ComplexArray
    participation: ComplexArray | None = None
    feedthrough: RealArray | None = None
    lower_residual: RealArray | None = None
    upper_residual: RealArray | None = None
    residual_terms: tuple[ResidualTerms, ...] = ()
    quantity: str | None = None
    dt: float | None = None
    held_input: bool = False
    frequencies_spread: RealArray | None = None
    damping_ratios_spread: RealArray | None = None
    frequencies_std: RealArray | None = None
    damping_ratios_std: RealArray | None = None
    shapes_std: RealArray | None = None
    frequencies_repeatability: RealArray | None = None
    damping_ratios_repeatability: RealArray | None = None
    damping_ratios_lower: RealArray | None = None
    degrees: RealArray | None = None
    gain: RealArray | None = None
    indicators: Mapping[str, RealArray] = field(default_factory=dict)
    reasons: tuple[Mapping[str, Any], ...] = ()
    scaling: str = "as identified"
    notes: tuple[Note, ...] = ()
    left_out: tuple[Candidate, ...] = ()
    harmonics: tuple[Harmonic, ...] = ()
    unrefined: Self | None = None
    converged: bool | None = None

    def __post_init__(self) -> None:
        poles = complex_array("poles", self.poles, "(modes,)", 1)
        n = poles.size
        shapes = complex_array("shapes", self.shapes, "(outputs, modes)", 2)
        check_shape("shapes", shapes, "(outputs, modes)", (None, n))
        participation = optional_array(
            "participation", self.participation, "(modes, inputs)", (n, None), make=complex_array
        )
        channels = (len(shapes), None if participation is None else participation.shape[1])
        check_kind("indicators", self.indicators, Mapping)
        check_kind("held_input", self.held_input, bool)
        check_kind("scaling", self.scaling, str)
        if self.converged is not None:
            check_kind("converged", self.converged, bool)
        if self.unrefined is not None:
            check_kind("unrefined", self.unrefined, type(self))
        reasons = check_each("reasons", self.reasons, "one mapping a mode")
        for reason in reasons:
            check_kind("each of the reasons", reason, Mapping)
        for name, count in (
            ("reasons", len(reasons) or n),
            ("unrefined", n if self.unrefined is None else len(self.unrefined)),
        ):
            if count != n:
                raise DataError(f"{name} needs one entry per mode, {n}", f"it has {count}", "Give all, or none.")
        terms = rows_of("residual_terms", ResidualTerms, self.residual_terms)
        if any(each.channels != channels for each in terms):
            have = f"they have {terms[0].channels[0]} outputs and {terms[0].channels[1]} inputs"
            raise DataError("residual terms need the channels of the modes", have, "Fit them again, or leave them out.")
        a_mode = {name: getattr(self, name) for name in PER_MODE}
        freeze(
            self,
            poles=poles,
            shapes=shapes,
            participation=participation,
            shapes_std=optional_array("shapes_std", self.shapes_std, "(outputs, modes)", shapes.shape, finite=False),
            degrees=optional_array("degrees", self.degrees, "(modes, 2)", (n, 2), finite=False),
            dt=None if self.dt is None else check_positive("dt", self.dt),
            **{name: optional_array(name, getattr(self, name), "(outputs, inputs)", channels) for name in DIRECT},
            **{name: optional_array(name, values, "(modes,)", (n,), finite=False) for name, values in a_mode.items()},
            indicators={
                name: optional_array(name, values, "(modes,)", (n,), finite=False)
                for name, values in self.indicators.items()
            },
            reasons=tuple(map(dict, reasons)),
            residual_terms=terms,
            quantity=check_quantity(self.quantity),
            notes=notes_of(self.notes),
            left_out=rows_of("left_out", Candidate, self.left_out),
            harmonics=rows_of("harmonics", Harmonic, self.harmonics),
        )
        self._label(len(shapes), channels[1] or 0)

    def __len__(self) -> int:
        return int(self.poles.size)

    def take(self, modes: ArrayLike) -> Self:
        """Return some of the modes, with all that belongs to them.

        Parameters
        ----------
        modes : array of int or bool
            Which, counted from zero.

        Raises
        ------
        DataError
            A mode that is not there.
        """
        index = mode_indices(modes, len(self))
        rows = {name: getattr(self, name) for name in ("participation", "degrees", *PER_MODE)}
        fields: dict[str, Any] = {name: None if values is None else values[index] for name, values in rows.items()}
        fields |= {
            "poles": self.poles[index],
            "shapes": sealed(np.take(self.shapes, index, axis=1)),
            "shapes_std": None if self.shapes_std is None else self.shapes_std[:, index],
            "indicators": {name: values[index] for name, values in self.indicators.items()},
            "reasons": tuple(self.reasons[i] for i in index) if self.reasons else (),
            "unrefined": None if self.unrefined is None else self.unrefined.take(index),
        }
        return replace(self, **fields)

    def noted(self, notes: Iterable[Note | str] | Note | str) -> Self:
        """Return the same modes with more notes.

        Parameters
        ----------
        notes : Note, str, or a sequence of them
        """
        return replace(self, notes=(*self.notes, *notes_of(notes)))

    def known_participation(self, asked: str) -> ComplexArray:
        """Return the participation, or raise where it is not known.

        Parameters
        ----------
        asked : str
            What it is needed for.
        """
        if self.participation is None:
            raise DataError(f"{asked}:", "participation is not known", "Identify from data with inputs or references.")
        return self.participation

    def _cut(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        direct = {name: None if (a := getattr(self, name)) is None else a[np.ix_(outputs, inputs)] for name in DIRECT}
        return {**Channels._cut(self, outputs, inputs), **direct}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {
            "residual_terms": tuple(each.select(outputs, inputs) for each in self.residual_terms),
            "shapes": self.shapes[outputs],
            "shapes_std": None if self.shapes_std is None else self.shapes_std[outputs],
            "participation": None if self.participation is None else self.participation[:, inputs],
            "unrefined": None if self.unrefined is None else self.unrefined.select(outputs=outputs, inputs=inputs),
        }


def mode_indices(which: ArrayLike, count: int) -> IntArray:
    """Return the indices of the modes that are chosen by number or by one bool each."""
    index = np.atleast_1d(np.asarray(which))
    if index.dtype == bool and index.shape == (count,):
        return np.flatnonzero(index)
    if index.size == 0:
        return np.zeros(0, dtype=np.intp)
    if index.dtype.kind not in "iu" or index.ndim != 1:
        raise DataError(
            "modes are chosen by number, counted from 0, or by one bool per mode",
            f"{which!r} was given for {count} modes",
            "Give a list such as [0, 2], or a condition on all modes.",
        )
    if index.min() < -count or index.max() >= count:
        raise DataError(
            f"mode {index.max() if index.max() >= count else index.min()}:",
            f"there are {count}, counted from 0",
            "Choose others.",
        )
    return index.astype(np.intp) % count


#: Half-width of the 95 % interval of a normal distribution, in standard deviations.
NORMAL_HALF_WIDTH = 1.96

_Modes = TypeVar("_Modes", bound=ModeFields)


def joined(parts: Sequence[_Modes]) -> _Modes:
    """Return all modes one after the other, such as those of several bands; the channels of all must be the same.

    What is not known of every part, and what belongs to a part as a whole (direct and residual terms), is left out; notes,
    candidates and harmonics of all are kept.

    `parts`: at least one.
    """
    first = parts[0]
    known: dict[str, Any] = {**dict.fromkeys(DIRECT), "residual_terms": ()}
    for name, axis in (
        *((name, 0) for name in (*PER_MODE, "degrees", "participation", "poles")),
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


def degrees_of(modes: ModeFields) -> RealArray:
    """Return the degrees of freedom of deviations of frequency and damping, (n, 2): of few parts of a record as their note says."""
    parts = [note.numbers["degrees_of_freedom"] for note in modes.notes if "degrees_of_freedom" in note.numbers]
    return np.full((len(modes), 2), min(parts, default=np.inf)) if modes.degrees is None else modes.degrees


def interval_ends(modes: ModeFields, level: float) -> tuple[RealArray, RealArray]:
    """Return the ends of intervals of frequencies and of damping ratios, (n, 2) each: see `ModalModel.interval`."""
    degrees = degrees_of(modes)
    quantile = stdtrit(np.where(degrees == 0, np.nan, np.where(np.isnan(degrees), np.inf, degrees)), (1 + level) / 2)
    half = []
    for t, fields in zip(quantile.T, ("frequencies", "damping_ratios"), strict=True):
        sigmas = [x for end in ("std", "repeatability") if (x := getattr(modes, f"{fields}_{end}")) is not None]
        half.append(t * np.maximum.reduce(sigmas or [np.full(len(modes), np.nan)]))
    f, zeta = modes.frequencies, modes.damping_ratios
    low = zeta if modes.damping_ratios_lower is None else np.fmin(zeta, modes.damping_ratios_lower)
    # a decaying mode has no damping ratio below zero: its error is alike on the scale of the logarithm
    part = np.minimum(half[1] / np.where(zeta > 0, zeta, np.inf), _MAX_LOG)
    below, above = np.where(zeta > 0, low * np.exp(-part), zeta - half[1]), zeta * np.exp(part)
    return np.column_stack([f - half[0], f + half[0]]), np.column_stack(
        [below, np.where(zeta > 0, above, zeta + half[1])]
    )


def half_widths(modes: ModeFields) -> tuple[RealArray, RealArray]:
    """Return the half-widths of the 95 % intervals of frequencies (Hz) and damping ratios; NaN where they are not known.

    Those of damping ratios are in the logarithm, where intervals are symmetric, times the value.
    """
    (f, both), zeta = interval_ends(modes, 0.95), np.maximum(modes.damping_ratios, 1e-300)
    half = np.ptp(both, axis=1) / 2
    return np.ptp(f, axis=1) / 2, np.where(modes.damping_ratios > 0, zeta * np.arcsinh(half / zeta), half)


def known_columns(modes: ModeFields) -> dict[str, Any]:
    """Return what is known of each mode, by column: frequency, damping ratio, kind, deviations, gain, indicators."""
    optional = {column: getattr(modes, field) for column, field in COLUMNS.items()}
    optional |= {} if modes.degrees is None else dict(zip(DEGREES, modes.degrees.T, strict=True))
    return {
        "frequency_hz": modes.frequencies,
        "damping_ratio": modes.damping_ratios,
        "kind": modes.kinds,
        **{column: values for column, values in optional.items() if values is not None},
        **modes.indicators,
    }


def told(deviation: float) -> str:
    """Return a deviation with two digits; a dash where it is withheld.

    Examples
    --------
    >>> told(0.01234), told(float("nan"))
    ('0.012', '-')
    """
    return figures(deviation, 2) if deviation == deviation else "-"


def values_on_samples(modes: ModeFields, samples: int, rate: float, first_sample: int = 0) -> RealArray:
    """Return sum_j phi_j exp(s_j (k + first_sample) / rate) l_j' and conjugates, (samples, l, m), `rate` in Hz."""
    participation = modes.known_participation("an impulse response")
    times = (np.arange(check_count("samples", samples)) + first_sample) / rate
    decay = np.exp(np.outer(times, modes.poles)) * np.where(_alone(modes), 1.0, 2.0)
    return np.asarray(np.einsum("kj,aj,jb->kab", decay, modes.shapes, participation).real)


def values_on_lines(
    modes: ModeFields, frequencies: RealArray, *, residuals: bool = True, terms: bool = True
) -> ComplexArray:
    """Return sum_j phi_j l_j' / (x - p_j) and conjugates, direct term and residuals on lines in Hz, (F, l, m); no terms without `terms`."""
    participation = modes.known_participation("a frequency response")
    s, poles = 2j * np.pi * frequencies, modes.poles
    x = s
    if modes.dt is not None and modes.held_input:
        x, poles = np.exp(s * modes.dt), to_discrete(poles, modes.dt)
    direct = 1 / (x[:, None] - poles)
    pair = np.where(_alone(modes), 0.0, 1.0) / (x[:, None] - poles.conj())
    values = np.einsum("fj,aj,jb->fab", direct, modes.shapes, participation, optimize=True)
    values = values + np.einsum("fj,aj,jb->fab", pair, modes.shapes.conj(), participation.conj(), optimize=True)
    if modes.feedthrough is not None and terms:
        values = values + modes.feedthrough
    if residuals and terms:
        p = 0 if modes.quantity is None else -derivatives_between(modes.quantity, "displacement")
        for residual, power in ((modes.lower_residual, p - 2), (modes.upper_residual, p)):
            if residual is not None:
                values = values + residual * s[:, None, None] ** power
    return np.asarray(values)


def _alone(modes: ModeFields) -> BoolArray:
    """Which poles stand for no conjugate pair."""
    return np.array([kind in ("real", "nyquist", "zero") for kind in modes.kinds], bool) | is_real(modes.poles, 0.0)
