"""The catalog: what can be built by name."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import systems
from modalscope.data import DataError
from tests.support import FIVE


def test_the_five_structures_have_the_modes_they_are_named_after() -> None:
    modes = {name: build().modes() for name, build in FIVE.items()}
    assert 0.0024 < modes["chain5"].damping_ratios.min() < modes["chain5"].damping_ratios.max() < 0.0161
    ring = modes["ring5"].frequencies
    np.testing.assert_allclose(ring[[1, 3]], ring[[2, 4]], rtol=1e-12)
    gaps = np.diff(modes["close4"].frequencies) / modes["close4"].frequencies[:-1]
    np.testing.assert_allclose(gaps[[0, 2]], [0.028, 0.0016], rtol=0.05)  # given as 2.8 % and .16 %
    np.testing.assert_allclose(modes["heavy4"].damping_ratios, [0.01, 0.35, 0.02, 0.015], rtol=1e-12)
    real = modes["over4"].poles[np.array(modes["over4"].kinds) == "real"].real
    np.testing.assert_allclose(np.sort(real), [-57, -8.4], rtol=0.01)  # given as 8.4 and 57 1/s


def test_five_structures_are_seen_by_four_outputs_and_two_inputs_every_0_05_s() -> None:
    for build in FIVE.values():
        structure = build()
        assert (len(structure.outputs), len(structure.inputs), structure.dt) == (4, 2, 0.05)


def test_geometry_knows_every_degree_of_freedom() -> None:
    for build in systems.catalog().values():
        structure = build()
        assert structure.geometry is not None
        translations = [dof for dof in structure.dofs if not dof.endswith("RY")]
        assert all(structure.geometry.motion_of(dof) for dof in translations)


def test_catalog_builds_by_name_and_names_the_nearest() -> None:
    assert {*FIVE, "spring_chain", "three_masses", "iasc_asce", "clamped_beam"} == set(systems.names())
    assert systems.build("over4").name == "over4"
    with pytest.raises(DataError, match="Did you mean 'ring5'"):
        systems.build("rng5")
