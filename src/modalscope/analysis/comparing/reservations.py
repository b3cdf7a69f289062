"""Tell which rows of the table a comparison leaves aside although the data suit them, and which use the data themselves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modalscope.data.response import Response
from modalscope.identification.method import Method, Takes
from modalscope.numerics.errors import DataError

#: Maximum share of the energy in the last tenth of a response that has decayed.
_MAX_LATE_ENERGY = 1e-3


def _no_even_lines(response: Response) -> str:
    try:
        response.as_samples()
    except DataError as error:
        return error.fault
    return ""


def _sampled_lines(response: Response) -> str:
    return "lines of a sampled system need domain z" if response.held_input else ""


def _not_decayed(response: Response) -> str:
    if response.exact_lines or has_decayed(response):
        return ""
    return "the response has not decayed at its last sample: its lines are biased"


def has_decayed(response: Response) -> bool:
    """Whether a response has decayed at its last samples, so that a transform of the samples is unbiased."""
    energy = np.sum(np.abs(response.values) ** 2, axis=(1, 2))
    return bool(energy[-max(energy.size // 10, 1) :].sum() < _MAX_LATE_ENERGY * energy.sum())


#: Why a comparison omits a row although the data suit it, or an empty text. Other rows are compared.
RESERVATIONS: dict[Takes, Callable[[Response], str]] = {
    Takes.SAMPLES: _no_even_lines,
    Takes.LINES: _not_decayed,
    Takes.CONTINUOUS: _sampled_lines,
}

#: Whether a row uses the data themselves, not a lossy transform. Other rows do.
EXACT: dict[Takes, Callable[[Response], bool]] = {
    Takes.SAMPLES: lambda response: response.exact_samples,
    Takes.LINES: lambda response: response.exact_lines,
}


def reservation(row: Method, response: Response) -> str:
    """Return why a comparison omits a row although the data suit it, or an empty text."""
    found = RESERVATIONS.get(row.takes)
    return found(response) if found else ""


def exact_on(row: Method, response: Response) -> bool:
    """Return whether a row uses the data themselves, not a lossy transform."""
    exact = EXACT.get(row.takes)
    return exact is None or exact(response)
