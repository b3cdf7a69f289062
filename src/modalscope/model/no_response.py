"""Outputs beside what drove them: data that are judged like responses and are none."""

from __future__ import annotations

from dataclasses import dataclass

from modalscope.model.checks import Array, DataError, RealArray
from modalscope.model.response import AsLines, AsSamples, Response

__all__ = ["NoResponse"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class NoResponse(Response):
    """What records on lines refuse, and why: nothing was divided by the inputs, which act together."""

    @property
    def origin(self) -> str:
        """Records."""
        return "records"

    @property
    def steps_late(self) -> int:
        """Lines begin at the impulse itself: 0."""
        return 0

    def functions(self, poles: Array, *, slopes: bool = False, lines: slice = slice(None)) -> RealArray:
        """Records have no functions that are the same for all inputs."""
        raise DataError(
            "functions of poles alone were asked",
            "in records every pole is driven by all inputs together",
            "Use those of a frequency response.",
        )

    @property
    def outside_powers(self) -> tuple[int, ...]:
        """The direct term alone."""
        return (0,)

    @property
    def separable(self) -> bool:
        """False: all inputs act together."""
        return False

    @property
    def columns(self) -> tuple[str, ...]:
        """What the last axis of the values is: all inputs act together."""
        return ("all inputs",)

    @property
    def exact_samples(self) -> bool:
        """False: records are no samples of a response."""
        return False

    @property
    def exact_lines(self) -> bool:
        """False: records are no lines of a response."""
        return False

    def as_samples(self) -> AsSamples:
        """Records are no response; see `estimate_markov`."""
        raise self._no_response("samples of a response", "route='markov'")

    def as_lines(self) -> AsLines:
        """Records are no response; see `estimate_frf`."""
        raise self._no_response("frequency responses", "route='frf'")

    @staticmethod
    def _no_response(what: str, change: str) -> DataError:
        return DataError(f"{what} were asked", "the data are records on lines", f"Use {change}.")
