"""What a response is: its values, and the facts that stages ask for without computing anything."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from modalscope.model.channels import Channels
from modalscope.model.checks import Array, RealArray
from modalscope.model.groups import AUTO, Groups
from modalscope.model.notes import Note
from modalscope.model.shown import Convertible

__all__ = ["CORRELATED", "HALF", "UNTOLD", "ResponseFacts"]

#: What the processing of correlations says, and of half spectra.
CORRELATED, HALF = "correlated", "half spectra"

#: The kind of a note on inputs whose shares in what they give together are not known, by label.
UNTOLD = "inputs not told apart"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class ResponseFacts(Channels, Convertible):
    """A measured response, (lines or samples, outputs, inputs), and what is known of it before anything is computed; see `Response`.

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
        One label an input (of records: a run): what disagrees between groups is repeatability.
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
    def of_correlations(self) -> bool:
        """Whether lines are half spectra, whose errors are correlated from line to line, as those of correlations are."""
        return any(HALF in step for step in self.processing)

    @property
    def untold(self) -> tuple[Note, ...]:
        """A note on inputs whose shares in what they give together the data do not tell; its numbers stand by their labels."""
        return ()

    @property
    def known_variance(self) -> RealArray | None:
        """Variance E|error|^2 of every value, where the data carry one."""
        return getattr(self, "variance", None)

    @property
    def known_level(self) -> RealArray | None:
        """What every output is divided by to be level with the others by its noise, (l,), where that is known."""
        return getattr(self, "level", None)

    @property
    def scattered_variance(self) -> bool:
        """Whether that variance is itself an estimate from a number of averages, line by line."""
        return getattr(self, "averages", None) is not None

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

    @property
    def parts(self) -> tuple[int, str]:
        """How many parts have labels of groups, and what a part is, in words."""
        return int(self.values.shape[2]), "an input"

    @property
    def drives(self) -> int:
        """How many numbers say what drives a pole: one an input."""
        return len(self.input_dofs)

    @property
    @abstractmethod
    def outside_powers(self) -> tuple[int, ...]:
        """Powers of j w that a fit should carry beside the modes, for the modes outside the band; (0,) is the direct term alone."""

    @property
    def refined_powers(self) -> tuple[int, ...]:
        """Powers that a refinement carries beside the modes."""
        return self.outside_powers

    @property
    def separable(self) -> bool:
        """Whether what a pole contributes is the same function for all inputs."""
        return True

    @property
    def column_word(self) -> str:
        """What the field calls a column of the values: an input, or a reference of ambient data."""
        return "reference" if self.ambient else "input"

    @property
    def columns(self) -> tuple[str, ...]:
        """What the last axis of the values is: the inputs."""
        return self.input_dofs

    @property
    @abstractmethod
    def exact_samples(self) -> bool:
        """Whether the response as samples loses nothing."""

    @property
    @abstractmethod
    def exact_lines(self) -> bool:
        """Whether the response as lines loses nothing."""
