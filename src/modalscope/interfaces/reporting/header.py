"""Read and write the head of a report to a customer: project, structure, operator, date, sensors with their calibration, conclusion."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from modalscope.data import DataError
from modalscope.interfaces.reporting.html import Section, listing, paragraph, table
from modalscope.numerics.checks import check_path

#: What is told of a sensor comes first in this order; what else is given follows.
_SENSOR = ("channel", "sensor", "serial", "sensitivity", "calibrated")

#: Entries that have a place of their own.
_PLACED = ("title", "sensors", "conclusion")


def header_of(given: str | Path | Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the entries of a header: those of a TOML file, or as they are given.

    Raises `DataError`: no TOML, or sensors that are no tables.
    """
    if given is None or isinstance(given, Mapping):
        header = dict(given or {})
    else:
        path = check_path(given)
        try:
            header = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            fault = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            remedy = 'Write lines such as project = "Bridge 7", and a table [[sensors]] for each sensor.'
            raise DataError(f"reading the header {path.name}:", fault.lower(), remedy) from None
    sensors = header.get("sensors", [])
    if not isinstance(sensors, list) or not all(isinstance(sensor, Mapping) for sensor in sensors):
        remedy = "Write a table [[sensors]] for each, with channel, sensor, serial, sensitivity, calibrated."
        raise DataError("the sensors of a header are tables", f"they are {str(sensors)[:60]}", remedy)
    return header


def header_of_remarks(remarks: Iterable[str]) -> dict[str, Any]:
    """Return the entries of a header that remarks on an analysis are: `project: Bridge 7`; of sensors a line each, parted by commas.

    Examples
    --------
    >>> header_of_remarks(["project: Bridge 7", "measured in rain"])
    {'project': 'Bridge 7'}
    """
    pairs = (remark.partition(": ") for remark in remarks)
    header: dict[str, Any] = {key.strip(): text.strip() for key, sign, text in pairs if sign and text.strip()}
    rows = [map(str.strip, line.split(",")) for line in header.get("sensors", "").splitlines()]
    return header | ({"sensors": [dict(zip(_SENSOR, row, strict=False)) for row in rows]} if rows else {})


def header_sections(header: Mapping[str, Any]) -> Iterator[Section]:
    """Yield the head of a report: its entries and sensors, and the conclusion; nothing without entries."""
    facts = [(str(key).replace("_", " "), str(value)) for key, value in header.items() if key not in _PLACED]
    sensors = header.get("sensors", [])
    body = listing(facts) if facts else ""
    if sensors:
        known = [*_SENSOR, *dict.fromkeys(key for sensor in sensors for key in sensor if key not in _SENSOR)]
        columns = [key for key in known if any(key in sensor for sensor in sensors)]
        rows = [[str(sensor.get(key, "")) for key in columns] for sensor in sensors]
        body += table(columns, rows, words=range(len(columns)), caption="Sensors and their calibration")
    if body:
        yield Section("test", "Test", body)
    if header.get("conclusion"):
        texts = str(header["conclusion"]).split("\n\n")
        yield Section("conclusion", "Conclusion", "".join(map(paragraph, texts)))
