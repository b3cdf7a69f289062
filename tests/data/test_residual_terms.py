"""Residual terms: the same values by their own formula and by the columns that they were fitted with, and back from a file."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.residual_terms import ResidualTerms
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.joint_fit import with_terms
from tests.selection.likelihood.test_joint_fit import BESIDES, KINDS, made
from tests.support import refused, relative


def terms_of(kind: str) -> ResidualTerms:
    modes, response, powers = made(kind)
    (terms,) = with_terms(response, modes, BESIDES, powers).residual_terms
    return terms


def test_on_lines_they_are_sums_of_partial_fractions_and_powers() -> None:
    terms = terms_of("lines")
    f = np.array([1.5, 2.0, 4.25])
    x = 2j * np.pi * f[:, None, None, None]
    poles = terms.poles[:, None, None]
    by_hand = np.sum(terms.residues / (x - poles) + terms.residues.conj() / (x - poles.conj()), axis=1)
    for p, T in zip(terms.powers, terms.terms, strict=True):
        by_hand = by_hand + T * (1j * f[:, None, None] / terms.top) ** p
    assert relative(terms.on_lines(f), by_hand) < 1e-12


def test_outside_their_band_and_at_another_rate_they_are_nothing() -> None:
    terms, samples = terms_of("lines"), terms_of("samples")
    low, high = terms.band
    edge = terms.on_lines(np.array([np.nextafter(low, 0), low, high, np.nextafter(high, 9)]))
    assert np.all(edge[[0, 3]] == 0)
    assert np.all(np.abs(edge[1:3]).max(axis=(1, 2)) > 0)
    assert np.all(samples.on_samples(30, 20.5, 0) == 0)
    assert np.abs(samples.on_samples(30, 20.0, 0)).max() > 0


def test_of_records_the_forces_drive_the_same_responses() -> None:
    """What inputs give in records is the frequency response on lines times their spectra; the rest are ends of runs."""
    modes, spectra, powers = made("records")
    (terms,) = with_terms(spectra, modes, BESIDES, powers).residual_terms
    alone = replace(terms, residues=terms.residues.copy(), ends=0 * terms.ends)
    alone.residues.setflags(write=True)
    silent = np.concatenate([alone.residues[:, :, :2], 0 * alone.residues[:, :, 2:]], axis=2)
    without = spectra._of_terms(replace(alone, residues=silent))[:, :, 0]
    forced = np.einsum("flm,fm->fl", terms.on_lines(spectra.frequencies), spectra.drive)
    assert relative(without, forced) < 1e-10


def test_records_of_other_runs_have_other_ends() -> None:
    terms = terms_of("records")
    assert terms.ends.shape[2] == 2
    more = terms.packed(2 + 5, terms.top)
    assert len(more) == 6 * 2 + 5 * 5 + 7 * 2 * 3
    assert not np.any(more[12:37])


def test_a_choice_of_channels_is_that_of_the_values() -> None:
    terms = terms_of("lines")
    f = np.linspace(1, 4, 9)
    some = terms.select([2, 0], [1])
    assert some.channels == (2, 1)
    assert np.allclose(some.on_lines(f), terms.on_lines(f)[:, [2, 0]][:, :, [1]])
    modes, response, powers = made("lines")
    chosen = with_terms(response, modes, BESIDES, powers).select(outputs=[2, 0], inputs=[1])
    assert np.allclose(chosen.residual_terms[0].on_lines(f), some.on_lines(f))


@pytest.mark.parametrize("kind", KINDS)
def test_they_come_back_from_json(kind: str) -> None:
    terms = terms_of(kind)
    again = ResidualTerms.from_dict(json.loads(json.dumps(terms.to_dict())))
    for field in fields(terms):
        assert np.array_equal(getattr(again, field.name), getattr(terms, field.name)), field.name


@pytest.mark.parametrize("suffix", [".json", ".npz", ".h5", ".mat"])
def test_modes_are_read_back_with_them(suffix: str, tmp_path: Path) -> None:
    modes, response, powers = made("lines")
    found = with_terms(response, modes, BESIDES, powers)
    path = tmp_path / f"modes{suffix}"
    ms.write(path, found)
    again = ms.read(path)
    f = np.linspace(1, 4.5, 30)
    assert np.allclose(again.residual_terms[0].on_lines(f), found.residual_terms[0].on_lines(f), rtol=1e-12)


def test_damage_is_said() -> None:
    entry = terms_of("lines").to_dict()
    refused("residual terms.*damaged", ResidualTerms.from_dict, {**entry, "channels": [3]})
    refused("terms needs shape", ResidualTerms.from_dict, {**entry, "powers": [0]})
    modes = made("lines")[0].select(outputs=[0, 1])
    refused("they have 3 outputs and 2 inputs", replace, modes, residual_terms=(terms_of("lines"),))


def test_terms_without_poles_or_powers_are_nothing() -> None:
    modes, response, _ = made("samples")
    (terms,) = with_terms(response, modes, np.zeros(0, complex), ()).residual_terms
    assert terms.unknowns == 0
    assert not np.any(terms.on_samples(10, 20.0, 0))
    assert not np.any(terms.on_lines(np.array([1.0])))


def test_poles_outside_the_band_are_told_from_those_inside() -> None:
    terms = terms_of("lines")
    assert np.allclose(np.sort(np.abs(terms.outside()) / (2 * np.pi)), [0.5, 6.0])
    moved = terms.shifted(0.25)
    assert np.allclose(moved.poles - terms.poles, 0.25)
    assert np.allclose(terms.poles[:1], poles_from([3.3], [0.02]))
