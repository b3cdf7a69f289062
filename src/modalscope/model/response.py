"""What an identification asks of a response, whichever of the two kinds it is: lines or samples."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.modal_basis import ModalBasis
from modalscope.model.notes import Note
from modalscope.model.response_facts import ResponseFacts

if TYPE_CHECKING:
    from modalscope.model.frequency import FrequencyResponse
    from modalscope.model.impulse import ImpulseResponse
    from modalscope.model.modes import ModalModel
    from modalscope.model.statespace import StateSpace

__all__ = ["AsLines", "AsSamples", "Response"]


class AsSamples(NamedTuple):
    """A response as samples, and what was done (empty when they were samples)."""

    response: ImpulseResponse
    note: str


class AsLines(NamedTuple):
    """A response as lines, and what was done (empty when they were lines)."""

    response: FrequencyResponse
    note: str


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Response(ResponseFacts):
    """A measured response: what both kinds, lines and samples, offer to whoever identifies or judges; see `ResponseFacts` for its fields.

    Nobody has to ask which kind it is: what differs is a method here.
    """

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
        """Return the basis on all rows of the data, one a sample or two a line, real parts first: nothing is compressed.

        Parameters
        ----------
        poles : array of complex, (n,)
        powers : tuple of int
        """
        return self.basis(poles, powers)

    def left_of(self, poles: Array, shapes: Array, participation: Array, powers: tuple[int, ...] = (0,)) -> RealArray:
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
        return np.asarray(basis.data - basis.rebuilt(shapes, participation, nothing))

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

    def told_of(self, participation: Array) -> ComplexArray:
        """Return what the data tell of the participation of the inputs, (n, m): what inputs do not excite is left at zero.

        Parameters
        ----------
        participation : array of complex, (n, m)
        """
        return np.asarray(participation)

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

    def beside(self, model: StateSpace) -> Iterator[tuple[Array, Array]]:
        """Yield measured values and those of a model, some lines or samples after the other.

        Parameters
        ----------
        model : StateSpace
        """
        yield self.values, self.values_of(model)

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
