"""What a row of the table may be made of, and what follows from that alone: its way from records, what it refuses, what it loses."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

import numpy as np

from modalscope.model.checks import DataError
from modalscope.model.response import Response

__all__ = ["EXACT", "REFUSALS", "RESERVATIONS", "ROUTES", "Refusal", "Takes", "has_decayed"]

#: A response has decayed when its last tenth holds less than this share of the energy.
_DECAYED = 1e-3


class Takes(Enum):
    """What the data matrix of a row is made of, and so what `prepare` hands over."""

    SAMPLES = "samples"
    LINES = "lines"
    CONTINUOUS = "lines of a continuous structure"
    RESPONSE = "lines, or the samples of a window"
    PAST = "records projected on their past"
    RECORDS = "records with inputs on their own lines"
    DRIVEN = "records with inputs projected on their past"


#: The way from records with inputs to what a row takes.
ROUTES = {
    Takes.SAMPLES: "markov",
    Takes.LINES: "frf",
    Takes.CONTINUOUS: "frf",
    Takes.RESPONSE: "frf",
    Takes.PAST: "",
    Takes.RECORDS: "records",
    Takes.DRIVEN: "subspace",
}


class Refusal(NamedTuple):
    """Why a row cannot take data, and what to do instead."""

    reason: str
    change: str


def _no_samples(response: Response, records: bool) -> Refusal | None:
    if response.origin == "lines":
        return None
    return Refusal(
        "the data are samples: their transform is no rational function of j w",
        "Use domain='z', which is exact for samples, or give measured frequency responses.",
    )


def _no_records(response: Response, records: bool) -> Refusal | None:
    if records:
        return None
    return Refusal(
        "it projects records without inputs, and there are none",
        "Give Signals with outputs alone, or use method='alternate', which takes any response.",
    )


def _no_spectra(response: Response, records: bool) -> Refusal | None:
    if response.origin == "records":
        return None
    return Refusal(
        "it takes records with inputs, and these are none",
        "Give Signals with inputs, or leave route out.",
    )


#: Why a row cannot take the data, given whether records without inputs are there. Other rows take all data.
REFUSALS: dict[Takes, Callable[[Response, bool], Refusal | None]] = {
    Takes.CONTINUOUS: _no_samples,
    Takes.PAST: _no_records,
    Takes.RECORDS: _no_spectra,
    Takes.DRIVEN: _no_spectra,
}


def _no_even_lines(response: Response) -> str:
    try:
        response.as_samples()
    except DataError as error:
        return f"{error.asked}, but {error.found}"
    return ""


def _sampled_lines(response: Response) -> str:
    return "the lines are those of a sampled system, which domain z takes as they are" if response.held_input else ""


def _not_decayed(response: Response) -> str:
    if response.exact_lines or has_decayed(response):
        return ""
    return "the response has not decayed at its last sample, so that its lines are biased"


def has_decayed(response: Response) -> bool:
    """Whether little enough is left at the end for a transform of the samples to serve in place of lines."""
    energy = np.sum(np.abs(response.values) ** 2, axis=(1, 2))
    return bool(energy[-max(energy.size // 10, 1) :].sum() < _DECAYED * energy.sum())


#: Why a comparison leaves a row out although it can take the data; empty where it does not. Other rows are compared.
RESERVATIONS: dict[Takes, Callable[[Response], str]] = {
    Takes.SAMPLES: _no_even_lines,
    Takes.LINES: _not_decayed,
    Takes.CONTINUOUS: _sampled_lines,
}

#: Whether a row works on the data themselves, not on a transform that loses something. Other rows do.
EXACT: dict[Takes, Callable[[Response], bool]] = {
    Takes.SAMPLES: lambda response: response.exact_samples,
    Takes.LINES: lambda response: response.exact_lines,
}
