"""Models of records on the part that nobody fitted: `realize` beside each of its rows by itself, and nfoursid where it is installed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.realize import stabilized
from modalscope.analysis.workflow.simulation import driven_outputs, explained, free_run, validated
from modalscope.data import StateSpace
from modalscope.data.records import as_records
from tests.studies import Study
from tests.support import measured, random_system

#: Share of a record that is simulated and not fitted.
TESTED = 0.25


class System(NamedTuple):
    """A record to fit to, and one that is simulated; `follows`: the one that comes after the other, so that its first state is known."""

    fitted: ms.Signals
    tested: ms.Signals
    follows: bool = True


def split(record: ms.Signals, share: float = TESTED) -> System:
    end = int(record.samples * (1 - share))
    first, last = slice(end), slice(end, None)
    return System(*(replace(record, outputs=record.outputs[s], inputs=record.inputs[s]) for s in (first, last)))


def wing(run: int) -> System:
    z = np.load(measured("hati_gvt", "hati_ws3_200Hz.npz"))
    return split(ms.Signals(outputs=z["acc"][run], inputs=z["force"][run][:, None], sampling_rate=float(z["fs"])))


def hits() -> System:
    """Hits 2 to 4 are fitted and the fifth is simulated; the first is overloaded."""
    z = np.load(measured("impact_hits", "impacts.npz"))
    acc, force = z["acc"][1:, :, None], z["force"][1:, :, None]
    whole = ms.Signals(outputs=acc, inputs=force, sampling_rate=float(z["fs"]))
    first, last = slice(3), slice(3, None)
    return System(*(replace(whole, outputs=acc[s], inputs=force[s], groups=None) for s in (first, last)), follows=False)


def bridge() -> System:
    """The deck of Meloland from its footings, embankments and base; the last tenth is the end of the quake."""
    parts = [ms.read(measured("meloland", f"CHAN{k:02d}.V2")) for k in range(1, 27)]
    merged = ms.merge(parts)
    ground = [
        i for i, name in enumerate(merged.output_dofs) if any(w in str(name) for w in ("base", "footing", "embankment"))
    ]
    deck = [
        i for i in range(len(merged.output_dofs)) if i not in ground and "freefield" not in str(merged.output_dofs[i])
    ]
    y = merged.outputs
    return split(ms.Signals(outputs=y[:, deck], inputs=y[:, ground], sampling_rate=merged.sampling_rate), 0.5)


def hidden(seed: int) -> System:
    """A random structure whose unmeasured force is half as strong as the measured ones in the outputs, noise of 40 dB.

    What is simulated is what other inputs give alone: in the record itself four tenths are noise, where none can be told from the truth.
    """
    rng = np.random.default_rng(seed)
    model = random_system(rng, outputs=3, inputs=2, modes=4, damping=(0.005, 0.05), sampled=False).to_discrete(1.0)
    u, w = rng.standard_normal((3000, 2)), rng.standard_normal((3000, 1))
    y = model.simulate(u)
    other = StateSpace(A=model.A, B=rng.standard_normal((model.order, 1)), C=model.C, dt=1.0).simulate(w)
    y = y + 0.5 * other * y.std(axis=0) / other.std(axis=0)
    noisy = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    fresh = rng.standard_normal((4000, 2))
    parts = (noisy, u), (model.simulate(fresh), fresh)
    return System(*(ms.Signals(outputs=y, inputs=u, sampling_rate=1.0) for y, u in parts), follows=False)


SYSTEMS: dict[str, Callable[[], System]] = {
    "a wing, run 1": lambda: wing(0),
    "a wing, run 6": lambda: wing(5),
    "four hits": hits,
    "Meloland": bridge,
    **{f"random, hidden forces, seed {k}": lambda k=k: hidden(k) for k in range(4)},
}


def of_rows(system: System, order: int) -> Iterator[tuple[str, StateSpace | None]]:
    """Yield the models of rows by themselves, at the order that they choose and at that of `realize`."""
    ways: dict[str, dict[str, Any]] = {
        "n4sid": {"method": "n4sid"},
        "records on lines": {"route": "records", "domain": "z"},
        "OKID and ERA": {"route": "markov", "method": "era"},
    }
    for name, way in ways.items():
        for what, n in (("", None), (", same order", order)):
            try:
                yield name + what, ms.identify(system.fitted, order=n, deviations=False, **way).state_space
            except ms.DataError:
                yield name + what, None
    if find_spec("nfoursid") and system.fitted.outputs.ndim == 2:
        yield "nfoursid, same order", by_nfoursid(system.fitted, order)


def by_nfoursid(record: ms.Signals, order: int) -> StateSpace | None:
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    ys, us = (
        [f"{name}{k}" for k in range(part.shape[1])] for name, part in (("y", record.outputs), ("u", record.inputs))
    )
    table = pd.DataFrame(np.hstack([record.outputs, record.inputs]), columns=[*ys, *us])
    try:
        found = NFourSID(table, output_columns=ys, input_columns=us, num_block_rows=max(20, 2 * order // len(ys)))
        found.subspace_identification()
        model, _ = found.system_identification(rank=order)
    except (ValueError, np.linalg.LinAlgError, MemoryError):
        return None
    return StateSpace(A=model.a, B=model.b, C=model.c, D=model.d, dt=1 / record.sampling_rate)


def score(model: StateSpace | None, system: System) -> float:
    """Return the variance explained of what was not fitted, mean over the outputs, in per cent; -inf of what grows beyond numbers.

    Of a record in one piece the first state is that which fits the part before best: nothing is fitted to what is tested.
    """
    if model is None:
        return -np.inf
    plain = replace(model, gain=None, innovation_covariance=None)
    with np.errstate(all="ignore"):
        if not system.follows:
            return float(np.mean(validated(plain, as_records(system.tested))[0]))
        y, u = (np.concatenate([getattr(part, side) for part in system[:2]]) for side in ("outputs", "inputs"))
        end = system.fitted.samples
        first = free_run(plain, y[:end], u[:end]).first[:, None]
        start = replace(plain, B=plain.A @ first, D=plain.C @ first, input_dofs=(), input_units=())
        simulated = driven_outputs(plain, u) + driven_outputs(start, np.eye(len(y), 1))
        return float(np.mean(explained(y[end:], simulated[end:])))


def test_the_parts_of_a_system_do_not_meet() -> None:
    system = hidden(0)
    assert (system.fitted.samples, system.tested.samples) == (3000, 4000)
    found = ms.identify(system.fitted, method="n4sid", order=8, deviations=False)
    assert 90 < score(stabilized(found.state_space, found.response)[0], system) < 99.9


@pytest.mark.study("inputs")
@pytest.mark.parametrize("name", SYSTEMS)
def test_realize_explains_what_every_row_does(name: str, study: Callable[[str, str], Study]) -> None:
    system = SYSTEMS[name]()
    model = ms.realize(system.fitted)
    scores = {what: score(other, system) for what, other in of_rows(system, model.order)}
    ours = score(model, system)
    table = study(f"models of records, {name}", "variance explained of what was not fitted, %")
    table.row("realize", ours, least=max(scores.values()) - 0.5)
    table.row("largest |z| of realize", float(np.abs(model.poles).max()), most=1.0, form=".4f")
    for what, value in scores.items():
        table.row(what, f"{value:.1f}" if np.isfinite(value) and value > -999 else "none, or it grows")
    assert np.abs(model.poles).max() < 1
    if "wing" in name:
        assert model.validation.free_run.mean() > 90
