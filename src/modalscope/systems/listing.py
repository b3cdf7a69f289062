"""Build a simulated test by the name of its structure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse, Signals
from modalscope.numerics.arguments import at_least, named, plainly
from modalscope.numerics.checks import check_number
from modalscope.numerics.errors import check_choice
from modalscope.systems.beam import clamped_beam
from modalscope.systems.chains import chain5, heavy4, over4, spring_chain
from modalscope.systems.examples import close4, iasc_asce, ring5, three_masses
from modalscope.systems.records import Seed
from modalscope.systems.structure import Structure

_SYSTEMS: tuple[Callable[[], Structure], ...] = (
    chain5,
    ring5,
    close4,
    heavy4,
    over4,
    spring_chain,
    three_masses,
    iasc_asce,
    clamped_beam,
)


def catalog() -> Mapping[str, Callable[[], Structure]]:
    """Return the structures by name; each is built by calling it, and the first line of its docstring describes it."""
    return MappingProxyType({system.__name__: system for system in _SYSTEMS})


def names() -> tuple[str, ...]:
    """Return the names of the structures in the catalog."""
    return tuple(catalog())


@plainly
def build(name: str) -> Structure:
    """Return a structure by its name in the catalog.

    Parameters
    ----------
    name : str
        One of `names()`.

    Raises
    ------
    DataError
        An unknown name, with the nearest known one.

    Examples
    --------
    >>> build("ring5").degrees
    5
    """
    return catalog()[check_choice("system", name, catalog())]()


# A simulated test of a structure with nothing set: the band and the rate are those that hold all its modes.

#: What is measured, and how many lines or samples of it when nothing is said.
KINDS = {"frf": 1000, "impulse": 2000, "records": 20_000, "ambient": 20_000}


@named(kind=tuple(KINDS), samples=at_least(2))
def trial(
    structure: Structure,
    kind: str = "frf",
    *,
    samples: int | None = None,
    quantity: str = "acceleration",
    snr_db: float | None = None,
    seed: Seed = 0,
) -> FrequencyResponse | ImpulseResponse | Signals:
    """Return a simulated test of a structure whose lines, or whose rate, hold all its modes.

    Lines run from a quarter of the lowest frequency to 1.25 of the highest; the rate is that of the structure, 2.56 times
    the highest frequency at least.

    `structure`: what is tested. `kind`: frequency responses, impulse responses, records under white forces with the forces, or without
    them. `samples`: lines or samples; 1000, 2000 and 20000 by default. `quantity`: what is measured. `snr_db`: signal over noise of each
    channel, 20 log10 of the ratio of their root mean squares; no noise by default. `seed`: makes noise and forces repeatable.

    Raises `DataError`: an unknown kind or quantity, fewer than two samples, a seed that is none.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> test = trial(chain5(), "impulse", samples=100)
    >>> test.values.shape
    (100, 4, 2)
    """
    count = KINDS[kind] if samples is None else samples
    noise = None if snr_db is None else float(10 ** (-check_number("noise", snr_db) / 20))
    f = structure.modes().frequencies
    if kind == "frf":
        lines = np.linspace(f.min() / 4, 1.25 * f.max(), count)
        return structure.frequency_response(lines, quantity=quantity, noise=noise, seed=seed)
    rate = max(1 / structure.dt if structure.dt else 0.0, 2.56 * f.max())
    if kind == "impulse":
        return structure.impulse_response(count, sampling_rate=rate, quantity=quantity, noise=noise, seed=seed)
    return structure.simulate(
        inputs="ambient" if kind == "ambient" else "white",
        samples=count,
        sampling_rate=rate,
        quantity=quantity,
        noise=noise or 0.0,
        seed=seed,
    )
