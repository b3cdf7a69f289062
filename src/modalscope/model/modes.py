"""Modes: poles, shapes and participation, and what they say about a structure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model import synthesis
from modalscope.model.candidates import Candidate, Harmonic
from modalscope.model.channels import Channels
from modalscope.model.checks import ComplexArray, DataError, RealArray, check_choice, freeze
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.intervals import intervals
from modalscope.model.mode import Mode
from modalscope.model.mode_fields import DIRECT, checked_fields, mode_indices, taken_fields
from modalscope.model.mode_table import as_dataframe, as_text
from modalscope.model.normalization import NORMALIZATIONS, shape_factor
from modalscope.model.notes import Note, notes_of
from modalscope.model.poles import HasPoles

__all__ = ["NORMALIZATIONS", "ModalModel"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
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
        Standard deviation from the noise (Hz, ratio); NaN where it is withheld, None where it was not asked for.
    shapes_std : array, (l, n), optional
        Standard deviation of every component of the shapes from the noise, sqrt(E |phi - E phi|^2).
    frequencies_repeatability, damping_ratios_repeatability : array, (n,), optional
        Standard deviation between groups of inputs, runs or setups (Hz, ratio); None without groups.
    gain : array, (n,), optional
        By how many standard deviations the data are explained better with each mode.
    indicators : mapping of name to array (n,)
        Accuracy indicators.
    reasons : tuple of mapping
        For every mode why it is reported.
    scaling : str
        What the shapes are scaled to, in words.
    notes : sequence of Note or str
        What must be told about these modes.
    left_out : sequence of Candidate
        Poles that looked like modes and are not reported, each with the reason.
    harmonics : sequence of Harmonic
        Lines of turning machines, which are no modes.
    unrefined : ModalModel, optional
        The same modes before they were refined.
    converged : bool, optional
        Whether the refinement converged; None where there was none.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> modes = chain5().modes()
    >>> print(len(modes), modes[0], len(modes[1:3]))
    5 0.9060 Hz, 0.247 % 2
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
    shapes_std: RealArray | None = None
    frequencies_repeatability: RealArray | None = None
    damping_ratios_repeatability: RealArray | None = None
    gain: RealArray | None = None
    indicators: Mapping[str, RealArray] = field(default_factory=dict)
    reasons: tuple[Mapping[str, Any], ...] = ()
    scaling: str = "as identified"
    notes: tuple[Note, ...] = ()
    left_out: tuple[Candidate, ...] = ()
    harmonics: tuple[Harmonic, ...] = ()
    unrefined: ModalModel | None = None
    converged: bool | None = None

    def __post_init__(self) -> None:
        freeze(self, **checked_fields(self))
        self._label(len(self.shapes), 0 if self.participation is None else self.participation.shape[1])

    def __len__(self) -> int:
        return int(self.poles.size)

    def __iter__(self) -> Iterator[Mode]:
        return (Mode(self, j) for j in range(len(self)))

    @overload
    def __getitem__(self, which: int) -> Mode: ...

    @overload
    def __getitem__(self, which: slice | ArrayLike) -> ModalModel: ...

    def __getitem__(self, which: Any) -> Mode | ModalModel:
        if isinstance(which, slice):
            return self.take(np.arange(len(self))[which])
        if isinstance(which, int | np.integer) and not isinstance(which, bool):
            return Mode(self, int(mode_indices(which, len(self))[0]))
        return self.take(which)

    @property
    def residues(self) -> ComplexArray:
        """Residue matrices phi_j l_j', (n, l, m)."""
        part = self.known_participation("residues")
        return np.asarray(self.shapes.T[:, :, None] * part[:, None, :])

    def take(self, modes: ArrayLike) -> ModalModel:
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
        return replace(self, **taken_fields(self, mode_indices(modes, len(self))))

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
            "mass" without participation, a driving point, a known quantity, or forces that were measured and are told apart.
        """
        check_choice("scale", scale, NORMALIZATIONS)
        if scale == "none" or not len(self):
            return self
        factor, words = shape_factor(self, scale)
        return replace(
            self,
            shapes=self.shapes / factor,
            shapes_std=None if self.shapes_std is None else self.shapes_std / np.abs(factor),
            participation=None if self.participation is None else self.participation * factor[:, None],
            unrefined=None if self.unrefined is None else self.unrefined.normalized(scale),
            scaling=words,
        )

    def interval(self, level: float = 0.95) -> dict[str, RealArray]:
        """Return value -+ z sigma, the wider of the deviations from the noise and between groups; NaN where it is withheld.

        Parameters
        ----------
        level : float
            Probability that each interval holds the true value, for errors of normal distribution.

        Returns
        -------
        dict of str to array
            "frequency" (n, 2), Hz, and "damping_ratio" (n, 2): lower and upper ends.

        Raises
        ------
        DataError
            No deviation is known, or a level that is no probability.

        Examples
        --------
        >>> modes = ModalModel(poles=[-1 + 100j], shapes=[[1.0]], frequencies_std=[0.1])
        >>> modes.interval(0.95)["frequency"].round(3)
        array([[15.72 , 16.112]])
        """
        return intervals(self, level)

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
        return synthesis.impulse_response(self, samples, sampling_rate, first_sample)

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
        return synthesis.frequency_response(self, frequencies, residuals)

    def known_participation(self, asked: str) -> ComplexArray:
        """Return the participation, or raise where it is not known.

        Parameters
        ----------
        asked : str
            What it is needed for.
        """
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
        direct = {name: None if (a := getattr(self, name)) is None else a[np.ix_(outputs, inputs)] for name in DIRECT}
        return {**Channels._cut(self, outputs, inputs), **direct}

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        return {
            "shapes": self.shapes[outputs],
            "shapes_std": None if self.shapes_std is None else self.shapes_std[outputs],
            "participation": None if self.participation is None else self.participation[:, inputs],
            "unrefined": None if self.unrefined is None else self.unrefined.select(outputs=outputs, inputs=inputs),
        }
