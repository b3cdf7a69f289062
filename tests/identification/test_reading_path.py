"""The reading path runs by itself and gives what faster and further steps give."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope import DataError, FrequencyResponse, ImpulseResponse, StabilizationDiagram
from modalscope.identification import FASTER, FURTHER
from modalscope.identification.fast.block_hankel import BlockHankel
from modalscope.identification.fast.structured_hankel import StructuredHankel
from modalscope.identification.matrices.factor import left_factor
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.hankel import Hankel
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import prepare
from modalscope.identification.stabilize import stabilized
from modalscope.numerics.handed import handed, plain_steps
from modalscope.systems import chain5
from tools.house import modules, reading_path

ORDERS = list(range(4, 41, 6))


def noisy() -> ImpulseResponse:
    clean = chain5().state_space(dt=0.05).impulse_response(160)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(clean.values.shape)
    return ImpulseResponse(values=clean.values + noise, sampling_rate=clean.sampling_rate)


def lines() -> FrequencyResponse:
    return chain5().frequency_response(np.linspace(0.3, 7.5, 200), noise=0.01, seed=0)


def correlations() -> ImpulseResponse:
    record = chain5().simulate(duration=300, sampling_rate=8)
    return ms.estimate_correlation(ms.Signals(outputs=record.outputs, sampling_rate=8.0))


def both(data: Any, orders: list[int] = ORDERS, **asked: Any) -> tuple[StabilizationDiagram, StabilizationDiagram]:
    """Return the diagram by the plain steps, and by those that are taken by default."""
    usual = stabilized(prepare(data, **asked), orders)
    with plain_steps():
        return stabilized(prepare(data, **asked), orders), usual


def residues(diagram: StabilizationDiagram) -> np.ndarray:
    return np.einsum("lk,km->klm", diagram.shapes, diagram.participation)


def check_equal(plain: StabilizationDiagram, usual: StabilizationDiagram, residual: float = 1e-9) -> None:
    assert plain.orders == usual.orders
    np.testing.assert_allclose(plain.poles, usual.poles, rtol=1e-9)
    np.testing.assert_allclose(plain.fit_errors, usual.fit_errors, rtol=1e-9)
    np.testing.assert_allclose(residues(plain), residues(usual), atol=residual * np.abs(residues(usual)).max())
    for flag in ("stable_frequency", "stable_damping", "stable_shape"):
        np.testing.assert_array_equal(getattr(plain, flag), getattr(usual, flag))
    for name, values in plain.indicators.items():
        if name != "mpc":  # of repeated poles, which a further step knows, it is that of their cluster
            np.testing.assert_allclose(values, usual.indicators[name], atol=1e-6, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["era", "polyreference", "alternate", "least_squares"])
def test_the_diagram_of_the_beam_is_that_of_plain_steps(method: str) -> None:
    check_equal(*both(ms.datasets.load("beam_hammer"), method=method, band=(100, 4500)))


@pytest.mark.slow
def test_the_same_modes_are_selected_from_plain_steps() -> None:
    lists = [ms.select(diagram) for diagram in both(ms.datasets.load("beam_hammer"), band=(100, 4500))]
    np.testing.assert_allclose(lists[0].frequencies, lists[1].frequencies, rtol=1e-9)
    np.testing.assert_allclose(lists[0].damping_ratios, lists[1].damping_ratios, rtol=1e-7)


@pytest.mark.parametrize("form", ["observable", "controllable"])
@pytest.mark.parametrize("method", ["era", "alternate", "least_squares", "prce"])
def test_diagrams_of_samples_are_those_of_plain_steps(method: str, form: str) -> None:
    orders = [4, 8, 12] if method == "prce" else [4, 6, 8, 10, 12]
    check_equal(*both(noisy(), orders, method=method, form=form, block_rows=20, block_columns=60))


@pytest.mark.parametrize(("made", "domain"), [(lines, "z"), (correlations, "time")])
def test_so_are_those_of_lines_in_z_and_of_correlations(made: Any, domain: str) -> None:
    check_equal(*both(made(), [4, 6, 8, 10], method="alternate", domain=domain))


def test_faster_ways_to_factors_give_those_of_the_plain_one() -> None:
    many = noisy().values.repeat(8, axis=1)
    data = ImpulseResponse(
        values=many + 1e-4 * np.random.default_rng(1).standard_normal(many.shape), sampling_rate=20.0
    )
    sizes = {"block_rows": 40, "block_columns": 100}
    usual = factor(prepare(data, method="era", **sizes), 10)
    assert isinstance(usual.matrix, StructuredHankel)
    assert "dense" not in usual.factors.how
    with plain_steps():
        plain = factor(prepare(data, method="era", **sizes), 10)
    assert type(plain.matrix) is Hankel
    assert "dense" in plain.factors.how
    np.testing.assert_allclose(usual.factors.d, plain.factors.d, rtol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(usual.factors.P * plain.factors.P, axis=0)), 1, rtol=1e-9)
    for k in (0, 1):
        np.testing.assert_allclose(usual.matrix.shifted(k).dense(), plain.matrix.shifted(k).dense())
    np.testing.assert_allclose(usual.matrix.tall().dense(), plain.matrix.tall().dense())


def test_all_of_a_left_factor_is_that_of_the_plain_decomposition() -> None:
    rng = np.random.default_rng(2)
    matrix = BlockHankel(rng.standard_normal((800, 2, 3)), 70, 640)
    usual = left_factor(matrix)
    with plain_steps():
        plain = left_factor(matrix)
    assert "dense" not in usual.how
    np.testing.assert_allclose(usual.d, plain.d, rtol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(usual.P * plain.P, axis=0)), 1, rtol=1e-6)


def test_poles_of_many_outputs_through_combinations_are_those_of_all() -> None:
    few = chain5().frequency_response(np.linspace(0.3, 7.5, 100))
    spread = np.random.default_rng(3).standard_normal((240, few.values.shape[1]))
    many = FrequencyResponse(
        values=np.einsum("ol,flm->fom", spread, few.values), frequencies=few.frequencies, quantity="displacement"
    )
    plain, usual = both(many, [10], block_rows=12)
    assert any("combinations" in str(note) for note in usual.notes)
    assert not any("combinations" in str(note) for note in plain.notes)
    np.testing.assert_allclose(plain.poles, usual.poles, rtol=1e-6)
    np.testing.assert_allclose(residues(plain), residues(usual), atol=1e-6 * np.abs(residues(usual)).max())


def test_plain_steps_take_the_data_and_options_of_the_report_alone() -> None:
    with plain_steps():
        for asked, what in (
            ({"method": "n4sid"}, "there are era"),
            ({"method": "era", "row_shifts": (0, 2, 3)}, "whole consecutive blocks"),
            ({"method": "era", "weights": "level"}, "works on samples"),
        ):
            with pytest.raises(DataError, match=what):
                factor(prepare(noisy(), **asked), 10)
        with pytest.raises(DataError, match="a plain matrix of degree 8"):
            factor(prepare(lines(), method="era", block_rows=8, basis="powers"), 10)
        with pytest.raises(DataError, match="plain data matrix has none"):
            full(factor(prepare(noisy()), 10).matrix)


def test_every_step_that_stands_beside_the_path_is_there() -> None:
    for name in {**FASTER, **FURTHER}:
        assert callable(handed(name)), name


#: Runs the path with nothing else of the package to import but its data and numerics.
ALONE = """
import sys
path = {path!r}
class Only:
    def find_spec(self, name, *_):
        inner = name.split(".")[1:2]
        if name.startswith("modalscope.") and inner and inner[0] not in ("data", "numerics") and not any(
            (one + ".").startswith(name + ".") for one in path
        ):
            raise ImportError(name + " is not of the reading path")
sys.meta_path.insert(0, Only())
import numpy as np
from modalscope.data import FrequencyResponse
from modalscope.numerics.handed import plain_steps
from modalscope.identification.prepare import prepare
from modalscope.identification.stabilize import stabilized
f = np.linspace(5, 60, 120)
s = 2j * np.pi * f[:, None, None]
poles = [-2 + 120j, -3 + 250j]
values = sum(r / (s - p) + r / (s - np.conj(p)) for p, r in zip(poles, (np.ones((3, 2)), np.arange(6.0).reshape(3, 2))))
data = FrequencyResponse(values=values, frequencies=f, quantity="displacement")
with plain_steps():
    found = stabilized(prepare(data), [2, 4, 6])
print(max(min(abs(found.poles - p)) / abs(p) for p in poles) < 1e-9)
"""


def test_the_path_runs_with_data_and_numerics_alone() -> None:
    run = subprocess.run(
        [sys.executable, "-c", ALONE.format(path=reading_path())], capture_output=True, text=True, check=False
    )
    assert run.stdout == "True\n", run.stderr


def test_the_path_is_sixteen_modules_that_are_there() -> None:
    listed = reading_path()
    assert 8 <= len(listed) <= 16
    assert set(listed) <= set(modules())
