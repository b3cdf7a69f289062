"""From data of any kind to the response that a method's domain needs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.identification.table import Method, find_method
from modalscope.model.checks import DataError, check_kind
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.response import Response
from modalscope.model.signals import Signals

__all__ = ["Data", "Prepared", "prepare"]

Data = Signals | Response


class Prepared(NamedTuple):
    """What a method works on.

    Attributes
    ----------
    method : Method
        The cell of the table.
    response : Response
        In the domain of the method.
    records : Signals, optional
        Records without inputs, filtered to the band, where they were given.
    notes : list of str
        What was converted.
    """

    method: Method
    response: Response
    records: Signals | None
    notes: list[str]


def prepare(data: Data, method: str | None, domain: str | None, band: tuple[float, float] | None) -> Prepared:
    """Return the cell of the table, the response in its domain, and notes on what was converted.

    Raises
    ------
    DataError
        A channel of zeros, a band without lines, an unknown method or domain, a method of records where there are none.
    """
    notes: list[str] = []
    response, records = _to_response(data, band, notes)
    of_lines = isinstance(response, FrequencyResponse)
    default = "alternate" if of_lines or isinstance(data, Signals) else "era"
    cell = find_method(
        default if method is None else method,
        domain,
        "s" if of_lines and response.sampling_rate is None else "z" if of_lines else "time",
    )
    if cell.on_records and records is None:
        raise DataError(
            f"method {cell.name!r} was asked, which projects records without inputs",
            "these are records with inputs" if isinstance(data, Signals) else f"this is {type(data).__name__}",
            "Give Signals with outputs alone, or use method='alternate', which takes any response.",
        )
    if isinstance(response, FrequencyResponse) and band is not None:
        response = response.band(*band)
    if cell.domain == "time" and isinstance(response, FrequencyResponse):
        response = response.to_impulse_response()
        notes.append("the lines were transformed to samples: damping is biased unless they cover the whole spectrum")
    elif cell.domain == "s" and isinstance(response, ImpulseResponse):
        raise DataError(
            f"method {cell.name!r} in domain 's' was asked",
            "the data are samples: their transform is no rational function of j w",
            "Use domain='z', which is exact for samples, or give measured frequency responses.",
        )
    elif cell.factors == "fraction" and isinstance(response, ImpulseResponse):
        response = response.to_frequency_response()
        if band is not None:
            response = response.band(*band)
        notes.append("the samples were transformed to lines as if nothing followed the last one")
    _check_channels(response)
    return Prepared(cell, response, records, notes)


def _to_response(data: Data, band: tuple[float, float] | None, notes: list[str]) -> tuple[Response, Signals | None]:
    """Return the response, and the records in the band that correlations were estimated from."""
    if isinstance(data, ImpulseResponse | FrequencyResponse):
        return data, None
    check_kind("data", data, (FrequencyResponse, ImpulseResponse, Signals))
    from modalscope.preprocess import estimate_correlation, estimate_frf, filter_band

    if data.inputs is not None:
        notes.append("frequency responses were estimated from the records (H1)")
        return estimate_frf(data), None
    if band is not None:
        data = filter_band(data, *band)
    notes.append("correlations with all channels as references were estimated from the records")
    return estimate_correlation(data), data


def _check_channels(response: Response) -> None:
    """Raise on a channel of zeros: nothing can be read off it, and it hides a wrong cable or a wrong column."""
    for side, axes, labels in (("output", (0, 2), response.output_dofs), ("input", (0, 1), response.input_dofs)):
        dead = [labels[i] for i in np.flatnonzero(~np.any(response.values, axis=axes))]
        if dead:
            raise DataError(
                f"data with a response in every {side} were asked",
                f"{side} {', '.join(dead)} is zero throughout",
                f"Leave it out: exclude={dead!r}, or --exclude {' '.join(dead)}.",
            )
