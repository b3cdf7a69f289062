"""What a comparison asks of responses and of methods: the only place of it where their kinds are told apart."""

from __future__ import annotations

import numpy as np

from modalscope.identification.table import Method
from modalscope.modal.basis import ModalBasis, basis_of_lines, basis_of_samples
from modalscope.model.checks import Array, DataError, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import to_discrete
from modalscope.model.response import Response

__all__ = [
    "basis_of",
    "default_orders",
    "derivatives",
    "domains_of",
    "exact_on",
    "has_decayed",
    "is_correlation",
    "lines_of",
    "method_orders",
    "spans_blocks",
    "states_per_order",
    "transformed_to",
    "unsuited",
]

#: Canonical forms have a block for every block row: beyond about this many states their eigenvalues cost more than they tell.
_COMPANION_STATES = 200

#: ... and of that many orders every second one will do.
_COMPANION_ORDERS = 30

#: A response has decayed when its last tenth holds less than this share of the energy.
_DECAYED = 1e-3


# -------------------------------------------------------------------------------------------------------- of responses


def basis_of(response: Response, poles: Array) -> ModalBasis:
    """Return the columns that the terms of poles (rad/s, as they are in the data) span, and the data as rows."""
    if isinstance(response, FrequencyResponse):
        return basis_of_lines(response, poles)
    return basis_of_samples(response, poles)


def derivatives(response: Response, poles: Array) -> RealArray:
    """Return d/ds of the modal functions, real columns e1, e2 of every pole."""
    if isinstance(response, ImpulseResponse):
        t = (np.arange(response.samples) + response.first_sample) / response.sampling_rate
        grown = t[:, None] * np.exp(np.outer(t, poles))
        return np.stack([2 * grown.real, -2 * grown.imag], axis=2).reshape(t.size, -1)
    f, rate = response.frequencies, response.sampling_rate
    x, p, chain = 2j * np.pi * f, poles, np.ones(poles.size, dtype=complex)
    if rate is not None:
        x, p = np.exp(x / rate), to_discrete(poles, 1 / rate)
        chain = p / rate
    own, pair = chain / (x[:, None] - p) ** 2, chain.conj() / (x[:, None] - p.conj()) ** 2
    columns = np.stack([own + pair, 1j * (own - pair)], axis=2).reshape(f.size, -1)
    return np.vstack([columns.real, columns.imag])


def is_correlation(response: Response) -> bool:
    """Whether a response was estimated from a record of outputs alone."""
    return isinstance(response, ImpulseResponse) and response.kind == "correlation"


def lines_of(response: Response) -> RealArray | None:
    """Return the lines in Hz; None of samples, which have no band and no resolution of their own."""
    return response.frequencies if isinstance(response, FrequencyResponse) else None


def transformed_to(response: Response) -> str:
    """Return what the data become for the methods that do not take them as they are: "samples" or "lines"."""
    return "lines" if lines_of(response) is None else "samples"


def domains_of(response: Response) -> tuple[str, ...]:
    """Return the domains whose data matrices take the data without loss, so that identities hold to rounding."""
    if isinstance(response, ImpulseResponse):
        return ("time", "z")
    return ("z",) if response.sampling_rate is not None else ("z", "s")


def default_orders(response: Response) -> tuple[int, ...]:
    """Return 2, 4, ... up to 80 for frequency responses, 60 for impulse responses and 40 for correlations."""
    largest = 80 if lines_of(response) is not None else 40 if is_correlation(response) else 60
    return tuple(range(2, largest + 1, 2))


def has_decayed(response: ImpulseResponse) -> bool:
    """Whether little enough is left at the end for a transform of the samples to serve in place of lines."""
    energy = np.sum(response.values**2, axis=(1, 2))
    return bool(energy[-max(energy.size // 10, 1) :].sum() < _DECAYED * energy.sum())


# ---------------------------------------------------------------------------------------------- of methods on responses


def unsuited(method: Method, response: Response, records: bool) -> str | None:
    """Return why the data do not suit a method, in words; None when they do.

    Parameters
    ----------
    method : Method
    response : FrequencyResponse or ImpulseResponse
    records : bool
        Whether the records without inputs that the response was estimated from are there.
    """
    if method.on_records:
        return None if records else f"{method} left out: it projects records without inputs, and there are none"
    if isinstance(response, FrequencyResponse):
        if method.domain == "time":
            return _no_samples(response)
        if method.domain == "s" and response.sampling_rate is not None:
            return "domain s left out: the lines are those of a sampled system, which domain z takes as they are"
        return None
    if method.domain == "s":
        return "domain s left out: the transform of samples is no rational function of j w"
    if method.factors == "fraction" and not has_decayed(response):
        return f"{method} left out: the response has not decayed at its last sample, so that its lines are biased"
    return None


def _no_samples(response: FrequencyResponse) -> str | None:
    """Return why lines cannot be transformed to samples."""
    try:
        response.to_impulse_response()
    except DataError as error:
        return f"domain time left out: {error.asked}, but {error.found}"
    return None


def exact_on(method: Method, response: Response) -> bool:
    """Whether a method works on the data themselves, not on a transform of them from lines to samples or back."""
    if isinstance(response, ImpulseResponse):
        return method.factors != "fraction"
    if method.factors in ("fraction", "complete"):
        return method.factors == "fraction"
    return method.domain != "time" or _whole_spectrum(response)


def _whole_spectrum(response: FrequencyResponse) -> bool:
    """Whether the lines of a sampled system's response cover everything from zero to half the sampling rate."""
    f, rate = response.frequencies, response.sampling_rate
    return rate is not None and bool(f[0] == 0 and np.isclose(f[-1], rate / 2))


def states_per_order(method: Method, inputs: int) -> int:
    """Return how many states an order stands for: one, or one an input where the order is the degree of a matrix fraction."""
    return inputs if method.factors == "fraction" else 1


def method_orders(
    method: Method, response: Response, states: tuple[int, ...]
) -> tuple[tuple[int, ...], dict[str, int]]:
    """Return the orders of a method that numbers of states mean, and block sizes that are not its own default.

    A matrix fraction counts degrees; an untruncated companion form has whole blocks; a canonical form on lines grows with the block
    rows, so that these are kept few and some of many orders are left out.
    """
    outputs, inputs = response.values.shape[1:]
    if method.factors == "fraction":
        return tuple(sorted({max(n // 2, 2) for n in states})), {}
    if method.factors == "complete":
        return tuple(sorted({inputs * max(-(-n // inputs), 1) for n in states})), {}
    if not method.canonical or method.domain == "time":
        return states, {}
    degree = max(min(48, _COMPANION_STATES // outputs), -(-states[-1] // outputs) + 2)
    few = states if len(states) <= _COMPANION_ORDERS else tuple(n for n in states if (states[-1] - n) % 4 == 0)
    return few or states, {"block_rows": degree} if lines_of(response) is not None else {}


def spans_blocks(method: Method) -> bool:
    """Whether the block rows of a method span a time that its modes must fit into."""
    return method.domain == "time" and not method.canonical
