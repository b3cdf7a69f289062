"""Hold modes: poles, shapes and participation, with normalization, synthesis and names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import derivatives_between
from modalscope.data.mode_fields import (
    COLUMNS,
    ModeFields,
    interval_ends,
    mode_indices,
    values_on_lines,
    values_on_samples,
)
from modalscope.data.response import CORRELATED, INSEPARABLE
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.numerics.arguments import between, named
from modalscope.numerics.checks import ComplexArray, RealArray, check_positive, stays_locked
from modalscope.numerics.errors import DataError, optional_package
from modalscope.numerics.handed import handed

#: What shapes can be scaled to (see `ModalModel.normalized`).
NORMALIZATIONS = ("unit", "max", "mass", "none")


def shape_factor(modes: ModalModel, scale: str) -> tuple[ComplexArray, str]:
    """Return the factor (n,) that shapes are divided by to be scaled as asked, and what they are scaled to, in words."""
    if scale == "mass":
        return _mass_factor(modes)
    largest = modes.shapes[np.argmax(np.abs(modes.shapes), axis=0), np.arange(len(modes))]
    if scale == "max":
        return np.where(largest == 0, 1, largest), "largest component 1"
    norm = np.linalg.norm(modes.shapes, axis=0)
    sign = np.where(largest == 0, 1, largest / np.where(largest == 0, 1, np.abs(largest)))
    return sign * np.where(norm == 0, 1, norm), "length 1, largest component real"


def _mass_factor(modes: ModalModel) -> tuple[ComplexArray, str]:
    """Return the factor of unit modal mass, phi_d^2 = 2 j w_d R_dd at each mode's largest driving point d."""
    part = modes.known_participation("unit modal mass")
    if any(step.startswith(CORRELATED) for step in modes.processing):
        raise DataError(
            "shapes of unit modal mass:",
            "no force was measured: participation is the correlation of each mode with references",
            "Measure again with known masses added, and give both to scale_by_mass.",
        )
    common = [dof for dof in modes.output_dofs if dof in modes.input_dofs]
    untold = {dof for note in modes.notes if note.kind == INSEPARABLE for dof in note.numbers}
    if common and untold.issuperset(common):
        raise DataError(
            "shapes of unit modal mass:",
            f"the driving points {', '.join(common)} are inputs whose shares in the response cannot be separated",
            "Drive each by an independent force, or leave out those that are not independent: exclude=[...].",
        )
    common = [dof for dof in common if dof not in untold]
    if not common:
        raise DataError(
            "shapes of unit modal mass:",
            "there is no driving point",
            "Where an output and an input are at one point, give both the same label.",
        )
    power = derivatives_between(modes.quantity, "displacement")
    rows = [modes.output_dofs.index(dof) for dof in common]
    columns = [modes.input_dofs.index(dof) for dof in common]
    driving = np.abs(modes.shapes[rows] * part.T[columns])
    best, each = np.argmax(driving, axis=0), np.arange(len(modes))
    shape, weight = modes.shapes[rows][best, each], part.T[columns][best, each]
    residue = shape * weight * modes.poles**power
    if modes.held_input and modes.dt:  # an input held over dt gives R (exp(s dt) - 1) / s of a structure's residue R
        residue = residue * modes.poles / np.expm1(modes.poles * modes.dt)
    target = np.sqrt(2j * np.abs(modes.poles.imag) * residue)
    # of the two roots the one that leaves the mode nearest to its own phase
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(target == 0, 1, shape / np.where(target == 0, 1, target))
    return np.asarray(factor), f"unit modal mass, driving point {', '.join(common)}"


@dataclass(frozen=True, eq=False, slots=True)
class Mode:
    """One mode of a `ModalModel`: `modes[0]` is the first; nothing is copied.

    `modes`: the model that it belongs to. `index`: which of its modes, from zero.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> first = chain5().modes()[0]
    >>> print(first, first.shape.size)
    0.9060 Hz, 0.247 % 4
    """

    modes: ModalModel
    index: int

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, Hz."""
        return float(np.abs(self.pole) / (2 * np.pi))

    @property
    def damping_ratio(self) -> float:
        """Damping ratio (0.01 is 1 %)."""
        return float(self.modes.damping_ratios[self.index])

    @property
    def pole(self) -> complex:
        """The pole in rad/s: of a conjugate pair the one above the real axis."""
        return complex(self.modes.poles[self.index])

    @property
    def kind(self) -> str:
        """What the pole is: mode, real, unstable, nyquist or zero."""
        return self.modes.kinds[self.index]

    @property
    def shape(self) -> ComplexArray:
        """The mode shape, (l,)."""
        return self.modes.shapes[:, self.index]

    @property
    def participation(self) -> ComplexArray | None:
        """How strongly each input drives the mode, (m,); None where that is not known."""
        return None if self.modes.participation is None else self.modes.participation[self.index]

    @property
    def indicators(self) -> Mapping[str, float]:
        """Accuracy indicators by name."""
        return {name: float(values[self.index]) for name, values in self.modes.indicators.items()}

    @property
    def reason(self) -> Mapping[str, Any]:
        """Why the mode is reported; empty where nothing was said."""
        return self.modes.reasons[self.index] if self.modes.reasons else {}

    @property
    def grade(self) -> str:
        """How far the mode is to be trusted: good, look or doubtful; see `grade_reason`."""
        return str(_graded(self.modes)[self.index].word)

    @property
    def words(self) -> dict[str, str]:
        """How far frequency, damping and shape are to be trusted: good, look or doubtful each, with its reason as `.reason`."""
        return dict(_graded(self.modes)[self.index].words)

    @property
    def grade_reason(self) -> str:
        """What decides the grade."""
        return str(_graded(self.modes)[self.index].reason)

    def __repr__(self) -> str:
        return f"<mode {self.index + 1}: {self}>"

    def __str__(self) -> str:
        return f"{self.frequency:.4f} Hz, {100 * self.damping_ratio:.3f} %"


@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class ModalModel(ModeFields):
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
    residual_terms : sequence of ResidualTerms
        What the data of each band contain besides the modes, as it was fitted together with them: in that band it stands in the place
        of the direct term and the residuals, which approximate it.
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
        Standard deviation of every component of the shapes from the noise, sqrt(E |phi - E phi|^2), of what is no change of size: this
        is taken off where every channel counts by its level.
    frequencies_repeatability, damping_ratios_repeatability : array, (n,), optional
        Standard deviation between groups of inputs, runs or setups (Hz, ratio); None without groups.
    damping_ratios_lower : array, (n,), optional
        Damping ratio less what a wandering frequency adds to it: the lower end of its interval counts from here. NaN where the
        frequency does not wander.
    degrees : array, (n, 2), optional
        Degrees of freedom of the wider of the two deviations of the frequency and of the damping ratio: NaN where it is
        known exactly, 0 where the data leave the mode open, which has no interval.
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
        return self.shapes.T[:, :, None] * part[:, None, :]

    @named(scale=NORMALIZATIONS)
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

    @named(level=between(0, 1))
    def interval(self, level: float = 0.95) -> dict[str, RealArray]:
        """Return f -+ t sigma and zeta exp(-+ t sigma / zeta), t Student's quantile, sigma the wider of noise and groups.

        The lower end of a damping ratio counts from `damping_ratios_lower` where the frequency wanders. NaN where sigma is unknown.

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
        if all(getattr(self, f) is None for f in COLUMNS.values() if f.endswith(("_std", "_repeatability"))):
            raise DataError(
                f"intervals at {100 * level:g} %:",
                "no standard deviation of these modes is known: neither from the noise nor between groups",
                "Give frequencies_std and damping_ratios_std, or their repeatability between groups.",
            )
        f, zeta = interval_ends(self, level)
        return {"frequency": f, "damping_ratio": zeta}

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
        identified = None if self.dt is None else 1 / self.dt
        rate = identified if sampling_rate is None else check_positive("sampling_rate", sampling_rate)
        if rate is None:
            raise DataError("an impulse response:", "the system is continuous", "Give sampling_rate.")
        if self.held_input and identified is not None and not np.isclose(rate, identified, rtol=1e-9):
            raise DataError(
                f"a pulse response at {rate:g} Hz:",
                f"the participation is that of an input held at {identified:g} Hz",
                "Leave sampling_rate out.",
            )
        return ImpulseResponse(
            values=values_on_samples(self, samples, rate, first_sample),
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
        lines = np.asarray(frequencies, dtype=float)
        rate = 1 / self.dt if self.dt is not None and self.held_input else None
        values = values_on_lines(self, lines, residuals=residuals)
        return FrequencyResponse(
            values=values, frequencies=lines, quantity=self.quantity, sampling_rate=rate, **self.labelled()
        )

    @property
    def significance(self) -> RealArray | None:
        """How much better the data are explained with each mode than without, in standard deviations, (n,): `gain`."""
        return self.gain

    @named()
    def table(self, *, wide: bool = False) -> str:
        """Return the modes as a text table: frequency, damping, their 95 % intervals, grade, MPC and the reason of the grade.

        Parameters
        ----------
        wide : bool
            Whether spreads over orders, significance and indicators are columns, too.
        """
        return str(handed("text_of")(self, wide=wide))

    def to_dataframe(self) -> Any:
        """Return the table as a pandas DataFrame, in the columns of the files.

        Raises
        ------
        DataError
            pandas is not installed: the extra `pandas` brings it.
        """
        frames = optional_package("to_dataframe", "pandas", "pandas")
        return frames.DataFrame(self.columns())

    def columns(self) -> dict[str, Any]:
        """Return the numbers of the modes by the names that files and data frames give them.

        Frequencies and damping ratios with deviations and 95 % intervals, indicators, grade and reason, each (n,).
        """
        return dict(handed("columns_of")(self))


def _graded(modes: ModalModel) -> Any:
    """Return the grade of every mode."""
    return handed("grades")(modes)
