"""How the data move poles, against differences of the code, for every row of the table and every shape of its data matrix."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.response import Response
from modalscope.identification.matrices.factor import tall_factors
from modalscope.identification.matrices.influence import Influence
from modalscope.identification.method_names import find_method
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import prepare
from modalscope.identification.realizations.shift import shift
from modalscope.selection.likelihood.covariance import influence_on
from modalscope.signals.preprocess import estimate_correlation
from modalscope.systems import chain5
from modalscope.systems.records import white_noise
from tests.support import built, cut_order, relative

#: 110 dB: what is left of the second order is small, and so is the step. Formulas that hold without noise are off by as much as the noise.
QUIET, STEP = 3e-6, 1e-2


def noise_like(response: Response, rng: np.random.Generator) -> np.ndarray:
    return white_noise(response.values, 1.0, rng)


def samples(seed: int = 0, count: int = 200) -> ImpulseResponse:
    return chain5().impulse_response(count, noise=QUIET, seed=seed)


def lines(seed: int = 0, sampled: bool = False) -> FrequencyResponse:
    f = np.linspace(0.3, 8.0, 161)
    if sampled:
        return chain5().state_space(dt=0.05).frequency_response(np.linspace(0, 10, 161))
    found = chain5().frequency_response(f)
    rng = np.random.default_rng(seed)
    return replace(found, values=found.values + QUIET * white_noise(found.values, 1.0, rng))


def differences(data: Response, order: int, size: float = QUIET, **row: object) -> tuple[np.ndarray, np.ndarray]:
    """Return the change of the five poles by the influence, and by a difference of the code."""
    pipeline = built(data, order, **row)
    cut = cut_order(pipeline, order)
    true = chain5().modes().poles
    nearest = [int(np.argmin(np.abs(cut.modal.poles - s))) for s in true]
    change = size * noise_like(data, np.random.default_rng(7))
    found = influence_on(
        pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen.take(np.array(nearest))
    )
    predicted = found.of(change[None])[0]
    ends = []
    for sign in (1, -1):
        moved = replace(data, values=data.values + sign * STEP * change)
        again = cut_order(built(moved, order, **row), order).modal
        ends.append([again.poles[int(np.argmin(np.abs(again.poles - cut.modal.poles[j])))] for j in nearest])
    return predicted, (np.array(ends[0]) - np.array(ends[1])) / (2 * STEP)


COMPRESSED = {"row_compression": np.array([[1.0, 0.5, 0, 0], [0, 0, 1, -1], [1, 0, 0, 1]])}
WEIGHTED = {"row_weights": np.array([1.0, 2, 0.5, 1]), "column_weights": np.array([1.0, 3])}
GENERAL = {
    "block_rows": 10,
    "block_columns": 12,
    "row_weights": np.linspace(1, 2, 40),
    "column_weights": np.linspace(2, 1, 24),
}
SUBSETS = {
    "block_rows": 10,
    "block_columns": 12,
    "row_subsets": [[0, 1, 2, 3]] + [[0, 2, 3]] * 9,
    "column_subsets": [[0, 1]] + [[1]] * 11,
}
UNEVEN = {"row_shifts": [0, 1, 3, 4, 7, 9, 12, 15], "column_shifts": [0, 1, 2, 4, 7, 8, 11, 14]}
SQUEEZED = {
    "block_rows": 10,
    "block_columns": 12,
    "row_compression": np.random.default_rng(3).standard_normal((14, 40)),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "order", "options"),
    [
        ("era", 10, {}),
        ("era", 10, {"form": "controllable"}),
        ("era", 10, COMPRESSED),
        ("era", 10, WEIGHTED),
        ("era", 10, GENERAL),
        ("era", 10, SUBSETS),
        ("era", 10, UNEVEN),
        ("era", 10, SQUEEZED),
        ("least_squares", 10, {}),
        ("least_squares", 10, GENERAL),
        ("alternate", 10, {}),
        ("alternate", 10, {"form": "controllable"}),
        ("alternate", 10, COMPRESSED),
        ("alternate", 10, GENERAL),
        ("alternate", 10, SUBSETS),
        ("polyreference", 10, {}),
        ("polyreference", 10, {"form": "observable"}),
        ("polyreference", 10, {"form": "observable", **GENERAL}),
        ("polyreference", 10, {"form": "observable", **COMPRESSED}),
        ("prce", 12, {}),
        ("prce", 12, {"form": "observable"}),
    ],
)
def test_samples(method, order, options):
    predicted, measured = differences(samples(), order, method=method, domain="time", **options)
    assert relative(predicted, measured) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("domain", ["s", "z"])
@pytest.mark.parametrize("method", ["era", "least_squares", "alternate", "polyreference", "loewner"])
def test_lines(method, domain):
    predicted, measured = differences(lines(), 10, method=method, domain=domain)
    assert relative(predicted, measured) < 1e-3


@pytest.mark.parametrize("method", ["era", "least_squares", "alternate", "polyreference"])
def test_shifted_transfer_functions_of_a_window(method):
    predicted, measured = differences(samples(), 10, method=method, domain="z")
    assert relative(predicted, measured) < 1e-3


def test_lines_that_shift_on_a_loewner_matrix():
    row = replace(find_method("loewner", "s", "s"), factor=tall_factors, realize=shift)
    data = lines()

    def realized(response):
        return factor(replace(prepare(response, "loewner", "s"), method=row), 10)

    pipeline = realized(data)
    cut = cut_order(pipeline, 10)
    found = influence_on(pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen)
    change = QUIET * noise_like(data, np.random.default_rng(7))
    ends = [
        cut_order(realized(replace(data, values=data.values + sign * STEP * change)), 10).modal.poles
        for sign in (1, -1)
    ]
    assert relative(found.of(change[None])[0], (ends[0] - ends[1]) / (2 * STEP)) < 1e-3


def test_shifted_transfer_functions_of_a_full_grid():
    clean = lines(sampled=True)
    noisy = replace(clean, values=clean.values + QUIET * white_noise(clean.values, 1.0, np.random.default_rng(4)))
    row = {"method": "era", "domain": "z", "source": "samples"}
    predicted, measured = differences(noisy, 10, **row)
    assert relative(predicted, measured) < 1e-3


@pytest.mark.parametrize("level", [1e-4, 1e-2])
@pytest.mark.parametrize("sampled", [False, True])
def test_the_matrix_fraction_at_any_level_of_noise(sampled, level):
    clean = lines(sampled=sampled)
    noisy = replace(clean, values=clean.values + level * white_noise(clean.values, 1.0, np.random.default_rng(4)))
    predicted, measured = differences(noisy, 20, level, method="lscf", weights=np.linspace(1, 2, 161))
    assert relative(predicted, measured) < 5e-3  # the level of an output, which changes with it, is taken as given


@pytest.mark.parametrize("method", [pytest.param("ssi-data", marks=pytest.mark.slow), "ssi-cva"])
def test_projected_records_by_their_correlation(method):
    """A change of the records changes their correlation, and the poles by the influence of that.

    The projection leaves the ends of the record out, and the correlation does not: of 20 000 samples a percent.
    """
    record = chain5().simulate(inputs="ambient", samples=20000, seed=2)
    step = 1e-3 * record.outputs.std() * np.random.default_rng(2).standard_normal(record.outputs.shape)
    row = {"method": method, "block_rows": 12, "block_columns": 12}
    pipeline = built(record, 10, **row)
    cut, whitening = cut_order(pipeline, 10), pipeline.problem.whitening
    assert whitening is not None
    found = influence_on(pipeline.matrix.fitted, pipeline.realization, cut.order, cut.triple, cut.modal.eigen)
    moved = [replace(record, outputs=record.outputs + sign * step) for sign in (1, -1)]
    ends = [estimate_correlation(r, lags=pipeline.response.samples).values for r in moved]
    predicted = found.of(whitening.of_values(ends[0] - ends[1])[None] / 2)[0]
    poles = [cut_order(built(r, 10, **row), 10).modal.poles for r in moved]
    assert relative(predicted, (poles[0] - poles[1]) / 2) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("runs", [1, 2])
@pytest.mark.parametrize("domain", ["s", "z"])
@pytest.mark.parametrize("method", ["era", "alternate"])
def test_records_on_lines(method, domain, runs):
    """A change of the outputs changes their transforms; inputs and ends stay eliminated.

    Held inputs are exact in z; in s what they leave acts as noise, and the first order is off by as much.
    """
    record = chain5().simulate(inputs="white", samples=600, runs=runs, noise=QUIET, seed=1)
    step = 1e-8 * record.outputs.std() * np.random.default_rng(3).standard_normal(record.outputs.shape)
    row = {"method": method, "domain": domain}
    pipeline = built(record, 10, **row)
    cut = cut_order(pipeline, 10)
    found = influence_on(pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen)
    ends = [built(replace(record, outputs=record.outputs + sign * step), 10, **row) for sign in (1, -1)]
    predicted = found.of((ends[0].response.values - ends[1].response.values)[None])[0]
    poles = [cut_order(end, 10).modal.poles for end in ends]
    assert relative(predicted, poles[0] - poles[1]) < (1e-3 if domain == "z" else 3e-2)


def plain_moments(found: Influence, shape: tuple[int, ...], variance: np.ndarray, parts: int) -> tuple[np.ndarray, ...]:
    """E|dp|^2 and E[dp^2] by unit changes of every value, real and imaginary."""
    size: np.ndarray = 0  # type: ignore[assignment]
    square: np.ndarray = 0  # type: ignore[assignment]
    spread = np.broadcast_to(variance, shape)
    for index in np.ndindex(shape):
        for unit in (1, 1j)[:parts]:
            change = np.zeros(shape, complex if parts == 2 else float)
            change[index] = unit
            dp = found.of(change[None])[0]
            size = size + spread[index] / parts * np.abs(dp) ** 2
            square = square + spread[index] / parts * dp**2
    return size, square


@pytest.mark.parametrize("by_line", [False, True])
@pytest.mark.parametrize("method", ["alternate", "lscf"])
def test_moments_of_lines_are_those_of_every_value(method, by_line):
    data = lines().at_lines(slice(0, None, 4))
    pipeline = built(data, 10, method=method)
    cut = cut_order(pipeline, 10)
    found = influence_on(pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen)
    variance = np.random.default_rng(0).uniform(1, 2, data.values.shape if by_line else data.values.shape[1:])
    size, square = plain_moments(found, data.values.shape, variance, 2)
    moments = found.joint(found, variance)
    assert relative(moments.size, size) < 1e-12
    assert relative(moments.square, square) < 1e-11


@pytest.mark.parametrize(
    ("method", "fading"), [("era", None), ("prce", None), ("era", np.linspace(2, 0, 50))], ids=["era", "prce", "fades"]
)
def test_moments_of_samples_are_those_of_every_value(method, fading):
    data = samples(count=50)
    pipeline = built(data, 10, method=method)
    cut = cut_order(pipeline, 10)
    found = influence_on(pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen)
    variance = np.random.default_rng(0).uniform(1, 2, data.values.shape[1:])
    of_all = variance if fading is None else variance * fading[:, None, None]
    size, square = plain_moments(found, data.values.shape, of_all, 1)
    moments = found.joint(found, variance, *([] if fading is None else [fading]))
    assert relative(moments.size, size) < 1e-12
    assert relative(moments.square, square) < 1e-11


def test_moments_of_lines_that_correlate_are_those_of_the_parts_of_their_covariance():
    data = lines().at_lines(slice(0, None, 6))
    pipeline = built(data, 10, method="alternate")
    cut = cut_order(pipeline, 10)
    found = influence_on(pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen)
    correlation = 1 / (1 + 0.7j * np.arange(data.count))
    values, vectors = np.linalg.eigh(sla.toeplitz(correlation, correlation.conj()))
    variance = np.random.default_rng(0).uniform(1, 2, data.values.shape[1:])
    moments = found.joint(found, variance, correlation)
    size, square = np.zeros(len(moments.size)), np.zeros(len(moments.size), complex)
    for o, i in np.ndindex(variance.shape):
        changes = np.zeros((2 * len(values), *data.values.shape), complex)
        parts = np.sqrt(np.maximum(values, 0) * variance[o, i] / 2) * vectors
        changes[:, :, o, i] = np.concatenate([parts.T, 1j * parts.T])
        moved = found.of(changes)
        size, square = size + np.sum(np.abs(moved) ** 2, axis=0), square + np.sum(moved**2, axis=0)
    assert relative(moments.size, size) < 1e-12
    assert relative(moments.square, square) < 1e-11
