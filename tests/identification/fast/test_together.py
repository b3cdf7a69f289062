"""Orders that are judged together are judged as each is alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modalscope import DataError, FrequencyResponse, ImpulseResponse, Signals, estimate_correlation
from modalscope.data.rebuilt import fit_error, rebuilt
from modalscope.data.response import output_scale
from modalscope.identification.fast import together as cutting
from modalscope.identification.matrices.matrix import ModalFit
from modalscope.identification.pipeline import Pipeline, factor
from modalscope.identification.prepare import prepare
from modalscope.identification.sweep import Cut, Sweep, first_models
from modalscope.numerics.functions.poles import poles_from
from tests.support import FIVE, cut_order, relative

ORDERS = tuple(range(1, 25))


def response(outputs: int = 5, inputs: int = 2, *, first: int = 0, growing: bool = False) -> ImpulseResponse:
    rng, count = np.random.default_rng(7), 6
    s = poles_from(np.sort(rng.uniform(0.05, 0.4, count)), rng.uniform(0.005, 0.03, count)) + 0.03 * growing
    C, B = rng.standard_normal((outputs, count)), rng.standard_normal((count, inputs))
    values = 2 * np.real((C * np.exp((np.arange(140) + first)[:, None] * s)[:, None]) @ B)
    values += 0.02 * np.abs(values).max() * rng.standard_normal(values.shape)
    return ImpulseResponse(values=values, sampling_rate=1.0, first_sample=first)


def record() -> Signals:
    return Signals(outputs=FIVE["chain5"]().simulate(duration=400, sampling_rate=8).outputs, sampling_rate=8.0)


def ambient() -> ImpulseResponse:
    return estimate_correlation(record())


def lines() -> FrequencyResponse:
    rng, f = np.random.default_rng(3), np.linspace(0.05, 8, 150)
    H = FIVE["chain5"]().frequency_response(f)
    noise = rng.standard_normal((2, *H.values.shape)) * 0.01 * np.abs(H.values).max()
    return replace(H, values=H.values + noise[0] + 1j * noise[1])


def pipeline_of(data: Any, **options: Any) -> Pipeline:
    return factor(prepare(data, **options), ORDERS[-1])


CASES = [
    ("rows that are not made", lambda: pipeline_of(response(8), method="era", block_rows=60, block_columns=70)),
    ("rows that are made", lambda: pipeline_of(response(), method="era", factorization="dense")),
    ("shift", lambda: pipeline_of(response(), method="alternate")),
    ("turned", lambda: pipeline_of(response(), method="alternate", form="controllable")),
    ("regression", lambda: pipeline_of(response(first=3), method="least_squares")),
    ("combinations", lambda: pipeline_of(response(150, 1), method="era")),
    ("growing", lambda: pipeline_of(response(growing=True), method="era")),
    ("correlations", lambda: pipeline_of(ambient())),
    ("least-squares companions", lambda: pipeline_of(response(), method="prce")),
    ("parts of a record", lambda: pipeline_of(record())),
    ("matrix fraction", lambda: pipeline_of(lines(), method="lscf")),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "made"), CASES)
def test_orders_judged_together_are_what_each_is_alone(name: str, made: Any) -> None:
    pipeline = made()
    sweep = Sweep(pipeline, ORDERS)
    several = sweep.judged(first_models(pipeline, ORDERS))
    assert len(several) > 10
    due = [cut.due[1] for cut in several if isinstance(cut, Cut) and cut.due is not None]
    sweep.deviating.deviations(*due)  # of all orders at once, as a diagram asks for them
    for order, cut in zip(ORDERS, several, strict=False):
        if isinstance(cut, DataError):
            continue
        alone = cut_order(pipeline, order)
        assert cut.std is not None
        assert alone.std is not None
        for own, its in zip(cut.std, alone.std, strict=True):
            np.testing.assert_allclose(own, its, rtol=1e-8)
        assert cut.order == order
        assert relative(cut.modal.poles, alone.modal.poles) == 0
        assert cut.misfit == pytest.approx(alone.misfit, rel=1e-12)
        assert set(cut.indicators) == set(alone.indicators)
        for indicator, values in alone.indicators.items():
            np.testing.assert_allclose(cut.indicators[indicator], values, rtol=1e-9, atol=1e-11, err_msg=indicator)
        assert relative(cut.modes.poles, alone.modes.poles) == 0


def test_the_strongest_mode_of_every_order_is_one() -> None:
    pipeline = pipeline_of(response(), method="era")
    for found in Sweep(pipeline, ORDERS, deviations=False).judged(first_models(pipeline, ORDERS[1:])):
        assert not isinstance(found, DataError)
        assert found.indicators["msv"].max() == 1


def test_large_data_are_judged_order_by_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cutting, "_MAX_NUMBERS_TOGETHER", 1)
    pipeline = pipeline_of(response(), method="era")
    assert len(first_models(pipeline, ORDERS)) == 1


def test_models_whose_states_are_rows_are_judged_one_by_one() -> None:
    pipeline = pipeline_of(response(), method="polyreference")
    assert len(first_models(pipeline, ORDERS[3:])) == 1


def test_an_order_that_cannot_be_given_is_left_out_in_its_place() -> None:
    pipeline = factor(prepare(FIVE["chain5"]().impulse_response(80)), 12)
    rank = pipeline.factors.rank
    orders = [rank - 1, rank, rank + 1]
    found = first_models(pipeline, orders)
    assert [isinstance(part, DataError) for part in found] == [False, False, True]
    sweep = Sweep(pipeline, orders, deviations=False)
    assert [cut.order for cut in sweep] == orders[:2]
    assert str(sweep.notes[0]).startswith(f"order {rank + 1} left out")


def test_modes_that_are_no_numbers_leave_their_order_out(monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline = pipeline_of(response(), method="era")
    made, fit = pipeline.matrix, type(pipeline.matrix).fit

    def broken(matrix: Any, model: Any, eigen: Any) -> ModalFit:
        found = fit(matrix, model, eigen)
        return replace(found, shapes=found.shapes * (np.nan if len(model.A) == 4 else 1))

    monkeypatch.setattr(type(made), "fit", broken)
    assert [cut.order for cut in Sweep(pipeline, range(2, 8), deviations=False)] == [2, 3, 5, 6, 7]


def test_what_comes_first_is_handed_out_without_the_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    sweep = Sweep(pipeline_of(response(), method="era"), ORDERS, deviations=False)
    assert next(sweep).order == 1
    assert sweep.remaining == ORDERS[1:]
    assert sweep.cut(9).order == 9
    assert [cut.order for cut in sweep] == list(ORDERS[1:])


@pytest.mark.parametrize(("order", "kind"), [(8, None), (7, "real"), (9, "nyquist")])
def test_the_misfit_is_that_of_all_samples_rebuilt(order: int, kind: str | None) -> None:
    """A pole on the negative real axis is one state, as one on the positive axis is."""
    data = response(7)
    cut = cut_order(pipeline_of(data, method="era"), order, deviations=False)
    assert kind is None or kind in cut.modes.kinds
    level = np.sqrt(np.mean(data.values**2, axis=(0, 2)))[:, None]
    assert cut.misfit == pytest.approx(fit_error(data.values / level, rebuilt(data, cut.modes) / level)[0], rel=1e-12)


@pytest.mark.parametrize("route", ["subspace", "records"])
def test_the_misfit_of_records_with_inputs_is_that_of_all_drives_rebuilt(route: str) -> None:
    record = FIVE["chain5"]().simulate(at=[0, 3], duration=200, sampling_rate=8, noise=0.05)
    pipeline = factor(prepare(record, route=route), 12)
    cut = next(Sweep(pipeline, [9, 12], deviations=False))
    fit, data = cut.modal.fit, pipeline.response
    basis, level = data.basis(cut.modal.poles, fit.powers), output_scale(data)[:, None]
    left = basis.data - basis.rebuilt(fit.shapes, fit.participation, fit.terms[: basis.terms.shape[1]])
    whole = np.sqrt(np.sum(np.abs(data.values / level) ** 2))
    assert cut.misfit == pytest.approx(np.linalg.norm(left / level) / whole, rel=1e-9)
