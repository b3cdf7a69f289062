"""The same test told in other units, orders, signs and numbers gives the same modes, with the same grades and intervals.

Structures, kinds of data and what is done to them are drawn. Beyond what numbers can hold a refusal in words is an answer, too.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import modalscope as ms
from modalscope.data import DataError
from tests.io.apart import hidden
from tests.test_every_argument import within

#: How far frequencies and damping ratios may be off, and bounds of intervals, in deviations.
CLOSE, LOOSE = 1e-3, 0.2


def _values(data: Any) -> str:
    return "outputs" if isinstance(data, ms.Signals) else "values"


def units(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """All outputs in another unit, from 1e-12 to 1e12."""
    size = 10.0 ** draw.uniform(-12, 12)
    return replace(data, **{_values(data): size * getattr(data, _values(data))}), 1.0


def units_of_channels(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Each output and each input in a unit of its own, from 1e-12 to 1e12; outputs of records with forces six decades apart at most."""
    values, driven = getattr(data, _values(data)), isinstance(data, ms.Signals) and data.inputs is not None
    size = 10.0 ** draw.uniform(*((-3, 3) if driven else (-12, 12)), values.shape[1])
    told = {_values(data): values * size.reshape(1, -1, *[1] * (values.ndim - 2))}
    if isinstance(data, ms.FrequencyResponse):
        told["values"] = told["values"] * 10.0 ** draw.uniform(-12, 12, values.shape[2])
    elif driven:
        told["inputs"] = data.inputs * 10.0 ** draw.uniform(-12, 12, data.inputs.shape[1])
    return replace(data, **told), 1.0


def signs(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    values = getattr(data, _values(data))
    sign = draw.choice([-1.0, 1.0], values.shape[1])
    return replace(data, **{_values(data): values * sign.reshape(1, -1, *[1] * (values.ndim - 2))}), 1.0


def order(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    turned = draw.permutation(len(data.output_dofs))
    return data.select(outputs=[data.output_dofs[k] for k in turned]), 1.0


def time(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Another unit of time."""
    faster = 10.0 ** draw.uniform(-3, 3)
    if isinstance(data, ms.FrequencyResponse):
        return replace(data, frequencies=faster * data.frequencies), faster
    return replace(data, sampling_rate=faster * data.sampling_rate), faster


def byte_order(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    values = getattr(data, _values(data))
    return replace(data, **{_values(data): values.astype(values.dtype.newbyteorder(">"))}), 1.0


def precision(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    values = getattr(data, _values(data))
    return replace(data, **{_values(data): values.astype(np.complex64 if np.iscomplexobj(values) else np.float32)}), 1.0


def exchange(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Outputs for inputs, where both are of one structure that is symmetric."""
    if not isinstance(data, ms.FrequencyResponse):
        return order(data, draw)
    turned = {"values": data.values.transpose(0, 2, 1), "output_dofs": data.input_dofs, "input_dofs": data.output_dofs}
    return replace(data, **turned), 1.0


MOVES: tuple[Callable[[Any, np.random.Generator], tuple[Any, float]], ...] = (
    units,
    units_of_channels,
    signs,
    order,
    time,
    byte_order,
    precision,
    exchange,
)


def drawn(draw: np.random.Generator) -> Any:
    """Return data of a chain of five masses: lines, or a record with its forces or without."""
    chain, seed, kind = ms.systems.chain5(), int(draw.integers(2**31)), draw.random()
    if kind > 0.85:
        return chain.simulate(samples=3000, sampling_rate=20.0, noise=0.02, seed=seed)
    if kind < 0.7:
        return chain.frequency_response(np.linspace(0.2, 8, 160), quantity="acceleration", noise=0.01, seed=seed)
    return chain.simulate(inputs="ambient", samples=3000, sampling_rate=20.0, noise=0.02, seed=seed)


def differs(found: Any, other: Any, faster: float) -> str:
    """Return how two lists of modes differ, in words; an empty text: they do not."""
    if len(found) != len(other):
        return f"{len(found)} modes, {len(other)} then"
    f, z = other.frequencies / faster, other.damping_ratios
    away = max(np.abs(f / found.frequencies - 1).max(), np.abs(z / found.damping_ratios - 1).max() / 10, 0.0)
    if away > CLOSE:
        return f"frequencies or damping ratios are off by {away:.2g}"
    grades = [[mode.grade for mode in each] for each in (found, other)]
    if grades[0] != grades[1]:
        return f"grades {grades[0]}, {grades[1]} then"
    one, two = found.frequencies_std, other.frequencies_std
    if (one is None) != (two is None):
        return "deviations in one of them alone"
    if one is not None and two is not None and (np.abs(np.log(two / faster / one)) > LOOSE).any():
        return "deviations differ"
    return ""


def sets(count: int, seed: int) -> list[str]:
    """Analyze so many data sets that were told in other words; return those that gave other modes."""
    told, tally = list[str](), Counter[str]()
    warnings.simplefilter("ignore")
    kept: dict[int, tuple[Any, Any]] = {}
    for k in range(count):
        which = k // len(MOVES)
        if which not in kept:
            data = drawn(np.random.default_rng([seed, which]))
            kept = {which: (data, ms.analyze(data).modes)}
        data, found = kept[which]
        move = MOVES[k % len(MOVES)]
        try:
            with within(120):
                other, faster = move(data, np.random.default_rng([seed, which, k]))
                how = differs(found, ms.analyze(other).modes, faster)
        except DataError as error:
            how = "" if hidden(error) is None else f"hidden {hidden(error)!r}"
            tally["refused"] += not how
        except BaseException as error:  # noqa: BLE001 - what else there is, is the question
            how = f"{type(error).__name__}: {error}"
        if how:
            told.append(f"data set {k} of seed {seed}, {move.__name__} of {type(data).__name__}: {how}")
        tally["other" if how else "the same"] += 1
    print(f"{count} data sets told otherwise, seed {seed}: {dict(tally)}")
    return told
