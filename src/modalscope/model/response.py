"""What an identification asks of a response, whichever of the two kinds it is: lines or samples."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modalscope.model.channels import Channels
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.groups import AUTO, Groups
from modalscope.model.modal_basis import ModalBasis
from modalscope.model.notes import Note

if TYPE_CHECKING:
    from modalscope.model.frequency import FrequencyResponse
    from modalscope.model.impulse import ImpulseResponse
    from modalscope.model.modes import ModalModel
    from modalscope.model.statespace import StateSpace

__all__ = ["AsLines", "AsSamples", "Response", "output_scale", "window_damping"]


class AsSamples(NamedTuple):
    """A response as samples, and what was done (empty when they were samples)."""

    response: ImpulseResponse
    note: str


class AsLines(NamedTuple):
    """A response as lines, and what was done (empty when they were lines)."""

    response: FrequencyResponse
    note: str


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Response(Channels):
    """A measured response, (lines or samples, outputs, inputs): what both kinds offer to whoever identifies or judges.

    Nobody has to ask which kind it is: what differs is a method here.

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
        One label an input: what disagrees between groups is repeatability.
    """

    values: Array
    sampling_rate: float | None = None
    quantity: str | None = None
    added_damping: float = 0.0
    groups: Groups = AUTO

    @property
    @abstractmethod
    def origin(self) -> str:
        """Where the values came from: "lines", or the kind of an impulse response."""

    @property
    def ambient(self) -> bool:
        """Whether the response was estimated from outputs alone, so that its columns are references and it carries estimation errors."""
        return self.origin == "correlation"

    @property
    def known_variance(self) -> RealArray | None:
        """Variance E|error|^2 of every value, where the data carry one."""
        return getattr(self, "variance", None)

    @property
    def deviations_withheld(self) -> str:
        """Why no standard deviations can be given of what is read off these data; empty where they can."""
        return ""

    @property
    def count(self) -> int:
        """Number of lines or samples."""
        return int(self.values.shape[0])

    @property
    def room(self) -> int | None:
        """Largest number of states worth a try; None where the samples alone do not tell."""
        return None

    @property
    @abstractmethod
    def span(self) -> tuple[float, float]:
        """Lowest and highest frequency that the data can show, Hz."""

    @property
    @abstractmethod
    def grid(self) -> RealArray | None:
        """The lines in Hz; None of samples, which have no resolution of their own."""

    @property
    @abstractmethod
    def held_input(self) -> bool:
        """Whether the response is that of a sampled system under a held input, H(z) = D + sum phi l' / (z - exp(s dt))."""

    @property
    @abstractmethod
    def steps_late(self) -> int:
        """Sampling intervals from the impulse to the first sample; 0 for lines."""

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

    @property
    @abstractmethod
    def outside_powers(self) -> tuple[int, ...]:
        """Powers of j w that a fit should carry beside the modes, for the modes outside the band; (0,) is the direct term alone."""

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
        return np.asarray(participation[:, : len(self.input_dofs)])

    @abstractmethod
    def derivatives(self, poles: Array) -> RealArray:
        """Return d/ds of the functions of `basis`, real columns e1, e2 of every pole.

        Parameters
        ----------
        poles : array of complex, (n,)
        """

    @abstractmethod
    def spectrum(self) -> tuple[RealArray, ComplexArray]:
        """Return lines in Hz and complex values on them, fine enough that a neighbour's peak is not taken for a mode's own."""

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

    @property
    def separable(self) -> bool:
        """Whether what a pole contributes is the same function for all inputs."""
        return True

    @property
    def columns(self) -> tuple[str, ...]:
        """What the last axis of the values is: the inputs."""
        return self.input_dofs

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

    @property
    @abstractmethod
    def exact_samples(self) -> bool:
        """Whether the response as samples loses nothing."""

    @property
    @abstractmethod
    def exact_lines(self) -> bool:
        """Whether the response as lines loses nothing."""

    @abstractmethod
    def as_samples(self) -> AsSamples:
        """Return the response as samples."""

    @abstractmethod
    def as_lines(self) -> AsLines:
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
    def rebuilt_by(self, model: StateSpace) -> Response:
        """Return the response of a model where this one was measured.

        Parameters
        ----------
        model : StateSpace
        """

    def values_of(self, model: StateSpace) -> Array:
        """Return the values alone of `rebuilt_by`, whatever they are.

        Parameters
        ----------
        model : StateSpace
        """
        return self.rebuilt_by(model).values

    @abstractmethod
    def of_modes(self, modes: ModalModel) -> Response:
        """Return the response of modes where this one was measured.

        Parameters
        ----------
        modes : ModalModel
            With poles as they are in the data.
        """

    def rebuilt_labels(self) -> dict[str, Any]:
        """Return labels and quantity for a response that a model gives in this one's place."""
        return {**self.labelled(), "processing": (), "quantity": self.quantity}


def output_scale(response: Response) -> RealArray:
    """Return the root mean square of every output, (l,), by which quiet outputs are brought level with loud ones."""
    return np.asarray(np.sqrt(np.mean(np.abs(response.values) ** 2, axis=(0, 2))))


def window_damping(response: Response) -> float:
    """Return the decay rate (1/s) that an exponential window added: it is in the data, but not in the modes."""
    return response.added_damping
