"""Hold measured responses: impulse responses on samples and frequency responses on lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import (
    AUTO,
    KINDS,
    Groups,
    check_groups,
    check_quantity,
    chosen_groups,
    derivatives_between,
    input_groups,
    one_channel,
)
from modalscope.data.mode_fields import ModeFields, values_on_lines, values_on_samples
from modalscope.data.quadruple import Quadruple
from modalscope.data.response import HALF, Conversion, Response
from modalscope.numerics.arguments import also_called
from modalscope.numerics.checks import (
    Array,
    ComplexArray,
    IntArray,
    RealArray,
    check_band,
    check_count,
    check_index,
    check_number,
    check_positive,
    complex_array,
    freeze,
    optional_array,
    real_array,
    stays_locked,
)
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.functions.pole_basis import (
    ModalBasis,
    line_basis,
    line_data,
    residual_powers,
    sample_basis,
    scaled_terms,
)
from modalscope.numerics.functions.pole_functions import line_functions, sample_functions
from modalscope.numerics.linear_systems import HELD, markov_parameters

#: Samples of a model that are computed together at least: C is read once for each such step.
_MIN_SAMPLES_PER_STEP = 16


@also_called("values", "sampling_rate")
@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class ImpulseResponse(Response):
    """A Markov sequence: `values[k]` is the l x m matrix Y(k) = C A^k B (Eq. 11); the direct term is kept apart.

    Parameters
    ----------
    values : array, (N, l, m)
        N samples, l outputs, m inputs (or initial conditions, or references).
    sampling_rate : float
        Samples per second.
    feedthrough : array, (l, m), optional
        The direct term D.
    kind : str
        `"pulse"` (response to a held input: H(z) = D + sum Y(k) z^-(k+1)), `"dirac"` (samples of a continuous impulse
        response), `"correlation"` (values[k] = R(k+1)) or `"free decay"`.
    first_sample : int
        Sampling intervals from the impulse to values[0]; 0 unless earlier samples were left out. Kept so that
        participation can be referred to the impulse itself. A pulse response counts from the sample after the pulse.
    quantity : str, optional
        Displacement, velocity or acceleration.
    added_damping : float
        Decay rate in 1/s that an exponential window added to every pole: identified poles are shifted back by it.
    groups : sequence of labels, "auto" or None
        One label per input: what disagrees between groups is repeatability. By default every input, where there are at least four.

    Raises
    ------
    DataError
        Wrong axes, fewer than two samples, NaN or infinite samples, repeated labels.
    """

    values: RealArray
    sampling_rate: float
    feedthrough: RealArray | None = None
    kind: str = "pulse"
    first_sample: int = 0
    quantity: str | None = None
    added_damping: float = 0.0
    groups: Groups = AUTO
    exact_samples: ClassVar[bool] = True

    def __post_init__(self) -> None:
        values = real_array("values", one_channel(self.values, 3), "(samples, outputs, inputs)", 3)
        if values.shape[0] < 2 or 0 in values.shape:
            have = f"its shape is {values.shape}"
            raise DataError("an impulse response needs two samples", have, "Measure a longer one.")
        freeze(
            self,
            values=values,
            feedthrough=optional_array("feedthrough", self.feedthrough, "(outputs, inputs)", values.shape[1:]),
            sampling_rate=check_positive("sampling_rate", self.sampling_rate),
            kind=check_choice("kind", self.kind, KINDS),
            first_sample=check_count("first_sample", self.first_sample, least=0),
            quantity=check_quantity(self.quantity),
            added_damping=check_number("added_damping", self.added_damping),
        )
        self._label(values.shape[1], values.shape[2])
        freeze(self, groups=check_groups(self.groups, values.shape[2], "input", input_groups(self.input_dofs)))

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.values.shape[0])

    @property
    def times(self) -> RealArray:
        """Time of every sample after the impulse, seconds (a pulse response is one step later than its index)."""
        step = 1 if self.kind in ("pulse", "correlation") else 0
        return (np.arange(self.samples) + self.first_sample + step) / self.sampling_rate

    @property
    def origin(self) -> str:
        """The kind of the sequence."""
        return self.kind

    @property
    def span(self) -> tuple[float, float]:
        """Zero to half the sampling rate, Hz."""
        return 0.0, self.sampling_rate / 2

    @property
    def held_input(self) -> bool:
        """Whether this is a pulse response."""
        return self.kind == "pulse"

    @property
    def steps_late(self) -> int:
        """Sampling intervals from the impulse to the first sample."""
        return self.first_sample

    def basis(self, poles: Array, powers: tuple[int, ...] = (0,), weights: Array | None = None) -> ModalBasis:
        """Return what poles can contribute to the samples; samples have neither terms nor weights. See `Response.basis`."""
        return sample_basis(self.sampling_rate, self.first_sample, self.values, poles)

    def named_terms(self, terms: RealArray, powers: tuple[int, ...]) -> dict[str, RealArray | None]:
        """Return the known direct term; see `Response.named_terms`."""
        return {"feedthrough": self.feedthrough}

    def functions(self, poles: Array, *, slopes: bool = False, lines: slice = slice(None)) -> RealArray:
        """Return the functions of `basis` on some samples; see `Response.functions`."""
        first, end, _ = lines.indices(self.samples)
        return sample_functions(self.sampling_rate, self.first_sample + first, end - first, poles, slopes=slopes)

    def spectrum(self) -> tuple[RealArray, ComplexArray]:
        """Return the transform of the samples with seven times as many zeros behind them, on 0 Hz to half the sampling rate."""
        length = 8 * self.samples
        H = np.fft.rfft(self.values, n=length, axis=0) / self.sampling_rate
        return np.asarray(np.fft.rfftfreq(length, 1 / self.sampling_rate), dtype=float), H

    def energy(self, decay: Array) -> RealArray:
        """Return the sum over samples of |2 Re exp(s t)|^2, about fs / decay, limited by the number of samples."""
        return np.minimum(self.sampling_rate / np.asarray(decay), 2 * self.samples)

    def as_samples(self) -> Conversion:
        """Return the samples themselves."""
        return Conversion(self, "")

    def as_lines(self) -> Conversion:
        """Return the transform of the samples, see `exact_lines`."""
        return Conversion(
            self.to_frequency_response(), "the samples were transformed to lines as if nothing followed the last one"
        )

    def in_band(self, band: tuple[float, float] | None) -> ImpulseResponse:
        """Return the samples as they are: they are not filtered."""
        return self

    def reported_band(self, band: tuple[float, float] | None) -> tuple[float, float]:
        """Return the band that was asked, or everything: real poles of a sampled system may lie above half the sampling rate."""
        return (0.0, np.inf) if band is None else band

    def rebuilt_by(self, model: Quadruple) -> ImpulseResponse:
        """Return the response of a model at these samples; see `Response.rebuilt_by`."""
        return ImpulseResponse(
            values=self.values_of(model),
            sampling_rate=1 / model.dt if model.dt else self.sampling_rate,
            feedthrough=model.D,
            kind=self.kind,
            first_sample=self.first_sample,
            **self.rebuilt_labels(),
        )

    def values_of(self, model: Quadruple) -> Array:
        """Return the Markov parameters of a model at these samples; see `Response.values_of`."""
        return model.markov_parameters(self.samples)

    def with_model(self, model: Quadruple) -> Iterator[tuple[Array, Array]]:
        """Yield samples and those of a model, never all of many outputs together; see `Response.with_model`."""
        _, l, m = self.values.shape
        step, state = max(_MIN_SAMPLES_PER_STEP, HELD // (4 * l * m)), model.B
        for first in range(0, self.samples, step):
            measured = self.values[first : first + step]
            yield measured, markov_parameters(model.A, state, model.C, len(measured))
            state = np.linalg.matrix_power(model.A, len(measured)) @ state

    def of_modes(self, modes: ModeFields) -> Array:
        """Return the response of modes at these samples; see `Response.of_modes`."""
        values = values_on_samples(modes, self.samples, self.sampling_rate, self.first_sample)
        for terms in modes.residual_terms:
            values = values + terms.on_samples(self.samples, self.sampling_rate, self.first_sample)
        return values

    def to_frequency_response(self, frequencies: ArrayLike | None = None) -> FrequencyResponse:
        """Return the transform of the sequence on the given lines (Hz), by default on its own DFT lines.

        For a pulse response H(z) = D + sum_k Y(k) z^-(k+1) with z = exp(j 2 pi f / fs); for samples of a continuous
        impulse response dt * sum_k Y(k) z^-(k + first_sample), an approximation of the integral whose direct term is D. A
        correlation gives its half spectra R(0) / 2 + sum_k R(k) z^-k.
        What lies beyond the last sample is taken as zero.

        Parameters
        ----------
        frequencies : array, (F,), optional
            Lines in Hz.
        """
        held = self.kind in ("pulse", "correlation")  # sequences of a sampled system, which start one step late
        if frequencies is None:
            length = self.samples + 1
            lines = np.asarray(np.fft.rfftfreq(length, 1 / self.sampling_rate), dtype=float)
            values = np.fft.rfft(self.values, n=length, axis=0)
        else:
            lines = real_array("frequencies", frequencies, "(lines,)", 1)
            values = self._transformed(lines)
        delay = self.first_sample + (1 if held else 0)
        shift = np.exp(-2j * np.pi * lines * delay / self.sampling_rate) * (1 if held else 1 / self.sampling_rate)
        values = values * shift[:, None, None]
        if self.feedthrough is not None:
            values = values + (self.feedthrough / 2 if self.kind == "correlation" else self.feedthrough)
        return FrequencyResponse(
            values=values,
            frequencies=lines,
            sampling_rate=self.sampling_rate if held else None,
            quantity=self.quantity,
            added_damping=self.added_damping,
            groups=self.groups,
            **self.labelled(),
        ).processed(
            f"{f'{HALF}, ' if self.kind == 'correlation' else ''}transformed from {self.samples} samples of a {self.kind} response"
        )

    def _transformed(self, lines: RealArray) -> ComplexArray:
        """Return sum_k values[k] exp(-2 pi j f k / fs) on any lines, a few at a time."""
        steps = np.arange(self.samples) / self.sampling_rate
        values = np.empty((lines.size, *self.values.shape[1:]), dtype=complex)
        few = max(1, HELD // self.samples)
        for first in range(0, lines.size, few):
            rows = slice(first, first + few)
            values[rows] = np.tensordot(np.exp(-2j * np.pi * np.outer(lines[rows], steps)), self.values, axes=1)
        return values

    def _scaled(self, outputs: RealArray, inputs: RealArray) -> dict[str, Any]:
        by = self._factors(outputs, inputs)
        direct = None if self.feedthrough is None else self.feedthrough * by
        return {"values": self.values * by, "feedthrough": direct}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        cut = np.ix_(outputs, inputs)
        return {
            "values": np.ascontiguousarray(self.values[:, cut[0], cut[1]]),
            "feedthrough": None if self.feedthrough is None else self.feedthrough[cut],
            "groups": chosen_groups(self.groups, inputs),
        }


def check_lines(lines: RealArray, values: ComplexArray) -> None:
    """Refuse no lines, another number of them than values, negative or not increasing lines, and magnitudes."""
    shape = values.shape
    if 0 in shape or lines.size == 0:
        raise DataError("a response needs at least one line, output and input", f"its shape is {shape}", "Add it.")
    if lines.size != shape[0]:
        raise DataError(
            f"frequencies needs one entry for each of the {shape[0]} lines of values, shape {shape}",
            f"it has {lines.size}",
            "Lines come first in values: (lines, outputs, inputs); transpose it if they stand elsewhere.",
        )
    if lines[0] < 0:
        have = f"the first is {lines[0]:g} Hz"
        raise DataError("frequencies needs lines from 0 Hz", have, "Leave negative lines out.")
    falling = np.flatnonzero(np.diff(lines) <= 0)
    if falling.size:
        k = int(falling[0])
        raise DataError(
            "frequencies needs increasing lines",
            f"line {k + 1} ({lines[k + 1]:g} Hz) does not lie above line {k} ({lines[k]:g} Hz)",
            "Sort the lines together with their values and drop the repeated ones.",
        )
    # a single line may be real by chance, and an undamped model's real response changes sign
    if lines.size > 1 and not values.imag.any() and values.real.any() and values.real.min() >= 0:
        raise DataError(
            "values needs complex frequency responses", "they are magnitudes", "Give real and imaginary parts."
        )


def check_statistic(name: str, array: Array | None, shape: tuple[int, ...]) -> RealArray | None:
    """Return the coherence or the variance of values of a shape, checked; None where there is none."""
    if array is None:
        return None
    checked = real_array(name, array, "(lines, outputs) or (lines, outputs, inputs)", (2, 3))
    if checked.shape not in (shape, shape[:2]) or (name == "variance" and checked.ndim != 3):
        raise DataError(
            f"{name} needs the shape of values, {shape}", f"it has {checked.shape}", "Transpose or complete it."
        )
    low, high = float(checked.min()), float(checked.max())
    if low < -1e-9 or (name == "coherence" and high > 1 + 1e-6):
        raise DataError(
            f"{name} needs values of at least 0" + (" and at most 1" if name == "coherence" else ""),
            f"they lie between {low:g} and {high:g}",
            f"Correct the {name}, or leave it out.",
        )
    return checked


def check_rate(sampling_rate: float | None, lines: RealArray) -> float | None:
    """Return the sampling rate, or raise where lines lie above half of it; None for a continuous structure."""
    rate = None if sampling_rate is None else check_positive("sampling_rate", sampling_rate)
    if rate is not None and lines[-1] > rate / 2 * (1 + 1e-9):
        raise DataError(
            f"lines up to half the sampling rate, {rate / 2:g} Hz:",
            f"there are lines up to {lines[-1]:g} Hz",
            "Correct the sampling rate, or leave it out for the response of a continuous structure.",
        )
    return rate


def lines_inside(lines: RealArray, band: tuple[float, float]) -> IntArray:
    """Return which lines lie in a band, Hz, or raise where none does."""
    low, high = check_band(band)
    inside = np.flatnonzero((lines >= low) & (lines <= high))
    if not inside.size:
        raise DataError(
            f"the band {low:g} to {high:g} Hz:",
            f"the {lines.size} lines lie from {lines.min():g} to {lines.max():g} Hz, none of them inside",
            "Choose a band that holds measured lines.",
        )
    return inside


#: With no more lines than this, residual terms would explain the modes themselves.
_MAX_LINES_WITHOUT_RESIDUALS = 8


@also_called("values", "frequencies")
@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class FrequencyResponse(Response):
    """Complex frequency responses H(f) = output / input on increasing lines.

    Parameters
    ----------
    values : array of complex, (F, l, m) or (F,)
        F lines, l outputs, m inputs; `FrequencyResponse(values, frequencies)` is enough.
    frequencies : array, (F,)
        The lines in Hz, increasing, from any band.
    quantity : str, optional
        Displacement, velocity or acceleration of the outputs; or the name of such a response to a force: receptance, mobility,
        accelerance.
    sampling_rate : float, optional
        Samples per second when the response is that of a sampled system, H(exp(j 2 pi f / fs)); None when it is that
        of the continuous structure.
    coherence : array, (F, l) or (F, l, m), optional
        Ordinary or multiple coherence of the estimates.
    variance : array, (F, l, m), optional
        Variance of the complex estimates, E|H - E H|^2.
    averages : int, optional
        Number of averages behind the estimates.
    excited : (float, float), optional
        Hz: where the forces of the test act; beyond, the estimates are noise, and without a band only this one is identified.
    added_damping : float
        Decay rate in 1/s that an exponential window added to every pole: identified poles are shifted back by it.
    groups : sequence of labels, "auto" or None
        One label per input: what disagrees between groups is repeatability. By default every input, where there are at least four.

    Raises
    ------
    DataError
        Wrong axes, no lines, NaN or infinite values, lines that do not increase, magnitudes instead of complex values.

    Examples
    --------
    >>> import numpy as np
    >>> f = np.linspace(0.5, 2, 4)
    >>> h = 1 / (4 - f**2 + 0.04j * f)
    >>> frf = FrequencyResponse(values=h[:, None, None], frequencies=f, quantity="displacement")
    >>> frf.band(0.9, 1.6).frequencies
    array([1. , 1.5])
    """

    values: ComplexArray
    frequencies: RealArray
    quantity: str | None = None
    sampling_rate: float | None = None
    coherence: RealArray | None = None
    variance: RealArray | None = None
    averages: int | None = None
    excited: tuple[float, float] | None = None
    added_damping: float = 0.0
    groups: Groups = AUTO
    origin: ClassVar[str] = "lines"
    exact_lines: ClassVar[bool] = True

    def __post_init__(self) -> None:
        values = complex_array("values", one_channel(self.values, 3), "(lines, outputs, inputs)", 3)
        lines = real_array("frequencies", self.frequencies, "(lines,)", 1)
        check_lines(lines, values)
        freeze(
            self,
            values=values,
            frequencies=lines,
            quantity=check_quantity(self.quantity),
            sampling_rate=check_rate(self.sampling_rate, lines),
            coherence=check_statistic("coherence", self.coherence, values.shape),
            variance=check_statistic("variance", self.variance, values.shape),
            averages=None if self.averages is None else check_count("averages", self.averages),
            excited=None if self.excited is None else check_band(self.excited),
            added_damping=check_number("added_damping", self.added_damping),
        )
        self._label(values.shape[1], values.shape[2])
        freeze(self, groups=check_groups(self.groups, values.shape[2], "input", input_groups(self.input_dofs)))

    @property
    def lines(self) -> int:
        """Number of lines."""
        return int(self.frequencies.size)

    @property
    def max_states(self) -> int:
        """Half of the columns of real and imaginary parts."""
        return max(self.lines * int(self.values.shape[2]), 2)

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest line, Hz."""
        return float(self.frequencies[0]), float(self.frequencies[-1])

    @property
    def grid(self) -> RealArray:
        """The lines, Hz."""
        return self.frequencies

    def basis(self, poles: Array, powers: tuple[int, ...] = (0,), weights: Array | None = None) -> ModalBasis:
        """Return what poles can contribute on the lines; see `Response.basis`.

        Raises
        ------
        DataError
            A line at 0 Hz with a residual that divides by its frequency.
        """
        if powers and min(powers) < 0 and self.frequencies[0] == 0:
            raise DataError(
                "residuals of modes below the band:",
                f"the {self.quantity or 'response'} has a line at 0 Hz, where they are infinite",
                "Leave that line out with band(), or ask for residuals=False.",
            )
        data = line_data(self.values, weights)
        return line_basis(self.frequencies, self.sampling_rate, data, poles, powers, weights)

    @property
    def outside_powers(self) -> tuple[int, ...]:
        """Mass line of the modes below, (j w)^(p-2), and stiffness line of those above, (j w)^p; a sampled system has a direct term."""
        residuals = self.sampling_rate is None and self.frequencies[0] > 0 and self.lines > _MAX_LINES_WITHOUT_RESIDUALS
        return residual_powers(self.quantity, residuals)

    def named_terms(self, terms: RealArray, powers: tuple[int, ...]) -> dict[str, RealArray | None]:
        """Return fitted terms by name; see `Response.named_terms`."""
        if len(powers) == 1:
            return {"feedthrough": terms[0]}
        lower, upper = scaled_terms(terms, powers, self.frequencies)
        return {"lower_residual": lower, "upper_residual": upper}

    def functions(self, poles: Array, *, slopes: bool = False, lines: slice = slice(None)) -> RealArray:
        """Return the functions of `basis`, on some lines; see `Response.functions`."""
        return line_functions(self.frequencies[lines], self.sampling_rate, poles, slopes=slopes)

    def spectrum(self) -> tuple[RealArray, ComplexArray]:
        """Return the lines and the values themselves."""
        return self.frequencies, self.values

    def energy(self, decay: Array) -> RealArray:
        """Return pi / (decay step): the integral of |1 / (j w - s)|^2 over w, on lines that lie `step` apart in w."""
        step = 2 * np.pi * np.median(np.diff(self.frequencies)) if self.lines > 1 else 1.0
        return np.pi / np.asarray(decay) / step

    @property
    def exact_samples(self) -> bool:
        """Whether the lines are those of a sampled system from zero to half its rate."""
        rate, (low, high) = self.sampling_rate, self.span
        return rate is not None and low == 0 and bool(np.isclose(high, rate / 2))

    def as_samples(self) -> Conversion:
        """Return the inverse transform, see `exact_samples`."""
        note = "the lines were transformed to samples: damping is biased unless they cover the whole spectrum"
        return Conversion(self.to_impulse_response(), note)

    def as_lines(self) -> Conversion:
        """Return the lines themselves."""
        return Conversion(self, "")

    def in_band(self, band: tuple[float, float] | None) -> FrequencyResponse:
        """Return the lines in a band."""
        return self if band is None else self.band(*band)

    def reported_band(self, band: tuple[float, float] | None) -> tuple[float, float]:
        """Return the lowest and the highest line, within the band: where it has not cut them, only poles inside are reported."""
        low, high = self.span
        return (low, high) if band is None else (max(low, band[0]), min(high, band[1]))

    def rebuilt_by(self, model: Quadruple) -> FrequencyResponse:
        """Return the response of a model on these lines; see `Response.rebuilt_by`."""
        rate = None if model.dt is None else 1 / model.dt
        return FrequencyResponse(
            values=self.values_of(model), frequencies=self.frequencies, sampling_rate=rate, **self.rebuilt_labels()
        )

    def values_of(self, model: Quadruple) -> Array:
        """Return the transfer functions of a model on these lines; see `Response.values_of`."""
        s = 2j * np.pi * self.frequencies
        return model.transfer(s if model.dt is None else np.exp(s * model.dt))

    def of_modes(self, modes: ModeFields) -> Array:
        """Return the response of modes on these lines; see `Response.of_modes`."""
        values = values_on_lines(modes, self.frequencies, terms=not modes.residual_terms)
        for terms in modes.residual_terms:
            values += terms.on_lines(self.frequencies)
        return values

    def band(self, lowest: float, highest: float) -> FrequencyResponse:
        """Return the lines from `lowest` to `highest` Hz, both included.

        Parameters
        ----------
        lowest, highest : float
            Hz.

        Raises
        ------
        DataError
            Ends that do not increase, or a band that holds no line.
        """
        inside = lines_inside(self.frequencies, (lowest, highest))
        return self.at_lines(slice(int(inside[0]), int(inside[-1]) + 1))

    def at_lines(self, lines: slice | Array) -> FrequencyResponse:
        """Return the response at some of its lines.

        Parameters
        ----------
        lines : slice or array of int or bool
            Which, by index.
        """
        check_index("lines", lines, self.lines)
        cut: dict[str, Any] = {
            name: None if (a := getattr(self, name)) is None else a[lines]
            for name in ("values", "frequencies", "coherence", "variance")
        }
        return replace(self, **cut)

    def as_quantity(self, wanted: str) -> FrequencyResponse:
        """Return the response in another quantity: multiplied by (j 2 pi f)^p, the caller's data untouched.

        Parameters
        ----------
        wanted : {"displacement", "velocity", "acceleration"}
            p is how often that is differentiated more than the response's own quantity.

        Raises
        ------
        DataError
            The quantity is not known, or a line at 0 Hz would be divided by zero.
        """
        power = derivatives_between(self.quantity, wanted)
        if power < 0 and self.frequencies[0] == 0:
            raise DataError(f"the {self.quantity} as {wanted}:", "a line lies at 0 Hz", "Leave it out with band().")
        factor = ((2j * np.pi * self.frequencies) ** power)[:, None, None]
        return replace(
            self,
            values=self.values * factor,
            variance=None if self.variance is None else self.variance * np.abs(factor) ** 2,
            quantity=wanted,
            units=self.units if power == 0 else (("",) * len(self.output_dofs), self.units[1]),
        ).processed(f"{self.quantity} turned into {wanted} in the frequency domain")

    def to_impulse_response(self) -> ImpulseResponse:
        """Return the inverse Fourier transform of the lines: samples at twice the highest frequency.

        Nothing is known outside the band: damping read off the result is biased unless the lines cover the whole spectrum.
        Sample 0 is kept apart as `feedthrough`. A sampled system's full DFT grid gives exactly the sum over p of Y(k + p M).

        Raises
        ------
        DataError
            Lines that are not equally spaced, or that do not lie on multiples of their spacing.
        """
        spectrum, step = self._from_zero()
        length, held = 2 * (len(spectrum) - 1), self.sampling_rate is not None
        rate = length * step
        if self.sampling_rate is not None:
            rate = self.sampling_rate
            length = round(rate / step)
            if abs(rate / step - length) > 1e-3:
                raise DataError(
                    "the inverse transform of a sampled response needs lines that divide the sampling rate",
                    f"{rate:g} Hz is {rate / step:.6g} times the line spacing of {step:g} Hz",
                    "Use a frequency-domain method (domain='z'), which takes any lines.",
                )
        samples = np.fft.irfft(spectrum, n=length, axis=0)
        low, high = self.span
        return ImpulseResponse(
            values=samples[1:] if held else samples[1:] * rate,
            feedthrough=samples[0],
            sampling_rate=rate,
            kind="pulse" if held else "dirac",
            first_sample=0 if held else 1,
            quantity=self.quantity,
            added_damping=self.added_damping,
            groups=self.groups,
            **self.labelled(),
        ).processed(f"inverse transform of {self.lines} lines, {low:g} to {high:g} Hz")

    def _from_zero(self) -> tuple[ComplexArray, float]:
        """Return values on all multiples of the line spacing from 0 Hz, zero below the band, and that spacing in Hz."""
        if self.lines < 2:
            raise DataError("an inverse transform needs a band of lines", "there is one line", "Measure more lines.")
        low, high = self.span
        step = (high - low) / (self.lines - 1)
        bins = np.rint(self.frequencies / step).astype(int)
        if np.max(np.abs(self.frequencies / step - bins)) > 1e-3 or np.any(np.diff(bins) != 1):
            steps = np.diff(self.frequencies)
            raise DataError(
                "an inverse transform needs equally spaced lines on multiples of their spacing",
                f"they start at {low:g} Hz with steps from {steps.min():g} to {steps.max():g} Hz",
                "Use a frequency-domain method (domain='s' or 'z'), which takes any lines.",
            )
        spectrum = np.zeros((bins[-1] + 1, *self.values.shape[1:]), dtype=complex)
        spectrum[bins] = self.values
        return spectrum, step

    def _scaled(self, outputs: RealArray, inputs: RealArray) -> dict[str, Any]:
        by = self._factors(outputs, inputs)
        return {"values": self.values * by, "variance": None if self.variance is None else self.variance * by**2}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        cut: dict[str, Any] = {"groups": chosen_groups(self.groups, inputs)}
        for name in ("values", "coherence", "variance"):
            array = getattr(self, name)
            if array is not None:
                cut[name] = array[:, outputs] if array.ndim == 2 else array[:, outputs][:, :, inputs]
        return cut
