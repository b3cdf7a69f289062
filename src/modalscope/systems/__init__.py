"""Structures to simulate: with exact modes, exact sampling and records that can be repeated."""

from modalscope.numerics.arguments import plain_methods
from modalscope.systems.beam import clamped_beam
from modalscope.systems.chains import chain, chain5, heavy4, over4, spring_chain
from modalscope.systems.examples import close4, iasc_asce, ring5, three_masses, three_masses_record
from modalscope.systems.listing import build, catalog, names
from modalscope.systems.modal import modal_damping
from modalscope.systems.records import add_noise
from modalscope.systems.structure import Structure

__all__ = [
    "Structure",
    "add_noise",
    "build",
    "catalog",
    "chain",
    "chain5",
    "clamped_beam",
    "close4",
    "heavy4",
    "iasc_asce",
    "modal_damping",
    "names",
    "over4",
    "ring5",
    "spring_chain",
    "three_masses",
    "three_masses_record",
]

plain_methods(Structure)
