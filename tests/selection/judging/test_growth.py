"""Orders that grow while modes are missing, and what is said of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.orders import grown
from tests.selection.judging.made import Pole, diagram_of, response_of
from tests.support import add_noise

MODE = Pole(2, 8, 0.02, shape=(1, 2), part=(0.5, 1, -2))


def diagram(orders: Iterable[int], modes: int, kind: str = "dirac") -> StabilizationDiagram:
    """Return a diagram of data that so many modes explain: the fit error falls evenly down to two states a mode."""
    listed = tuple(orders)
    response = response_of([MODE.pole], [MODE.shape], [MODE.part], kind=kind)
    errors = np.maximum(1 - np.array(listed) / (2 * modes), 0.01)
    return diagram_of(MODE, response=response, orders=listed, fit_errors=errors)


def ends(modes: int, **how: Any) -> tuple[int, list[str]]:
    found = grown(diagram(range(2, 62, 2), modes, **how), lambda orders: diagram(orders, modes, **how))
    return found.orders[-1], [note.kind for note in found.notes]


def test_orders_stay_where_they_hold_all_modes_and_grow_twice_at_most_where_they_do_not() -> None:
    assert ends(20) == (60, [])
    assert ends(45) == (120, ["orders grew"])
    assert ends(90) == (240, ["orders grew"])


def test_of_correlations_orders_stay() -> None:
    assert ends(45, kind="correlation") == (60, [])


def test_orders_do_not_grow_beyond_what_lines_can_tell_and_that_is_said() -> None:
    short = replace(
        diagram(range(2, 62, 2), 45), response=SimpleNamespace(ambient=False, separable=True, max_states=100)
    )
    found = grown(short, lambda orders: pytest.fail("asked again"))
    assert [note.kind for note in found.notes] == ["orders end"]


@pytest.mark.slow
def test_fifty_modes_in_one_band_are_found_with_nothing_set() -> None:
    rng = np.random.default_rng(0)
    f = 10 + 2 * np.arange(50) + rng.uniform(-0.5, 0.5, 50)
    shapes = rng.standard_normal((12, 50))
    modes = ms.ModalModel(poles=2 * np.pi * f * (-0.008 + 1j), shapes=shapes, participation=shapes[:2].T)
    data = add_noise(modes.frequency_response(np.linspace(5, 115, 1200)), 40, np.random.default_rng(0))
    diagram = ms.stabilize(data)
    assert diagram.orders[-1] > 100
    found = ms.select(diagram)
    assert len(found) == 50
    assert np.allclose(found.frequencies, np.sort(np.abs(modes.poles)) / (2 * np.pi), rtol=1e-3)
