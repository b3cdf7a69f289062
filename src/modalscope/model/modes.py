"""Modes: poles, shapes and participation, and what they say about a structure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.channels import Channels, check_quantity, derivatives_between
from modalscope.model.checks import (
    ComplexArray,
    DataError,
    RealArray,
    check_choice,
    check_count,
    check_each,
    check_kind,
    check_positive,
    complex_array,
    freeze,
    real_array,
)
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.mode_table import COLUMNS, as_dataframe, as_text
from modalscope.model.notes import Note, notes_of
from modalscope.model.poles import HasPoles, to_discrete

__all__ = ["NORMALIZATIONS", "PER_MODE", "ModalModel"]

#: What shapes can be scaled to (see `ModalModel.normalized`).
NORMALIZATIONS = ("unit", "max", "mass", "none")

_DIRECT = ("feedthrough", "lower_residual", "upper_residual")

#: Fields that hold one number a mode, or nothing.
PER_MODE = tuple(COLUMNS.values())


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ModalModel(Channels, HasPoles):
    """Modes of a structure: one pole of each conjugate pair, and real poles.

    The impulse response is h(t) = sum_j phi_j exp(s_j t) l_j' over the poles and, for each pole off the real axis, its
    conjugate; the frequency response is sum_j phi_j l_j' / (j w - s_j) + conjugates + `feedthrough` + residuals.

    Parameters
    ----------
    poles : array of complex, (n,)
        rad/s.
    shapes : array of complex, (l, n)
        Mode shapes phi_j as columns.
    participation : array of complex, (n, m), optional
        Modal participation l_j as rows: inputs, initial conditions or reference directions.
    feedthrough : array, (l, m), optional
        Direct term.
    lower_residual, upper_residual : array, (l, m), optional
        Contributions of the modes below and above the band: real factors of (j w)^(p-2) and (j w)^p, where p = 0, 1, 2 for
        displacement, velocity and acceleration.
    quantity : str, optional
        Displacement, velocity or acceleration.
    dt : float, optional
        Sampling interval of the system that was identified; None for a continuous one.
    held_input : bool
        The sampled system's participation is that of a held input: H(z) = D + sum phi l' / (z - exp(s dt)).
    frequencies_spread, damping_ratios_spread : array, (n,), optional
        Standard deviation over the orders of a stabilization diagram (Hz, ratio).
    frequencies_std, damping_ratios_std : array, (n,), optional
        Statistical standard deviation (Hz, ratio); None until uncertainty is computed.
    indicators : mapping of name to array (n,)
        Accuracy indicators.
    reasons : tuple of mapping
        For every mode why it is reported.
    scaling : str
        What the shapes are scaled to, in words.
    notes : sequence of Note or str
        What must be told about these modes.
    """

    poles: ComplexArray
    shapes: ComplexArray
    participation: ComplexArray | None = None
    feedthrough: RealArray | None = None
    lower_residual: RealArray | None = None
    upper_residual: RealArray | None = None
    quantity: str | None = None
    dt: float | None = None
    held_input: bool = False
    frequencies_spread: RealArray | None = None
    damping_ratios_spread: RealArray | None = None
    frequencies_std: RealArray | None = None
    damping_ratios_std: RealArray | None = None
    indicators: Mapping[str, RealArray] = field(default_factory=dict)
    reasons: tuple[Mapping[str, Any], ...] = ()
    scaling: str = "as identified"
    notes: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        poles = complex_array("poles", self.poles, "(modes,)", 1)
        shapes = complex_array("shapes", self.shapes, "(outputs, modes)", 2)
        n = poles.size
        if shapes.shape[1] != n:
            raise DataError(
                f"{n} poles need {n} shapes as columns",
                f"shapes has shape {shapes.shape}",
                "Transpose or complete the shapes.",
            )
        part = (
            None
            if self.participation is None
            else complex_array("participation", self.participation, "(modes, inputs)", 2)
        )
        if part is not None and part.shape[0] != n:
            raise DataError(
                f"{n} poles need {n} rows of participation",
                f"participation has shape {part.shape}",
                "Transpose or complete it.",
            )
        direct = {name: self._direct(name, (len(shapes), None if part is None else part.shape[1])) for name in _DIRECT}
        check_kind("indicators", self.indicators, Mapping)
        check_kind("held_input", self.held_input, bool)
        check_kind("scaling", self.scaling, str)
        if self.dt is not None:
            check_positive("dt", self.dt)
        freeze(
            self,
            poles=poles,
            shapes=shapes,
            participation=part,
            **direct,
            **{name: self._a_mode(name, getattr(self, name)) for name in PER_MODE},
            indicators={name: self._a_mode(name, values) for name, values in self.indicators.items()},
            reasons=self._reasons(n),
            quantity=check_quantity(self.quantity),
            notes=notes_of(self.notes),
        )
        self._label(shapes.shape[0], 0 if part is None else part.shape[1])

    def _reasons(self, count: int) -> tuple[dict[str, Any], ...]:
        """Return the reasons, checked: none, or one a mode."""
        reasons = check_each("reasons", self.reasons, "one mapping a mode")
        if len(reasons) not in (0, count):
            raise DataError(
                f"{count} modes need {count} reasons or none", f"there are {len(reasons)}", "Give one a mode."
            )
        for reason in reasons:
            check_kind("each of the reasons", reason, Mapping)
        return tuple(dict(reason) for reason in reasons)

    def _direct(self, name: str, channels: tuple[int, int | None]) -> RealArray | None:
        if getattr(self, name) is None:
            return None
        array = real_array(name, getattr(self, name), "(outputs, inputs)", 2)
        outputs, inputs = channels
        if array.shape != (outputs, array.shape[1] if inputs is None else inputs):
            raise DataError(
                f"{name} needs one entry for each of {outputs} outputs and {inputs} inputs",
                f"its shape is {array.shape}",
                "Transpose or complete it.",
            )
        return array

    def _a_mode(self, name: str, values: ArrayLike | None) -> RealArray | None:
        if values is None:
            return None
        array = real_array(name, values, "(modes,)", 1, finite=False)
        if array.size != len(self.poles):
            raise DataError(
                f"{name} needs {len(self.poles)} entries, one a mode", f"it has {array.size}", "Give one a mode."
            )
        return array

    def __len__(self) -> int:
        return int(self.poles.size)

    @property
    def residues(self) -> ComplexArray:
        """Residue matrices phi_j l_j', (n, l, m)."""
        part = self._need_participation("residues")
        return np.asarray(self.shapes.T[:, :, None] * part[:, None, :])

    def take(self, modes: ArrayLike) -> ModalModel:
        """Return some of the modes.

        Parameters
        ----------
        modes : array of int or bool
            Which, counted from zero.
        """
        index = np.atleast_1d(np.asarray(modes))
        index = np.flatnonzero(index) if index.dtype == bool else index.astype(int)
        known = {name: getattr(self, name) for name in ("participation", *PER_MODE)}
        kept: dict[str, Any] = {name: None if values is None else values[index] for name, values in known.items()}
        return replace(
            self,
            poles=self.poles[index],
            shapes=self.shapes[:, index],
            **kept,
            indicators={name: values[index] for name, values in self.indicators.items()},
            reasons=tuple(self.reasons[i] for i in index) if self.reasons else (),
        )

    def noted(self, notes: Iterable[Note | str] | Note | str) -> ModalModel:
        """Return the same modes with more notes.

        Parameters
        ----------
        notes : Note, str, or a sequence of them
        """
        return replace(self, notes=(*self.notes, *notes_of(notes)))

    def normalized(self, scale: str = "unit") -> ModalModel:
        """Return the modes with shapes scaled as asked; participation takes the inverse, so that residues stay.

        Parameters
        ----------
        scale : {"unit", "max", "mass", "none"}
            Length one with the largest component real and positive; largest component one; unit modal mass, from a
            driving point (an output and an input with the same label): phi_d^2 = 2 j w_d R_dd for the displacement's
            residue R_dd.

        Raises
        ------
        DataError
            "mass" without participation, without a driving point, or without a known quantity.
        """
        check_choice("scale", scale, NORMALIZATIONS)
        if scale == "none" or not len(self):
            return self
        largest = self.shapes[np.argmax(np.abs(self.shapes), axis=0), np.arange(len(self))]
        factor = np.where(largest == 0, 1, largest)
        words = "largest component 1"
        if scale == "unit":
            norm = np.linalg.norm(self.shapes, axis=0)
            factor = np.where(largest == 0, 1, largest / np.where(largest == 0, 1, np.abs(largest))) * np.where(
                norm == 0, 1, norm
            )
            words = "length 1, largest component real"
        elif scale == "mass":
            factor, words = self._mass_factor()
        part = None if self.participation is None else self.participation * factor[:, None]
        return replace(self, shapes=self.shapes / factor, participation=part, scaling=words)

    def _mass_factor(self) -> tuple[ComplexArray, str]:
        """Return the factor that shapes are divided by to have unit modal mass."""
        part = self._need_participation("unit modal mass")
        common = [dof for dof in self.output_dofs if dof in self.input_dofs]
        if not common:
            raise DataError(
                "shapes of unit modal mass were asked",
                "no output has the label of an input: no driving point",
                "Measure one, or give it the same label on both sides.",
            )
        power = derivatives_between(self.quantity, "displacement")
        rows = [self.output_dofs.index(dof) for dof in common]
        columns = [self.input_dofs.index(dof) for dof in common]
        driving = np.abs(self.shapes[rows] * part.T[columns])
        best = np.argmax(driving, axis=0)
        modes = np.arange(len(self))
        shape, weight = self.shapes[rows][best, modes], part.T[columns][best, modes]
        residue = shape * weight * self.poles**power
        target = np.sqrt(2j * np.abs(self.poles.imag) * residue)
        # of the two roots the one that leaves the mode nearest to its own phase
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(target == 0, 1, shape / np.where(target == 0, 1, target))
        return np.asarray(factor), f"unit modal mass, driving point {', '.join(common)}"

    def impulse_response(
        self, samples: int, sampling_rate: float | None = None, *, first_sample: int = 0
    ) -> ImpulseResponse:
        """Return sum_j phi_j exp(s_j (k + first_sample) dt) l_j' and conjugates, k = 0 ... samples - 1.

        Parameters
        ----------
        samples : int
        sampling_rate : float, optional
            Samples per second; that of the identified system by default.
        first_sample : int
            Sampling intervals from the impulse to the first value.

        Raises
        ------
        DataError
            No participation, no sampling rate, or another rate than that of a held input.
        """
        part = self._need_participation("an impulse response")
        own = None if self.dt is None else 1 / self.dt
        rate = own if sampling_rate is None else check_positive("sampling_rate", sampling_rate)
        if rate is None:
            raise DataError(
                "an impulse response was asked", "the modes are of a continuous system", "Give sampling_rate."
            )
        if self.held_input and own is not None and not np.isclose(rate, own, rtol=1e-9):
            raise DataError(
                f"a pulse response at {rate:g} Hz was asked",
                f"the participation is that of an input held at {own:g} Hz",
                "Leave sampling_rate out.",
            )
        steps = np.arange(check_count("samples", samples)) + first_sample
        decay = np.exp(np.outer(steps / rate, self.poles)) * self._weights()
        values = np.einsum("kj,aj,jb->kab", decay, self.shapes, part).real
        return ImpulseResponse(
            values=values,
            sampling_rate=rate,
            feedthrough=self.feedthrough,
            kind="pulse" if self.held_input else "dirac",
            first_sample=first_sample,
            quantity=self.quantity,
            **self.labelled(),
        )

    def frequency_response(self, frequencies: ArrayLike, *, residuals: bool = True) -> FrequencyResponse:
        """Return the response of the modes, the direct term and the residuals.

        Parameters
        ----------
        frequencies : array, (F,)
            Lines in Hz.
        residuals : bool
            Whether modes outside the band take part, where they are known.

        Raises
        ------
        DataError
            No participation.
        """
        f = np.asarray(frequencies, dtype=float)
        values = self._modal_sum(f)
        if self.feedthrough is not None:
            values = values + self.feedthrough
        if residuals and (self.lower_residual is not None or self.upper_residual is not None):
            p = 0 if self.quantity is None else -derivatives_between(self.quantity, "displacement")
            s = (2j * np.pi * f)[:, None, None]
            for residual, power in ((self.lower_residual, p - 2), (self.upper_residual, p)):
                if residual is not None:
                    values = values + residual * s**power
        rate = 1 / self.dt if self.dt is not None and self.held_input else None
        return FrequencyResponse(
            values=values, frequencies=f, quantity=self.quantity, sampling_rate=rate, **self.labelled()
        )

    def _modal_sum(self, f: RealArray) -> ComplexArray:
        part = self._need_participation("a frequency response")
        sampled = self.dt is not None and self.held_input
        x = np.exp(2j * np.pi * f * self.dt) if sampled and self.dt is not None else 2j * np.pi * f
        poles = to_discrete(self.poles, self.dt) if sampled and self.dt is not None else self.poles
        own = 1 / (x[:, None] - poles)
        pair = np.where(self._weights() == 2, 1.0, 0.0) / (x[:, None] - poles.conj())
        first = np.einsum("fj,aj,jb->fab", own, self.shapes, part, optimize=True)
        return np.asarray(first + np.einsum("fj,aj,jb->fab", pair, self.shapes.conj(), part.conj(), optimize=True))

    def _weights(self) -> RealArray:
        """2 for a pole that stands for a conjugate pair, 1 for one that stands alone."""
        alone = np.array([kind in ("real", "nyquist", "zero") for kind in self.kinds], dtype=bool)
        real = self.poles.imag == 0
        return np.where(alone | real, 1.0, 2.0)

    def _need_participation(self, asked: str) -> ComplexArray:
        if self.participation is None:
            raise DataError(
                f"{asked} was asked",
                "the participation of the modes is not known",
                "Identify from data with inputs or references.",
            )
        return self.participation

    def table(self) -> str:
        """Return the modes as a text table: frequency, damping, spread over orders, indicators."""
        return as_text(self)

    def to_dataframe(self) -> Any:
        """Return the table as a pandas DataFrame, in the columns of the files.

        Raises
        ------
        DataError
            pandas is not installed: the extra `pandas` brings it.
        """
        return as_dataframe(self)

    def _cut(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        direct = {name: None if (a := getattr(self, name)) is None else a[np.ix_(outputs, inputs)] for name in _DIRECT}
        return {**Channels._cut(self, outputs, inputs), **direct}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {
            "shapes": self.shapes[outputs],
            "participation": None if self.participation is None else self.participation[:, inputs],
        }
