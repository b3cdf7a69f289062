"""Tell which rows of the table suit which data, and by which route."""

from __future__ import annotations

from typing import NamedTuple

from modalscope.data.response import Response
from modalscope.data.results import Settings
from modalscope.identification.method import Method, Takes
from modalscope.identification.prepare import Measured
from modalscope.numerics.errors import DataError

#: The route from records with inputs to the data of a row.
ROUTES = {
    Takes.SAMPLES: "markov",
    Takes.LINES: "frf",
    Takes.CONTINUOUS: "frf",
    Takes.RESPONSE: "frf",
    Takes.PAST: "",
    Takes.RECORDS: "records",
    Takes.DRIVEN: "subspace",
}

#: A route that is only ever the usual one -> the route whose rows take its data, and whose place it has: both give samples.
INSTEAD = {"decays": "markov"}


class Refusal(NamedTuple):
    """Why data do not suit a row, and the remedy."""

    reason: str
    change: str


_NO_LINES = Refusal(
    "samples have no rational transform in j w",
    "Use domain='z', which is exact for samples, or give measured frequency responses.",
)
_NO_RECORDS = Refusal(
    "it needs records without inputs",
    "Give Signals with outputs alone, or use method='alternate', which accepts any response.",
)
_NO_INPUTS = Refusal("it needs records with inputs", "Give Signals with inputs, or omit route.")

#: Origin of a response that a row needs, and the refusal of others. Other rows accept all data.
REFUSALS: dict[Takes, tuple[str, Refusal]] = {
    Takes.CONTINUOUS: ("lines", _NO_LINES),
    Takes.RECORDS: ("records", _NO_INPUTS),
    Takes.DRIVEN: ("records", _NO_INPUTS),
}


def refusal(row: Method, response: Response, records: bool) -> Refusal | None:
    """Return why these data do not suit a row, or None. `records`: whether there are records without inputs."""
    if row.takes is Takes.PAST:
        return None if records else _NO_RECORDS
    needed = REFUSALS.get(row.takes)
    return needed[1] if needed and response.origin != needed[0] else None


def check_suits(row: Method, measured: Measured) -> None:
    """Raise `DataError` where the data do not suit a row."""
    why = refusal(row, measured.response, measured.held is not None)
    if why:
        asked = f"method {row.name!r} in domain {row.domain!r}:"
        raise DataError(asked, f"{why.reason}: this is {measured.given}", why.change)


def route_of(row: Method) -> str:
    """Return the route from records with inputs to the data of a row, or an empty text."""
    return row.from_records or ROUTES[row.takes]


def served_by(row: Method, route: str) -> bool:
    """Whether a route from records with inputs gives the data of a row; frequency responses and decays also give samples."""
    return route == route_of(row) or (route in ("frf", "decays") and row.takes is Takes.SAMPLES)


def is_driven(row: Method) -> bool:
    """Whether a row needs records with inputs."""
    return row.takes in (Takes.RECORDS, Takes.DRIVEN)


def of_past(row: Method) -> bool:
    """Whether a row projects records on their past."""
    return row.takes in (Takes.PAST, Takes.DRIVEN)


def rows_span(row: Method, settings: Settings, dt: float | None) -> float | None:
    """Return the seconds that block rows span at a sampling interval; None where they are no samples, or all of them are states."""
    rows = settings.get("block_rows")
    of_samples = row.takes in (Takes.SAMPLES, Takes.PAST, Takes.DRIVEN) and row.orders.truncates
    return None if rows is None or dt is None or not of_samples else float(rows * dt)
