"""Impulse responses: sequences of Markov parameters Y(k) = C A^k B."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import AUTO, KINDS, Groups, check_groups, check_quantity, chosen_groups, input_groups
from modalscope.data.pole_basis import ModalBasis, sample_basis, sample_functions
from modalscope.data.response import HALF, AsLines, AsSamples, Response
from modalscope.numerics.checks import (
    Array,
    ComplexArray,
    DataError,
    RealArray,
    check_choice,
    check_count,
    check_number,
    check_positive,
    freeze,
    real_array,
)
from modalscope.numerics.linear_systems import HELD, markov_parameters

if TYPE_CHECKING:
    from modalscope.data.frequency import FrequencyResponse
    from modalscope.data.modes import ModalModel
    from modalscope.data.statespace import StateSpace

__all__ = ["ImpulseResponse"]

#: Samples of a model that are made together at least: C is read as often as there are such steps.
_STEP = 16


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
        One label an input: what disagrees between groups is repeatability. By default every input, where there are at least four.

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

    def __post_init__(self) -> None:
        values = real_array("values", self.values, "(samples, outputs, inputs)", 3)
        if values.shape[0] < 2 or 0 in values.shape:
            raise DataError(
                "an impulse response needs at least two samples of one channel",
                f"its shape is {values.shape}",
                "Measure a longer response.",
            )
        feedthrough = None
        if self.feedthrough is not None:
            feedthrough = real_array("feedthrough", self.feedthrough, "(outputs, inputs)", 2)
            if feedthrough.shape != values.shape[1:]:
                raise DataError(
                    f"feedthrough needs shape {values.shape[1:]}",
                    f"it has {feedthrough.shape}",
                    "Give one value an output and input.",
                )
        freeze(
            self,
            values=values,
            feedthrough=feedthrough,
            sampling_rate=check_positive("sampling_rate", self.sampling_rate),
            kind=check_choice("kind", self.kind, KINDS),
            first_sample=check_count("first_sample", self.first_sample, least=0),
            quantity=check_quantity(self.quantity),
            added_damping=check_number("added_damping", self.added_damping),
        )
        self._label(values.shape[1], values.shape[2])
        freeze(self, groups=check_groups(self.groups, values.shape[2], "an input", input_groups(self.input_dofs)))

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.values.shape[0])

    @property
    def times(self) -> RealArray:
        """Time of every sample after the impulse, seconds (a pulse response is one step later than its index)."""
        step = 1 if self.kind in ("pulse", "correlation") else 0
        return np.asarray((np.arange(self.samples) + self.first_sample + step) / self.sampling_rate)

    @property
    def origin(self) -> str:
        """The kind of the sequence."""
        return self.kind

    @property
    def span(self) -> tuple[float, float]:
        """Zero to half the sampling rate, Hz."""
        return 0.0, self.sampling_rate / 2

    @property
    def grid(self) -> None:
        """None: samples have no resolution of their own."""
        return

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

    @property
    def outside_powers(self) -> tuple[int, ...]:
        """Samples have a direct term alone, and it is known or not."""
        return (0,)

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
        """Return about fs / decay, the sum over samples of |2 Re exp(s t)|^2, over no more than the samples there are."""
        return np.minimum(self.sampling_rate / np.asarray(decay), 2 * self.samples)

    @property
    def exact_samples(self) -> bool:
        """True: these are the samples."""
        return True

    @property
    def exact_lines(self) -> bool:
        """False: a transform takes what follows the last sample for zero."""
        return False

    def as_samples(self) -> AsSamples:
        """Return the samples themselves."""
        return AsSamples(self, "")

    def as_lines(self) -> AsLines:
        """Return the transform of the samples, see `exact_lines`."""
        return AsLines(
            self.to_frequency_response(), "the samples were transformed to lines as if nothing followed the last one"
        )

    def in_band(self, band: tuple[float, float] | None) -> ImpulseResponse:
        """Return the samples as they are: they are not filtered."""
        return self

    def reported_band(self, band: tuple[float, float] | None) -> tuple[float, float]:
        """Return the band that was asked, or everything: real poles of a sampled system may lie above half the sampling rate."""
        return (0.0, np.inf) if band is None else band

    def rebuilt_by(self, model: StateSpace) -> ImpulseResponse:
        """Return the response of a model at these samples; see `Response.rebuilt_by`."""
        labels = self.rebuilt_labels()
        return model.impulse_response(self.samples, kind=self.kind, first_sample=self.first_sample, **labels)

    def values_of(self, model: StateSpace) -> Array:
        """Return the Markov parameters of a model at these samples; see `Response.values_of`."""
        return model.markov_parameters(self.samples)

    def beside(self, model: StateSpace) -> Iterator[tuple[Array, Array]]:
        """Yield samples and those of a model, never all of many outputs together; see `Response.beside`."""
        _, l, m = self.values.shape
        step, state = max(_STEP, HELD // (4 * l * m)), model.B
        for first in range(0, self.samples, step):
            measured = self.values[first : first + step]
            yield measured, markov_parameters(model.A, state, model.C, len(measured))
            state = np.linalg.matrix_power(model.A, len(measured)) @ state

    def of_modes(self, modes: ModalModel) -> ImpulseResponse:
        """Return the response of modes at these samples; see `Response.of_modes`."""
        return modes.impulse_response(self.samples, self.sampling_rate, first_sample=self.first_sample)

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
        from modalscope.data.frequency import FrequencyResponse

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

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        cut = np.ix_(outputs, inputs)
        return {
            "values": np.ascontiguousarray(self.values[:, cut[0], cut[1]]),
            "feedthrough": None if self.feedthrough is None else self.feedthrough[cut],
            "groups": chosen_groups(self.groups, inputs),
        }
