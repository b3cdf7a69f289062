"""Define the actions of the page: each is a function from the document of an analysis to the next."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from modalscope.data import DataError
from modalscope.data.analysis import Analysis, SourceFile, named_near
from modalscope.io.analysis import analysis_to
from modalscope.io.options import TEXT
from modalscope.numerics.checks import check_number, check_positive

#: The fields that `set` changes.
_SETTABLE = ("bands", "exclude", "route", "reciprocal", "method", "domain", "orders", "options", "refine", "remarks")

#: Options of reading that remedies of errors name.
_REMEDIES = (*TEXT, "sheet", "units", "quantity", "sampling_rate")

#: Maximum relative difference of two frequencies that denote the same mode.
_SAME_FREQUENCY = 1e-6

#: The fields of a document that its diagrams depend on.
_DIAGRAM_FIELDS = ("files", "bands", "exclude", "route", "reciprocal", "method", "domain", "orders", "options")


def diagrams_key(document: Analysis) -> str:
    """Return the fields of a document that its diagrams depend on, as text."""
    fields = analysis_to(document)
    return json.dumps([fields[name] for name in _DIAGRAM_FIELDS], sort_keys=True)


def acted(document: Analysis, action: str, given: Mapping[str, Any]) -> Analysis:
    """Return the document after an action.

    `action`: one of `ACTIONS`. `given`: its arguments.

    Raises `DataError`: an unknown action, or invalid arguments.

    Examples
    --------
    >>> acted(Analysis(), "take", {"frequency": 12.5}).taken
    (12.5,)
    """
    if action not in ACTIONS:
        raise DataError(f"{action!r}:", f"the actions are {', '.join(ACTIONS)}", "Choose one of these.")
    try:
        return ACTIONS[action](document, **given)
    except DataError:
        raise
    except (TypeError, ValueError, AttributeError, LookupError, ArithmeticError) as error:
        raise DataError(f"{action}:", f"its arguments are invalid ({error})", "Correct them.") from None


def change(document: Analysis, **new: Any) -> Analysis:
    """Set fields; choices by hand outside of new bands are dropped."""
    _check_names("setting {}", new, _SETTABLE)
    new |= {name: new[name] or None for name in ("method", "domain") if name in new}
    new |= {"bands": tuple(map(tuple, new["bands"]))} if "bands" in new else {}
    changed = replace(document, **new)
    if changed.bands == document.bands or not changed.bands:
        return changed

    def inside(listed: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(f for f in listed if any(low <= f <= high for low, high in changed.bands))

    return replace(changed, taken=inside(changed.taken), refused=inside(changed.refused))


def _check_names(what: str, given: Mapping[str, Any], known: tuple[str, ...]) -> None:
    """Raise for names that the page does not set; `what`: what was asked, with a place for them."""
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise DataError(f"{what.format(', '.join(unknown))}:", f"the page sets {', '.join(known)}", "Use one of these.")


def take(document: Analysis, frequency: float) -> Analysis:
    """Add a mode to the automatic ones, or withdraw its refusal."""
    f = check_positive("frequency", frequency)
    if _near(f, document.refused):
        return replace(document, refused=_without(f, document.refused))
    return replace(document, frequencies=None, taken=(*_without(f, document.taken), f))


def refuse(document: Analysis, frequency: float) -> Analysis:
    """Remove an automatic mode, or withdraw its addition."""
    f = check_positive("frequency", frequency)
    if _near(f, document.taken):
        return replace(document, taken=_without(f, document.taken))
    return replace(document, frequencies=None, refused=(*_without(f, document.refused), f))


def automatic(document: Analysis) -> Analysis:
    """Return to the automatic selection."""
    return replace(document, taken=(), refused=(), frequencies=None)


def name(document: Analysis, frequency: float, name: str) -> Analysis:
    """Name a mode; an empty name removes it."""
    f = check_number("frequency", frequency)
    others = {key: text for key, text in document.names.items() if not named_near({key: "x"}, f)}
    return replace(document, names={**others, f"{f:.6g}": str(name)} if name else others)


def geometry(document: Analysis, files: tuple[str, ...]) -> Analysis:
    """Read the data with a geometry: a file of points, and optionally one of lines."""
    return _read_with(document, geometry=(tuple(files) if len(files) > 1 else files[0]) if files else None)


def exact_nodes(document: Analysis, exact: bool) -> Analysis:
    """Place channels only at nodes that they name, or by their number, too."""
    return _read_with(document, exact_nodes=True if exact else None)


def reading(
    document: Analysis, columns: str | None = None, rows: str | None = None, sampling_rate: float | None = None
) -> Analysis:
    """Read a table with roles of its columns, such as "time=1,in=2,out=3-7", some of its rows, and a sampling rate; None: automatic."""
    rate = None if sampling_rate is None else check_positive("sampling_rate", sampling_rate)
    texts = {name: None if text is None else str(text) for name, text in (("columns", columns), ("rows", rows))}
    return _read_with(document, **texts, sampling_rate=rate)


def remedy(document: Analysis, options: Mapping[str, str | float | bool | list[str]]) -> Analysis:
    """Read the data as an error says: columns left out besides those that were, lines skipped, rows and columns exchanged, ..."""
    _check_names("reading again with {}", options, _REMEDIES)
    left = options.get("ignore", [])
    earlier = document.files[0].reading.get("ignore", ()) if document.files else ()
    more = {"ignore": [*earlier, *map(str, left)]} if isinstance(left, list) and left else {}
    return _read_with(document, **{**options, **more})


def _read_with(document: Analysis, **options: Any) -> Analysis:
    given = {key: value for key, value in options.items() if value is not None}

    def read_with(file: SourceFile) -> SourceFile:
        return replace(file, reading={key: value for key, value in file.reading.items() if key not in options} | given)

    return replace(document, files=tuple(map(read_with, document.files)))


def _near(frequency: float, listed: tuple[float, ...]) -> bool:
    return len(_without(frequency, listed)) < len(listed)


def _without(frequency: float, listed: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(f for f in listed if abs(f - frequency) > _SAME_FREQUENCY * frequency)


#: The actions by name.
_NAMED = (take, refuse, automatic, name, geometry, exact_nodes, reading, remedy)
ACTIONS: dict[str, Callable[..., Analysis]] = {"set": change} | {action.__name__: action for action in _NAMED}
