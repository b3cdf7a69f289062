"""What can make methods disagree: one name, one explanation and one remedy for each cause."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CAUSES", "Cause", "Disagreement"]

#: Name of a cause -> what to do about it.
CAUSES = {
    "dead channel": "Check the sensor and its cable; leave the channel out or measure it again.",
    "swapped sign": "Check direction and polarity of the sensor or the hammer, and turn the channel's sign.",
    "bad channel": "Look at the channel's coherence and time record; leave it out or measure it again.",
    "order too low": "Raise the largest order.",
    "too few blocks": "Raise block_rows, or measure a longer record.",
    "too few lines": "Measure with a finer resolution (longer records).",
    "heavy damping": "Take its damping as an estimate; excite it alone or measure in a band of its own.",
    "close pair": "Use several inputs and a finer resolution, and look at the two shapes together.",
    "weak mode": "Put an input or a sensor where this mode moves, or average more.",
    "edge of the band": "Widen the band.",
    "transformed data": "Prefer the methods that work on the data as they were measured.",
    "leakage": "Trust the records on their own lines; for frequency responses use longer segments or periodic forces.",
    "unmeasured forces": "Measure all forces, and look for noise on the force sensors; take no damping from this record.",
    "delay": "Look for channels of other acquisition units or filters, and align them.",
    "bias": "Look whether a mode is missing or split there; a certificate (modalscope certify) tells which method is biased.",
    "poor fit": "Look at that way alone, with more orders or a narrower band; until then it says nothing against a mode.",
    "too short": "Measure a longer record.",
    "poor excitation": "Drive the inputs independently of each other, and over the whole band.",
    "not separated": "Look at the stabilization diagrams of the methods that miss it.",
}


@dataclass(frozen=True)
class Cause:
    """A likely cause.

    `name`: A key of `CAUSES`. `evidence`: the numbers that point to it. `channel`: the channel it concerns; empty when none.
    """

    name: str
    evidence: str
    channel: str = ""

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return CAUSES[self.name]

    def __str__(self) -> str:
        return f"{self.name} ({self.evidence})"


@dataclass(frozen=True)
class Disagreement:
    """Where methods differ, and why.

    `mode`: which mode of the consensus, counted from zero; None for what concerns the data as a whole. `what`: what differs, in words.
    `methods`: the methods that differ from the others. `causes`: the likely ones first.
    """

    mode: int | None
    what: str
    methods: tuple[str, ...]
    causes: tuple[Cause, ...]
