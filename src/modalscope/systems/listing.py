"""The structures that can be built by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from modalscope.model.checks import check_choice
from modalscope.model.entries import plainly
from modalscope.systems.beam import clamped_beam
from modalscope.systems.chains import chain5, heavy4, over4, spring_chain
from modalscope.systems.examples import close4, ring5, three_masses
from modalscope.systems.iasc import iasc_asce
from modalscope.systems.structure import Structure

__all__ = ["build", "catalog", "names"]

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
