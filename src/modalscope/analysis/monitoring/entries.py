"""Make of a file what is stored of it: its time, its content's hash, and its modes or the reason why there are none."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.analysis.monitoring.history import rows_of
from modalscope.analysis.workflow.analyze import analyze
from modalscope.data.analysis import VERSION
from modalscope.identification.options import AllOptions
from modalscope.io.analysis import analysis_to
from modalscope.numerics.arguments import LIBRARY_ERRORS
from modalscope.numerics.errors import DataError, as_printed

#: What `analyze` may be told of a record.
CHOICES = (*inspect.signature(analyze).parameters, *AllOptions.__annotations__)

#: Date and time in the name of a file: 2026-06-01T12-30-00, 20260601_1230, 2026.06.01 12.30 and the like.
_STAMP = re.compile(
    r"(?<!\d)((?:19|20)\d\d)[-._]?(\d\d)[-._]?(\d\d)[-._T ]{0,3}(\d\d)[-._:hH]?(\d\d)(?:[-._:mM]?(\d\d))?(?!\d)"
)


def time_of_file(path: Path) -> tuple[float, str]:
    """Return when a record began, seconds since 1970 (UTC), and what says so: its name, else the date of its last change.

    Examples
    --------
    >>> time_of_file(Path("bridge_20260601_1230.csv"))
    (1780317000.0, 'name of the file')
    """
    for found in _STAMP.finditer(path.stem):
        try:
            when = datetime(*(int(part or 0) for part in found.groups()), tzinfo=UTC)  # type: ignore[arg-type, misc]
        except ValueError:
            continue
        return when.timestamp(), "name of the file"
    return path.stat().st_mtime, "last change of the file"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What is stored of one record; `refused`: why it could not be used, else None. `time`: seconds since 1970.

    `seen`: path, size and date (ns) of the file that it is the content of.
    """

    sha256: str
    name: str
    time: float
    modes: Mapping[str, Any] | None = None
    refused: str | None = None
    covariates: Mapping[str, float] = field(default_factory=dict)
    findings: Sequence[str] = ()
    settings: Any = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    seen: tuple[str, int, int] | None = None


def entry_of(
    data: Any,
    *,
    sha: str,
    name: str,
    time: float,
    covariates: Mapping[str, float] | None = None,
    origin: Mapping[str, Any] | None = None,
    options: Mapping[str, Any] | None = None,
) -> Entry:
    """Return the modes of a file or of data, identified, or the reason why there are none: any worker does this."""
    more: dict[str, Any] = {"sha256": sha, "name": name, "time": time, "covariates": dict(covariates or {})}
    about = {"modalscope": VERSION, "stored": datetime.now(UTC).isoformat(timespec="seconds"), **(origin or {})}
    try:
        result = analyze(data, **(options or {}))
    except DataError as error:
        return Entry(**more, refused=as_printed(error), provenance=about)
    except (*LIBRARY_ERRORS, OSError) as error:  # months go on without this record
        return Entry(**more, refused=f"the program fails ({type(error).__name__}: {error})", provenance=about)
    unit = result.modes.normalized()
    modes, kept = rows_of(unit), np.array([kind == "mode" for kind in unit.kinds], bool)
    modes |= {"shapes_std": None if unit.shapes_std is None else unit.shapes_std[:, kept].T}
    modes |= {"gain": None if unit.gain is None else unit.gain[kept]}
    return Entry(
        **more,
        modes=modes,
        findings=[str(finding) for finding in result.findings],
        settings=[dict(settings) for settings in result.settings],
        provenance={**about, "analysis": analysis_to(result.analysis)},
    )
