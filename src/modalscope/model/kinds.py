"""Things of the wrong type: what was expected, what was given, and how to make the one of the other."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any

from modalscope.model.errors import DataError

__all__ = ["check_kind"]

#: How arrays become data.
_WRAPPED = {
    "FrequencyResponse": "FrequencyResponse(values=..., frequencies=...)",
    "ImpulseResponse": "ImpulseResponse(values=..., sampling_rate=...)",
    "Signals": "Signals(outputs=..., sampling_rate=...)",
    "ModalModel": "ModalModel(poles=..., shapes=...)",
    "Geometry": "Geometry(nodes=..., coordinates=...)",
    "StateSpace": "StateSpace(A=..., B=..., C=...)",
}

#: What reading a file gives.
_READ = ("FrequencyResponse", "ImpulseResponse", "Signals", "Records", "Setups", "ModalModel", "Geometry")

_MEASURED = ("FrequencyResponse", "ImpulseResponse", "Signals", "Records", "Setups")

#: (expected, given) -> how the one is made of the other.
_MADE: dict[tuple[str, str], str] = {
    ("FrequencyResponse", "Signals"): "estimate it first: ms.estimate_frf(record)",
    ("FrequencyResponse", "Records"): "estimate it from one of its runs: ms.estimate_frf(records.runs[0])",
    ("FrequencyResponse", "ImpulseResponse"): "transform it: response.to_frequency_response()",
    ("FrequencyResponse", "StateSpace"): "compute it: model.frequency_response(frequencies)",
    ("FrequencyResponse", "ModalModel"): "compute it: modes.frequency_response(frequencies)",
    ("FrequencyResponse", "Structure"): "compute it: structure.frequency_response(frequencies)",
    ("ImpulseResponse", "Signals"): "estimate it first: ms.estimate_correlation(record) or ms.estimate_markov(record)",
    ("ImpulseResponse", "FrequencyResponse"): "transform it: response.to_impulse_response()",
    ("ImpulseResponse", "StateSpace"): "compute it: model.impulse_response(samples)",
    ("ImpulseResponse", "ModalModel"): "compute it: modes.impulse_response(samples)",
    ("ImpulseResponse", "Structure"): "compute it: structure.impulse_response(samples)",
    ("Signals", "Records"): "give one of its runs: records.runs[0]",
    ("Signals", "Setups"): "give one of its setups: setups.parts[0]",
    ("Signals", "Structure"): "simulate it: structure.simulate(duration=...)",
    ("ModalModel", "StabilizationDiagram"): "select them first: ms.select(diagram)",
    ("ModalModel", "Identification"): "give its modes: result.modes",
    ("ModalModel", "Structure"): "compute them: structure.modes()",
    ("ModalModel", "Mode"): "give all of them: mode.modes",
    ("StabilizationDiagram", "ModalModel"): "give the diagram that they were selected from",
    ("StabilizationDiagram", "Identification"): "that is one order; ms.stabilize(data) tries all",
    ("StateSpace", "Identification"): "give its model: result.state_space",
    ("StateSpace", "Structure"): "compute it: structure.state_space()",
    ("Result", "Comparison"): "ask for it there: ms.compare(data, replicates=40)",
    **{
        ("Result", kind): "analyse the data: ms.analyze(data)"
        for kind in (*_MEASURED, "ModalModel", "StabilizationDiagram")
    },
    **{("ModalModel", kind): "identify them first: ms.select(ms.stabilize(data))" for kind in _MEASURED},
    **{("StabilizationDiagram", kind): "make it first: ms.stabilize(data)" for kind in _MEASURED},
    **{("StateSpace", kind): "identify it first: ms.realize(data, order=...)" for kind in _MEASURED},
}

#: Python's own types in plain words.
_WORDS = {"str": "text", "bool": "True or False", "Mapping": "a mapping of name to value", "NoneType": "None"}


def check_kind(name: str, value: Any, kinds: type[Any] | tuple[type[Any], ...]) -> None:
    """Raise when a value is not of the type that is expected, and say how to make it so.

    Parameters
    ----------
    name : str
        The verb or the option that expects it.
    value : object
    kinds : type or tuple of types

    Examples
    --------
    >>> import numpy as np
    >>> from modalscope.model import FrequencyResponse
    >>> check_kind("mmif", np.ones(3) * 1j, FrequencyResponse)
    Traceback (most recent call last):
    modalscope.model.errors.DataError: mmif: expected FrequencyResponse, got ndarray: wrap it as FrequencyResponse(values=...,
    frequencies=...)
    """
    if isinstance(value, kinds):
        return
    known = kinds if isinstance(kinds, tuple) else (kinds,)
    words = [_WORDS.get(kind.__name__, kind.__name__) for kind in known]
    expected = _one_of(words)
    given = type(value).__name__
    fallback = "give one of these" if len(known) > 1 else f"give {expected}"
    hint = _hint(value, given, [kind.__name__ for kind in known], known) or fallback
    asked, found = f"{name}: expected {expected}", f"got {_WORDS.get(given, given)}"
    raise DataError(asked, found, f"{hint[0].upper()}{hint[1:]}.", f"{asked}, {found}: {hint}")


def _hint(value: Any, given: str, expected: Sequence[str], kinds: tuple[type[Any], ...]) -> str | None:
    """Return how to make what is expected of what was given; None where nothing is known to help."""
    if isinstance(value, str | PathLike):
        return "read it first: ms.read(path)" if set(expected) & set(_READ) else None
    if isinstance(value, tuple | list) and value:
        fitting = [k for k, item in enumerate(value) if isinstance(item, kinds)]
        if len(fitting) == len(value) > 1:
            several = "put them together first, ms.merge([...]), or " if expected[0] in _MEASURED else ""
            return f"{several}give them one by one"
        if fitting:
            return f"give only its item {fitting[0]}, counted from 0"
        if all(hasattr(item, "__dataclass_fields__") for item in value):
            return None
    if given in ("ndarray", "list", "tuple", "memmap", "Tensor"):
        return _wrapped(value, expected)
    if given in ("DataFrame", "Series"):
        wrapped = _wrapped(None, expected)
        return None if wrapped is None else f"take its numbers, table.to_numpy(), and {wrapped}"
    return next((_MADE[kind, given] for kind in expected if (kind, given) in _MADE), None)


def _wrapped(array: Any, expected: Sequence[str]) -> str | None:
    """Return how numbers become one of what is expected; complex ones are no samples, and real ones no response over frequency."""
    fitting = [_WRAPPED[kind] for kind in expected if kind in _WRAPPED]
    kind = getattr(getattr(array, "dtype", None), "kind", None)
    if len(fitting) > 1 and kind in ("c", "f"):
        fitting = [form for form in fitting if form.startswith("Frequency") is (kind == "c")] or fitting
    return f"wrap it as {_one_of(fitting)}" if fitting else None


def _one_of(words: Sequence[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
