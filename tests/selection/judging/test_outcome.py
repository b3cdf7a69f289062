"""The chosen modes as a modal model: medians, spreads over orders, the shape in the middle, and what is lost without a mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.indicators import mac
from modalscope.data.modes import ModalModel
from modalscope.data.response import Response
from modalscope.data.whitening import levels_of_channels
from modalscope.selection.judging import outcome as outcomes
from modalscope.selection.judging.evidence import Candidate
from modalscope.selection.judging.outcome import modes_of
from modalscope.selection.likelihood.joint_fit import JointFit, joint_fit
from modalscope.systems import chain5
from tests.selection.judging.made import Pole, at_angle, diagram_of, poles_of, response_of

#: Two modes that no channel and no scaling can exchange.
ONE = Pole(2, 8, 0.02, shape=(1, 2), part=(0.5, 1, -2))
TWO = Pole(2, 14, 0.01, shape=(3, -1), part=(1, 0.5, 1))

#: Standard deviation of a normal variable over its median absolute deviation.
NORMAL = 1.4826


def response(**how: Any) -> ImpulseResponse:
    return response_of([ONE.pole, TWO.pole], [ONE.shape, TWO.shape], [ONE.part, TWO.part], **how)


def candidate(members: list[int], pole: Pole, **facts: Any) -> Candidate:
    known: dict[str, Any] = {"text": "by hand", **facts}
    return Candidate(np.array(members), pole.f, pole.zeta, known, ())


def outcome(*made: Pole, chosen: list[Candidate], data: Any = None, **more: Any) -> ModalModel:
    diagram = diagram_of(*made, response=response() if data is None else data, **more)
    return modes_of(diagram, poles_of(*made), chosen)


BOTH = [candidate([0], ONE), candidate([1], TWO)]


def test_participation_is_fitted_so_that_the_modes_rebuild_the_data() -> None:
    model = outcome(ONE, TWO, chosen=BOTH)
    for mode, residue in zip((ONE, TWO), model.residues, strict=True):
        assert np.allclose(residue, np.outer(mode.shape, mode.part), atol=1e-10)
    assert model.participation is not None
    assert model.participation.shape == (2, 3)
    assert (model.output_dofs, model.input_dofs) == (response().output_dofs, response().input_dofs)
    assert np.allclose(np.linalg.norm(model.shapes, axis=0), 1)  # "unit"


def test_an_exponential_window_is_off_the_poles_and_on_in_what_they_are_fitted_to() -> None:
    added = 1.5
    windowed = response_of(
        [ONE.pole - added, TWO.pole - added], [ONE.shape, TWO.shape], [ONE.part, TWO.part], added_damping=added
    )
    model = outcome(ONE, TWO, chosen=BOTH, data=windowed)
    assert np.allclose(model.poles, [ONE.pole, TWO.pole])
    for mode, residue in zip((ONE, TWO), model.residues, strict=True):
        assert np.allclose(residue, np.outer(mode.shape, mode.part), atol=1e-10)
    # rebuilt with the window the modes leave nothing, so that what is lost without one is exactly its part
    assert [r["fit_loss"] for r in model.reasons] == pytest.approx(losses(windowed, added))


def losses(data: ImpulseResponse, added: float = 0.0) -> list[float]:
    """Norm of each mode's part over that of the data, channels level."""
    parts = [
        response_of([m.pole - added], [m.shape], [m.part], samples=data.samples, kind=data.kind).values
        for m in (ONE, TWO)
    ]
    return [size(part, data) / size(data.values, data) for part in parts]


def size(values: Any, data: Any) -> float:
    return float(np.linalg.norm(values / np.outer(*levels_of_channels(data.values))))


def test_what_the_fit_loses_without_a_mode_is_its_part_of_the_response() -> None:
    model = outcome(ONE, TWO, chosen=BOTH)
    assert [r["fit_loss"] for r in model.reasons] == pytest.approx(losses(response()))


def test_the_loss_is_the_growth_of_the_error_that_is_there_already() -> None:
    # with one mode chosen the other is left; without any all of the response is
    model = outcome(ONE, TWO, chosen=[candidate([1], TWO)])
    data = response()
    error = size(data.values - model.impulse_response(400, 50.0).values, data) / size(data.values, data)
    assert model.reasons[0]["fit_loss"] == pytest.approx(1 - error)


@pytest.mark.parametrize("kind", ["response", "records"])
def test_the_loss_does_not_depend_on_how_many_numbers_are_rebuilt_at_a_time(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What records begin with is fitted to all outputs together: parts of these would be fitted better."""
    built = chain5()
    data = (
        built.impulse_response(200, noise=0.1, seed=3)
        if kind == "response"
        else built.simulate(inputs="white", duration=40.0, sampling_rate=20.0, noise=0.1, seed=3)
    )
    diagram = ms.stabilize(data, orders=range(10, 19, 2))
    modes = ms.select(diagram)
    assert len(modes) == 5
    facts: list[dict[str, Any]] = [{"text": "said"} for _ in range(len(modes))]
    whole = [each["fit_loss"] for each in outcomes._reasons(modes, diagram.response, facts)]
    monkeypatch.setattr(outcomes, "_NUMBERS_AT_A_TIME", 1)
    parts = [each["fit_loss"] for each in outcomes._reasons(modes, diagram.response, facts)]
    assert parts == pytest.approx(whole, rel=1e-9)


def test_spreads_are_robust_standard_deviations_over_the_members() -> None:
    # distances from the median: frequency 0, .1, .2, .3, 5 Hz, damping 0, .001, .002, .004, .03
    f, zeta = [8.0, 8.1, 7.8, 8.3, 13.0], [0.02, 0.019, 0.022, 0.024, 0.05]
    made = [ONE._replace(order=2 * k + 2, f=f[k], zeta=zeta[k]) for k in range(5)]
    model = outcome(*made, chosen=[candidate([0, 1, 2, 3, 4], ONE)])
    assert model.frequencies_spread is not None
    assert model.damping_ratios_spread is not None
    assert model.frequencies_spread[0] == pytest.approx(NORMAL * 0.2)
    assert model.damping_ratios_spread[0] == pytest.approx(NORMAL * 0.002)
    assert model.reasons[0]["frequency_spread_hz"] == pytest.approx(NORMAL * 0.2)
    assert model.reasons[0]["damping_ratio_spread"] == pytest.approx(NORMAL * 0.002)


def test_spread_and_values_are_those_of_the_members_alone() -> None:
    made = [ONE._replace(order=2), TWO._replace(order=2), ONE._replace(order=4, f=8.2), TWO._replace(order=4)]
    model = outcome(*made, chosen=[candidate([0, 2], ONE), candidate([1, 3], TWO)])
    assert model.frequencies_spread is not None
    # of two values the standard deviation itself: they are 0.1 to either side of their mean
    assert model.frequencies_spread.tolist() == [pytest.approx(0.2 / np.sqrt(2)), 0.0]
    # poles are those of the candidates, which hold the medians
    assert np.allclose(model.poles, [ONE.pole, TWO.pole])


def test_the_fit_of_residues_starts_from_the_member_nearest_to_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = []

    def start(response: Response, poles: np.ndarray, shapes: np.ndarray, *model: object, **how: object) -> JointFit:
        begun.append(shapes)
        return joint_fit(response, poles, shapes, *model, **how)  # type: ignore[arg-type]

    monkeypatch.setattr(outcomes, "joint_fit", start)
    likeness = [1.0, 0.99, 0.9]
    made = [Pole(2 * k + 2, shape=at_angle(v)) for k, v in enumerate(likeness)]
    outcome(*made, chosen=[candidate([0, 1, 2], made[0])])
    assert mac(begun[0][:, 0], at_angle(0.99))[0, 0] == pytest.approx(1)


def test_indicators_are_the_medians_of_the_members_wherever_these_stand_in_the_diagram() -> None:
    # the diagram has poles that the poles chosen from do not have
    made = [ONE, TWO, ONE._replace(order=4), TWO._replace(order=4), ONE._replace(order=6), TWO._replace(order=6)]
    extra = [Pole(2, 30), Pole(4, 30), Pole(6, 30)]
    emac = np.array([0.0, 0.0, 0.0, 0.1, 0.9, 0.3, 0.7, 0.2, 0.8])
    diagram = diagram_of(*extra, *made, response=response(), indicators={"emac": emac})
    poles = replace(poles_of(*made), index=np.arange(3, 9))
    model = modes_of(diagram, poles, [candidate([0, 2, 4], ONE), candidate([1, 3, 5], TWO)])
    assert model.indicators["emac"].tolist() == pytest.approx([0.2, 0.8])


def test_reasons_hold_the_facts_and_a_sentence_of_their_own() -> None:
    facts = {
        "orders_found": 3,
        "orders_tried": 4,
        "first_order": 2,
        "last_order": 8,
        "share_of_peak": 0.5,
        "indicator_prominence": 1.0,
    }
    chosen = [Candidate(np.array([0]), ONE.f, ONE.zeta, facts, ()), candidate([1], TWO)]
    reasons: tuple[Mapping[str, Any], ...] = outcome(ONE, TWO, chosen=chosen).reasons
    assert facts.items() <= reasons[0].items()
    assert reasons[0]["text"].startswith("found at 3 of 4 orders (2 to 8); 50 %")
    assert reasons[0]["text"].endswith(f"the unexplained part grows by {100 * reasons[0]['fit_loss']:.2g} %")
    assert reasons[1]["text"] == "by hand"


def test_what_the_data_are_the_modes_are() -> None:
    held = outcome(ONE, TWO, chosen=BOTH, data=response(kind="pulse"), dt=1 / 50)
    assert (held.held_input, held.dt, held.quantity) == (True, 1 / 50, None)
    free = outcome(ONE, TWO, chosen=BOTH, data=response(quantity="velocity"))
    assert (free.held_input, free.dt, free.quantity) == (False, None, "velocity")


def test_on_lines_residuals_stand_beside_the_modes_and_are_no_part_of_a_mode() -> None:
    f = np.linspace(5, 18, 60)
    s = 2j * np.pi * f[:, None, None]
    R = [np.outer(m.shape, m.part) for m in (ONE, TWO)]
    lower, upper = np.outer([1, 2], [30, 0, 10]), np.outer([0.01, -0.02], [1, 1, 0])
    modal = sum(r / (s - m.pole) + r / (s - np.conj(m.pole)) for r, m in zip(R, (ONE, TWO), strict=True))
    data = FrequencyResponse(values=modal + lower / s**2 + upper, frequencies=f, quantity="displacement")
    model = outcome(ONE, TWO, chosen=BOTH, data=data)
    assert model.lower_residual is not None
    assert model.upper_residual is not None
    assert np.allclose(model.lower_residual, lower, atol=1e-7)
    assert np.allclose(model.upper_residual, upper, atol=1e-10)
    own = size(R[0] / (s - ONE.pole) + R[0] / (s - np.conj(ONE.pole)), data) / size(data.values, data)
    assert model.reasons[0]["fit_loss"] == pytest.approx(own)


def test_nothing_chosen_is_a_model_without_modes() -> None:
    model = outcome(ONE, chosen=[])
    assert len(model) == 0
    assert model.reasons == ()
    assert model.shapes.shape == (2, 0)
