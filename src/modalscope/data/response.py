"""Define what every measured response, on lines or on samples, offers to identification and selection."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from modalscope.data.channels import AUTO, Channels, Groups
from modalscope.data.mode_fields import ModeFields
from modalscope.data.notes import Note
from modalscope.data.quadruple import Quadruple
from modalscope.data.units import Convertible, motion_of, sides_of
from modalscope.numerics.checks import Array, ComplexArray, RealArray, freeze
from modalscope.numerics.functions.pole_basis import ModalBasis

#: How steps of `processing` name correlations, and half spectra.
CORRELATED, HALF = "correlated", "half spectra"

#: How a step of `processing` names an exchange of inputs and outputs.
EXCHANGED = "inputs and outputs exchanged by reciprocity"

#: The kind of a note on inputs that the data cannot separate; its numbers stand by their labels.
INSEPARABLE = "inputs not told apart"


class Conversion(NamedTuple):
    """A response as samples or as lines, and how it was converted (empty where it was not)."""

    response: Response
    note: str


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Response(Channels, Convertible):
    """A measured response, (lines or samples, outputs, inputs); how lines and samples differ is a method here.

    Parameters
    ----------
    values : array, (K, l, m)
    sampling_rate : float, optional
        Samples per second of a sampled system; None when the response is that of a continuous structure.
    quantity : str, optional
        Displacement, velocity or acceleration of the outputs.
    added_damping : float
        Decay rate in 1/s that an exponential window added to every pole: identified poles are shifted back by it.
    groups : sequence of labels, "auto" or None
        One label per input (of records: a run): what disagrees between groups is repeatability.
    """

    values: Array
    sampling_rate: float | None = None
    quantity: str | None = None
    added_damping: float = 0.0
    groups: Groups = AUTO
    #: Whether the response as lines loses nothing.
    exact_lines: ClassVar[bool] = False
    #: Whether the contribution of a pole is the same function for all inputs.
    separable: ClassVar[bool] = True

    @property
    @abstractmethod
    def origin(self) -> str:
        """Where the values came from: "lines", "records", or the kind of an impulse response."""

    @property
    @abstractmethod
    def span(self) -> tuple[float, float]:
        """Lowest and highest frequency that the data can show, Hz."""

    @property
    def grid(self) -> RealArray | None:
        """The lines in Hz; None of samples, which have no resolution of their own."""
        return None

    @property
    def count(self) -> int:
        """Number of lines or samples."""
        return int(self.values.shape[0])

    @property
    def max_states(self) -> int | None:
        """Largest number of states worth a try; None where the samples alone do not say."""
        return None

    @property
    def held_input(self) -> bool:
        """Whether the response is that of a sampled system under a held input, H(z) = D + sum phi l' / (z - exp(s dt))."""
        return self.sampling_rate is not None

    @property
    def steps_late(self) -> int:
        """Sampling intervals from the impulse to the first sample; 0 for lines."""
        return 0

    @property
    def exact_samples(self) -> bool:
        """Whether the response as samples loses nothing."""
        return False

    @property
    def ambient(self) -> bool:
        """Whether the response was estimated from outputs alone: its columns are references and it carries estimation errors."""
        return self.origin == "correlation"

    @property
    def of_correlations(self) -> bool:
        """Whether lines are half spectra, whose errors are correlated from line to line, as those of correlations are."""
        return any(HALF in step for step in self.processing)

    @property
    def kind_of_test(self) -> str | None:
        """Which kind of test, "free decay" of such a response; None where responses do not say how they were measured."""
        return "free decay" if self.origin == "free decay" else None

    @property
    def reciprocal(self) -> bool:
        """Whether its columns are inputs, whose responses can be those to a force at an output: H_ij = H_ji."""
        return self.origin in ("lines", "pulse", "dirac") and not self.of_correlations

    @property
    def decaying(self) -> bool:
        """Whether it is a free decay, which nothing drove."""
        return self.origin == "free decay"

    @property
    def exchanged(self) -> bool:
        """Whether inputs and outputs were exchanged: the outputs are the drive points."""
        return EXCHANGED in self.processing

    def transposed(self) -> Self:
        """Return the response with inputs and outputs exchanged, H'; a coherence of whole outputs (F, l) is left out.

        The unit of each side is one: that of the motion, and that of the force.
        """
        names = {f.name for f in fields(self)} & {"values", "variance", "coherence", "feedthrough"}
        given = {name: array for name in names if (array := getattr(self, name)) is not None}
        whole = {name: None for name, array in given.items() if name == "coherence" and array.ndim == 2}
        arrays = {name: np.ascontiguousarray(np.swapaxes(array, -1, -2)) for name, array in given.items()} | whole
        outputs, inputs = len(self.output_dofs), len(self.input_dofs)
        changed: Any = {
            **arrays,
            "output_dofs": self.input_dofs,
            "input_dofs": self.output_dofs,
            "units": (self.units[0][:1] * inputs, self.units[1][:1] * outputs),
            "groups": AUTO,
        }
        return replace(self, **changed).processed(EXCHANGED)

    @property
    def inseparable_inputs(self) -> tuple[Note, ...]:
        """A note on inputs that the data cannot separate."""
        return ()

    @property
    def coherence(self) -> RealArray | None:
        """Coherence of the lines; None where it was not estimated."""
        return None

    @property
    def variance(self) -> RealArray | None:
        """Variance E|error|^2 of every value; None where it was not estimated."""
        return None

    @property
    def averages(self) -> int | None:
        """Averages behind the values, from which the variance was estimated; None where they are not known."""
        return None

    @property
    def excited(self) -> tuple[float, float] | None:
        """Where the forces of the test act, Hz; None where that is not known."""
        return None

    @property
    def level(self) -> RealArray | None:
        """Noise level of every output, (l,); None where it was not estimated."""
        return None

    @property
    def feedthrough(self) -> RealArray | None:
        """Response at the impulse itself, (l, m); None where it was not measured apart."""
        return None

    @property
    def parts(self) -> tuple[int, str]:
        """How many parts have labels of groups, and what a part is, in words."""
        return int(self.values.shape[2]), "input"

    @property
    def drives(self) -> int:
        """Length of the participation of a pole: one number per input."""
        return len(self.input_dofs)

    @property
    def column_word(self) -> str:
        """Term for a column of the values: an input, or a reference of ambient data."""
        return "reference" if self.ambient else "input"

    @property
    def columns(self) -> tuple[str, ...]:
        """Labels of the last axis of the values: the inputs."""
        return self.input_dofs

    @property
    def outside_powers(self) -> tuple[int, ...]:
        """Powers of j w of the residual terms, for the modes outside the band; (0,) is the direct term alone."""
        return (0,)

    @property
    def refined_powers(self) -> tuple[int, ...]:
        """Powers with which a refinement starts; see `max_powers`."""
        return self.outside_powers

    @property
    def max_powers(self) -> int:
        """How many powers a refinement may use where the residual needs them."""
        return len(self.refined_powers)

    @abstractmethod
    def basis(self, poles: Array, powers: tuple[int, ...] = (0,), weights: Array | None = None) -> ModalBasis:
        """Return what poles (rad/s, as they are in the data) can contribute to the values, as real columns.

        Parameters
        ----------
        poles : array of complex, (n,)
        powers : tuple of int
            Powers of j w that stand beside the modes on lines: of the direct term, or of residuals.
        weights : array (F,), optional
            Weights of the lines.
        """

    def _label(self, outputs: int, inputs: int) -> bool:
        """Take labels and units, of which one text may be the unit of the whole response, and the quantity that they say."""
        if isinstance(self.units, str):
            freeze(self, units=sides_of(self.units))
        if said := Channels._label(self, outputs, inputs):
            freeze(self, **self._quantity_of([motion_of(unit) for unit in self.units[0]]))
        return said

    def _factors(self, outputs: RealArray, inputs: RealArray) -> RealArray:
        """Return what a change of units multiplies the values by: a response is a ratio of both sides, a correlation their product."""
        return outputs[:, None] * (inputs if self.ambient else 1 / inputs)

    def _quantity_of(self, kinds: Sequence[str | None]) -> dict[str, Any]:
        known = set(kinds)
        return {"quantity": self.quantity or (known.pop() if len(known) == 1 else None)}

    @property
    def whole(self) -> Response:
        """All of the data, where these are what models are judged on."""
        return self

    def judging(self) -> Response:
        """Return what models are judged on: of very long records some lines, `whole` has the others; the data themselves else."""
        return self

    def around(self, poles: Array) -> Response:
        """Return what tells about modes with these poles (rad/s) of very long data; the data themselves else.

        Parameters
        ----------
        poles : array of complex, (n,)
        """
        return self

    def whole_basis(self, poles: Array, powers: tuple[int, ...] = (0,)) -> ModalBasis:
        """Return the basis on all rows of the data, one per sample or two a line, real parts first: nothing is compressed.

        Parameters
        ----------
        poles : array of complex, (n,)
        powers : tuple of int
        """
        return self.basis(poles, powers)

    def residual_of(
        self, poles: Array, shapes: Array, participation: Array, powers: tuple[int, ...] = (0,)
    ) -> RealArray:
        """Return the data without what modes give, on the rows of `whole_basis`, (K, l, m); terms stay in it.

        Parameters
        ----------
        poles : array of complex, (n,)
        shapes : array of complex, (l, n)
        participation : array of complex, (n, m) or more columns
        powers : tuple of int
            Of the terms that the basis has.
        """
        basis = self.whole_basis(poles, powers)
        nothing = basis.of_terms(np.zeros((basis.terms.shape[1], basis.data[0].size)))
        return basis.data - basis.rebuilt(shapes, participation, nothing)

    @abstractmethod
    def named_terms(self, terms: RealArray, powers: tuple[int, ...]) -> dict[str, RealArray | None]:
        """Return fitted terms as the fields of a `ModalModel`: direct term, or lower and upper residual in powers of j w.

        Parameters
        ----------
        terms : array, (t, l, m)
            As `ModalBasis` gives them, of the relative frequency.
        powers : tuple of int, (t,)
        """

    def of_inputs(self, participation: Array) -> ComplexArray:
        """Return participation of the inputs alone, (n, m): what a basis fits beside them belongs to the data, not to the modes.

        Parameters
        ----------
        participation : array of complex, (n, m) or more columns
            As a `ModalBasis` gives it.
        """
        return participation[:, : len(self.input_dofs)]

    def shortest_participation(self, participation: Array) -> ComplexArray:
        """Return what the data tell of the participation of the inputs, (n, m): what inputs do not excite is left at zero.

        Parameters
        ----------
        participation : array of complex, (n, m)
        """
        return participation

    @abstractmethod
    def functions(self, poles: Array, *, slopes: bool = False, lines: slice = slice(None)) -> RealArray:
        """Return the functions of `basis` alone, (K, 2 n), with `slopes` their d/ds behind them, real columns e1, e2 of every pole.

        Parameters
        ----------
        poles : array of complex, (n,)
        slopes : bool
        lines : slice
            Lines that are wanted; of samples these are always all.
        """

    def derivatives(self, poles: Array) -> RealArray:
        """Return d/ds of the functions of `basis`, real columns e1, e2 of every pole.

        Parameters
        ----------
        poles : array of complex, (n,)
        """
        return self.functions(poles, slopes=True)[:, 2 * len(poles) :]

    @abstractmethod
    def spectrum(self) -> tuple[RealArray, ComplexArray]:
        """Return lines in Hz and complex values on them, fine enough that a neighbour's peak is not taken for a mode's own."""

    def spectra(self) -> Iterator[tuple[RealArray, ComplexArray]]:
        """Yield `spectrum`, of long records some lines at a time."""
        yield self.spectrum()

    def doubts(
        self, poles: Array, shapes: Array, participation: Array, terms: Array, trusted: Array
    ) -> tuple[Note, ...]:
        """Return what the fit of a model shows about how the data were measured.

        Parameters
        ----------
        poles : array of complex, (n,)
            rad/s, as they are in the data; one of each pair, and real ones.
        shapes : array of complex, (l, n)
        participation : array of complex, (n, m) or more columns
            As a `ModalBasis` gives it.
        terms : array, (t, l, m)
        trusted : array of bool, (n,)
            Poles that are taken for modes.
        """
        return ()

    def picture(self) -> Response:
        """Return what is drawn for these data: themselves, where they are responses."""
        return self

    @abstractmethod
    def energy(self, decay: Array) -> RealArray:
        """Return sum over the values of |g|^2 for a mode of residue one by its decay rate -Re s, as if it lay inside whole.

        Parameters
        ----------
        decay : array, (n,)
            1/s, positive.
        """

    def driven(self, poles: Array, participation: Array) -> RealArray:
        """Return how strongly the data drive each pole at its frequency, (n,): |l|, for responses to a unit at every input.

        Parameters
        ----------
        poles : array of complex, (n,)
            rad/s, as they are in the data.
        participation : array of complex, (n, m)
        """
        return np.asarray(np.linalg.norm(participation, axis=1))

    @abstractmethod
    def as_samples(self) -> Conversion:
        """Return the response as samples."""

    @abstractmethod
    def as_lines(self) -> Conversion:
        """Return the response as lines."""

    @abstractmethod
    def in_band(self, band: tuple[float, float] | None) -> Response:
        """Return the part of the data in a band; samples are not filtered and stay as they are.

        Parameters
        ----------
        band : (float, float) or None
            Hz.
        """

    @abstractmethod
    def reported_band(self, band: tuple[float, float] | None) -> tuple[float, float]:
        """Return the frequencies between which poles are reported.

        Parameters
        ----------
        band : (float, float) or None
            Hz, as asked.
        """

    @abstractmethod
    def rebuilt_by(self, model: Quadruple) -> Response:
        """Return the response of a model where this one was measured.

        Parameters
        ----------
        model : Quadruple
        """

    def values_of(self, model: Quadruple) -> Array:
        """Return the values alone of `rebuilt_by`, whatever they are.

        Parameters
        ----------
        model : Quadruple
        """
        return self.rebuilt_by(model).values

    def with_model(self, model: Quadruple) -> Iterator[tuple[Array, Array]]:
        """Yield measured values and those of a model, some lines or samples after the other.

        Parameters
        ----------
        model : Quadruple
        """
        yield self.values, self.values_of(model)

    @abstractmethod
    def of_modes(self, modes: ModeFields) -> Array:
        """Return the values of the response of modes where this one was measured.

        Parameters
        ----------
        modes : ModeFields
            With poles as they are in the data.
        """

    def rebuilt_labels(self) -> dict[str, Any]:
        """Return labels and quantity for a response that a model gives in this one's place."""
        return {**self.labelled(), "processing": (), "quantity": self.quantity}


def output_scale(response: Response) -> RealArray:
    """Return what brings outputs to one level, (l,): their noise where it is known, as least squares ask, else their root mean squares.

    One of a channel of zeros.
    """
    level = root_mean_squares(response) if response.level is None else response.level
    return np.where(level > 0, level, 1.0)


def root_mean_squares(response: Response) -> RealArray:
    """Return the root mean square of every output over lines or samples and inputs, (l,)."""
    parts = np.ascontiguousarray(response.values).view(np.float64).reshape(*response.values.shape[:2], -1)
    return np.asarray(np.sqrt(np.einsum("klp,klp->l", parts, parts) / (response.count * response.values.shape[2])))


#: Relative rounding of single precision, in which many responses are stored.
_SINGLE_PRECISION = 1e-7


def line_step(response: Response) -> float:
    """Return the distance of the lines, Hz; 0 of samples and of one line."""
    grid = response.grid
    return 0.0 if grid is None or grid.size < 2 else float(np.median(np.diff(grid)))


def window_over_lines(response: Response) -> float:
    """Return a T, the rate of an exponential window times the length that a line's distance tells; 0 without a window, and of samples.

    Noise under the window has the correlation 1 / (1 + j pi i / (a T)) between lines i apart.
    """
    step = line_step(response)
    return response.added_damping / step if step else 0.0


def fading(response: Response) -> RealArray | None:
    """Return exp(-a t), by which an exponential window lets steady noise fade over samples, (K,); None without one, and of lines.

    No smaller than rounding of what is stored: what lies below it does not fade with the window.
    """
    a = response.added_damping
    if a <= 0 or response.grid is not None or response.sampling_rate is None:
        return None
    return np.asarray(np.maximum(np.exp(-a / response.sampling_rate * np.arange(response.count)), _SINGLE_PRECISION))


def faded_noise(response: Response) -> Array | None:
    """Return what an exponential window exp(-a t) makes of steady noise: exp(-2 a t) over its mean, of lines its transform.

    On lines df apart, those of a record of 1 / df seconds, E n_(f + k) n_f* = variance / (1 + j pi k df / a).
    """
    a, grid = response.added_damping, response.grid
    if a <= 0:
        return None
    if grid is not None:
        return 1 / (1 + 1j * np.pi * np.arange(response.count) * line_step(response) / a)
    decay = fading(response)
    assert decay is not None
    return decay**2 / np.mean(decay**2)


@dataclass(frozen=True, eq=False, slots=True)
class Misfit:
    """norm(measured - rebuilt) / norm(measured), each output divided by a scale.

    `scale` (l,).
    """

    response: Response
    scale: RealArray
    _whole: float = field(init=False)

    def __post_init__(self) -> None:
        values = self.response.values
        energy = sum(np.einsum("klm,klm->l", part, part) for part in (values.real, values.imag))
        freeze(self, _whole=float(np.sqrt(np.sum(energy / self.scale**2))))

    def of_left(self, left: RealArray) -> float:
        """Return the misfit from the residual energy (l, m) of every channel."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self._of_energy(float(np.sum(left / self.scale[:, None] ** 2)))

    def _of_energy(self, energy: float) -> float:
        ratio = np.sqrt(energy) / self._whole
        return float(ratio) if np.isfinite(ratio) else np.inf

    def of_modes(self, basis: ModalBasis, shapes: Array, participation: Array, terms: Array) -> float:
        """Return the misfit of modes, rebuilt some lines or samples after the other.

        `basis`: of their poles. `shapes` (l, k). `participation` (k, m). `terms` (t, l, m).
        """
        channels = basis.data.shape[1:]
        level = np.repeat(1 / self.scale, channels[1]).reshape(channels)  # in one piece, as the residual
        energy = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for left in basis.missed(shapes, participation, terms[: basis.terms.shape[1]]):
                left *= level
                energy += float(np.vdot(left, left))
            return self._of_energy(energy)
