"""How noise in records moves poles: sums over a few points are those over all lines, and the gradient is that of the code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from modalscope.identification.deviating import Asked
from modalscope.identification.fast import record_influence
from modalscope.identification.fast.few_points import few_points
from modalscope.identification.matrices.influence import LineInfluence
from modalscope.identification.matrices.records import RecordInfluence
from modalscope.identification.sweep import Cut
from modalscope.numerics.functions.polynomials import orthogonal_basis
from modalscope.selection.likelihood.covariance import PoleInfluence, influence_on
from modalscope.selection.likelihood.deviations import deviations_of
from modalscope.selection.likelihood.noise import White
from tests.identification.matrices.test_record_lines import runs_of
from tests.support import built, cut_order, random_system, relative

ORDER = 8


def noisy(lengths: tuple[int, ...], noise: float = 0.02, seed: int = 0) -> Records:
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=4, inputs=2, modes=4, damping=(0.01, 0.05))
    records, _ = runs_of(ss, "white", rng, lengths)
    size = noise * records.runs[0].outputs.std(axis=0)
    runs = [replace(run, outputs=run.outputs + size * rng.standard_normal(run.outputs.shape)) for run in records.runs]
    return Records(runs=tuple(runs))


def influence(data: Records, **row: object) -> tuple[PoleInfluence, RecordInfluence, Cut]:
    pipeline = built(data, ORDER, **row)
    cut = cut_order(pipeline, ORDER, deviations=False)
    found = influence_on(pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen)
    assert isinstance(found.gradient, RecordInfluence)
    return found, found.gradient, cut


def plain(gradient: RecordInfluence) -> LineInfluence:
    """The same line by line."""
    return LineInfluence(gradient.direct, gradient.mirrored, gradient.lines)


@pytest.mark.parametrize(
    ("low", "high", "circle"), [(0.001, 0.499, True), (0.1, 0.12, True), (0.01, 1.0, False), (0.7, 1.0, False)]
)
@pytest.mark.parametrize("degree", [1, 8, 45])
def test_a_product_of_polynomials_is_known_by_its_values_at_a_few_points(
    low: float, high: float, circle: bool, degree: int
) -> None:
    f = np.linspace(low, high, 2001)
    x = np.exp(2j * np.pi * f) if circle else 1j * f
    rng, (basis, _) = np.random.default_rng(degree), orthogonal_basis(x, degree)
    one, two = (basis @ (rng.standard_normal(degree + 1) + 1j * rng.standard_normal(degree + 1)) for _ in range(2))
    few = few_points(x, degree, circle=circle)
    assert few.place.size == 2 * degree + 1
    assert np.abs(few.spread).max() < 2  # well chosen: nothing is enlarged
    for product in (np.abs(one) ** 2, one * two.conj()):
        assert np.abs(few.spread @ product[few.place] - product).max() < 1e-12 * np.abs(product).max()


def test_where_there_are_no_more_lines_they_are_the_points_themselves() -> None:
    x = np.exp(1j * np.array([0.3, 0.5, 0.3, 0.9]))
    few = few_points(x, 4, circle=True)
    assert np.array_equal(x[few.place][np.argmax(few.spread, axis=1)], x)
    assert np.array_equal(few.spread.sum(axis=1), np.ones(4))


@pytest.mark.slow
@pytest.mark.parametrize("lengths", [(900,), (700, 333)])
@pytest.mark.parametrize(
    "row", [{"method": "alternate"}, {"method": "era"}, {"method": "alternate", "band": (0.05, 0.3)}]
)
def test_moments_are_those_of_every_line(lengths: tuple[int, ...], row: dict[str, object]) -> None:
    _, gradient, _ = influence(noisy(lengths), route="records", **row)
    variance = np.random.default_rng(0).uniform(1, 2, (4, 1))
    turned = gradient.take(np.arange(len(gradient.left))[::-1])
    for other in (gradient, turned):
        few, whole = gradient.joint(other, variance), plain(gradient).joint(plain(other), variance)
        assert relative(few.size, whole.size) < 1e-12
        assert relative(few.square, whole.square) < 1e-11


def test_two_degrees_share_the_points_of_the_higher() -> None:
    data = noisy((900,))
    low, high = (influence(data, route="records", method="alternate", block_rows=q)[1] for q in (6, 11))
    variance = np.ones((4, 1))
    few, whole = low.joint(high, variance), plain(low).joint(plain(high), variance)
    assert relative(few.size, whole.size) < 1e-12
    assert relative(few.square, whole.square) < 1e-11


def test_the_gradient_is_a_difference_of_the_code() -> None:
    """110 dB: what is left of the second order is small, and so is the step."""
    data, change = noisy((900, 420), noise=3e-6), noisy((900, 420), seed=5)
    found, _, cut = influence(data, route="records", method="alternate")
    ends = []
    for step in (1e-7, -1e-7):
        pairs = zip(data.runs, change.runs, strict=True)
        moved = Records(runs=tuple(replace(run, outputs=run.outputs + step * more.outputs) for run, more in pairs))
        again = cut_order(built(moved, ORDER, route="records", method="alternate"), ORDER, deviations=False)
        ends.append(again.modal.poles)
    predicted = found.of(1e-7 * record_spectra(change).values[None])[0]
    assert relative(predicted, (ends[0] - ends[1]) / 2) < 1e-2
    assert cut.modal.poles.size == 4


@pytest.mark.slow
def test_lines_of_a_long_record_that_are_kept_stand_for_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the lines knows a sum over hundreds of independent ones to some per cent."""
    data = noisy((6000, 3001))

    def deviations() -> np.ndarray:
        pipeline = built(data, ORDER, route="records", method="alternate")
        cut = cut_order(pipeline, ORDER, deviations=False)
        every, noise = np.arange(4), White(np.ones((4, 1)), "here", True)
        assert pipeline.matrix.influence_lines.lines.each.sum() == pipeline.response.whole.count
        asked = Asked(ORDER, cut.triple, cut.modal.poles, cut.modal.eigen, every, noise)
        return deviations_of(pipeline.matrix, pipeline.realization, asked)[0].damping_ratio

    whole = deviations()
    monkeypatch.setattr(record_influence, "_MAX_LINES", 1500)
    assert np.all(np.abs(deviations() / whole - 1) < 0.2)


@pytest.mark.slow
def test_so_they_do_between_two_gradients(monkeypatch: pytest.MonkeyPatch) -> None:
    """The variance is the covariance of a gradient with one that is equal to it."""
    data = noisy((6000, 3001))

    def variances() -> np.ndarray:
        _, gradient, _ = influence(data, route="records", method="alternate")
        equal = gradient.take(np.arange(len(gradient.left)))
        return gradient.joint(equal, np.ones((4, 1))).size.real

    whole = variances()
    monkeypatch.setattr(record_influence, "_MAX_LINES", 1500)
    # deviations within a fifth, as above: variances within the square of that
    assert np.all(np.abs(variances() / whole - 1) < 1.2**2 - 1)
