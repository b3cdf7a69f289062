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

#: Reasons of a mode that are to be the same, within the part above.
_REASONS = {"signal_to_noise", "share_of_peak", "indicator_prominence", "fit_loss", "explained_nearby", "gain"}


def _scaled(data: Any, outputs: Any, inputs: Any = 1.0) -> Any:
    """Return data whose outputs and inputs are multiplied by numbers, one each or one for all."""
    if not isinstance(data, ms.Signals):
        width = np.ones(data.values.shape[1:])
        return replace(data, values=data.values * (outputs * width.T).T * (inputs * width))
    driven = {} if data.inputs is None else {"inputs": data.inputs * inputs}
    return replace(data, outputs=data.outputs * outputs, **driven)


def _cast(data: Any, kind: Callable[[Any], Any]) -> Any:
    """Return data whose numbers are of another kind."""
    names = [name for name in ("outputs", "inputs", "values") if getattr(data, name, None) is not None]
    return replace(data, **{name: getattr(data, name).astype(kind(getattr(data, name))) for name in names})


def _channels(data: Any) -> tuple[int, int]:
    return len(data.output_dofs), len(data.input_dofs)


def units(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """All outputs in another unit, and all inputs, from 1e-12 to 1e12."""
    return _scaled(data, *10.0 ** draw.uniform(-12, 12, 2)), 1.0


def units_of_channels(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Each output and each input in a unit of its own, from 1e-12 to 1e12."""
    return _scaled(data, *(10.0 ** draw.uniform(-12, 12, count) for count in _channels(data))), 1.0


def beyond(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Outputs in units of which squares are no numbers."""
    return _scaled(data, 10.0 ** (draw.choice([-1, 1]) * draw.uniform(150, 320))), 1.0


def signs(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    return _scaled(data, *(draw.choice([-1.0, 1.0], count) for count in _channels(data))), 1.0


def order(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Channels in another order."""
    outputs, inputs = ([dofs[k] for k in draw.permutation(len(dofs))] for dofs in (data.output_dofs, data.input_dofs))
    return data.select(outputs=outputs, **({"inputs": inputs} if inputs else {})), 1.0


def time(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Another unit of time."""
    faster = 10.0 ** draw.uniform(-3, 3)
    if isinstance(data, ms.FrequencyResponse):
        return replace(data, frequencies=faster * data.frequencies), faster
    return replace(data, sampling_rate=faster * data.sampling_rate), faster


def byte_order(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    return _cast(data, lambda values: values.dtype.newbyteorder(">")), 1.0


def precision(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    return _cast(data, lambda values: np.complex64 if np.iscomplexobj(values) else np.float32), 1.0


def exchange(data: Any, draw: np.random.Generator) -> tuple[Any, float]:
    """Outputs for inputs: a structure answers from either side; of records, first channels for last ones."""
    if isinstance(data, ms.Signals):
        return data.select(outputs=data.output_dofs[::-1]), 1.0
    turned = {"output_dofs": data.input_dofs, "input_dofs": data.output_dofs, "quantity": data.quantity}
    axis = {name: getattr(data, name) for name in ("frequencies", "sampling_rate") if hasattr(data, name)}
    return type(data)(values=data.values.transpose(0, 2, 1), **turned, **axis), 1.0


MOVES: tuple[Callable[[Any, np.random.Generator], tuple[Any, float]], ...] = (
    units,
    units_of_channels,
    beyond,
    signs,
    order,
    time,
    byte_order,
    precision,
    exchange,
)


def drawn(draw: np.random.Generator) -> Any:
    """Return data of a chain of three to five masses: lines, samples, a record with its forces or without, or a decay."""
    mass, springs = draw.uniform(1, 3, count := int(draw.integers(3, 6))), draw.uniform(500, 2000, count + 1)
    K = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    at = draw.permutation(count)
    chain = ms.systems.Structure(
        mass=np.diag(mass),
        stiffness=K,
        damping=ms.systems.modal_damping(np.diag(mass), K, draw.uniform(0.005, 0.02, count)),
        outputs=tuple(int(k) for k in at[: draw.integers(2, count + 1)]),
        inputs=tuple(int(k) for k in at[: draw.integers(1, 3)]),
    )
    top, seed, kind = float(np.abs(chain.modes().poles).max()) / (2 * np.pi), int(draw.integers(2**31)), draw.random()
    rate = 3 * top
    if kind < 0.4:
        lines = np.linspace(0.2, 1.3 * top, 100)
        return chain.frequency_response(lines, quantity="acceleration", noise=0.01, seed=seed)
    if kind < 0.55:
        return chain.impulse_response(300, sampling_rate=rate, noise=0.01, seed=seed)
    if kind < 0.8:
        return chain.simulate(samples=800, sampling_rate=rate, noise=0.02, quantity="acceleration", seed=seed)
    if kind < 0.9:
        return chain.simulate(inputs="ambient", samples=2000, sampling_rate=rate, noise=0.02, seed=seed)
    decay = chain.free_decay(500, velocity=draw.standard_normal(count), sampling_rate=rate).values[:, :, 0]
    decay = decay + 0.01 * decay.std(axis=0) * draw.standard_normal(decay.shape)
    return ms.Signals(outputs=decay, sampling_rate=rate)


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
    kinds = [{note.kind for note in each.notes} for each in (found, other)]
    if kinds[0] != kinds[1]:
        return f"notes {kinds[0] ^ kinds[1]} of one of them alone"
    reasons = [list[dict[str, Any]](each.reasons) for each in (found, other)]
    for i, (before, then) in enumerate(zip(*reasons, strict=True)):
        for name in before.keys() & then.keys() & _REASONS:
            if not np.isclose(before[name], then[name], rtol=LOOSE, atol=1e-6):
                return f"{name} of mode {i} is {before[name]:.3g}, {then[name]:.3g} then"
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
            how = f"refused: {error}" if move is not beyond or hidden(error) is not None else ""
            tally["refused"] += not how
        except BaseException as error:  # noqa: BLE001 - what else there is, is the question
            how = f"{type(error).__name__}: {error}"
        if how:
            told.append(f"data set {k} of seed {seed}, {move.__name__} of {type(data).__name__}: {how}")
        tally["other" if how else "the same"] += 1
    print(f"{count} data sets told otherwise, seed {seed}: {dict(tally)}")
    return told
