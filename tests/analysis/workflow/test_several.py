"""Modes of setups put together, and what groups of columns say of a pole: closed forms."""

import numpy as np
import pytest

from modalscope.analysis.workflow.setups import merge_modes, with_repeatability
from modalscope.data import DataError, ImpulseResponse, ModalModel
from modalscope.data.indicators import mac
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.covariance import steps_of_groups
from modalscope.systems import chain5

MODES = chain5().modes()
SENSORS = (("1:+X", "2:+X"), ("1:+X", "4:+X"), ("5:+X", "1:+X"), ("1:+X", "2:+X", "4:+X"))


def parts(**changed):
    """Parts of one structure's modes: each shape at a scale of its own, frequencies moved by given factors."""
    rng = np.random.default_rng(0)
    found = []
    for j, dofs in enumerate(SENSORS):
        own = MODES.select(outputs=list(dofs))
        scale = rng.standard_normal(len(own)) + 1j * rng.standard_normal(len(own))
        f = own.frequencies * (1 + changed.get("moved", np.zeros(len(SENSORS)))[j])
        std = changed.get("std")
        found.append(
            ModalModel(
                poles=poles_from(f, own.damping_ratios),
                shapes=own.shapes * scale,
                output_dofs=own.output_dofs,
                frequencies_std=None if std is None else np.full(len(own), std[j]),
            )
        )
    return found


def test_parts_of_any_scale_give_the_whole_shapes_back():
    merged = merge_modes(parts())
    assert merged.output_dofs == ("1:+X", "2:+X", "4:+X", "5:+X")
    assert np.diag(mac(merged.shapes, MODES.shapes)) == pytest.approx(1, abs=1e-12)
    assert merged.frequencies == pytest.approx(MODES.frequencies, rel=1e-12)
    assert merged.frequencies_repeatability == pytest.approx(0, abs=1e-12)


def test_the_deviation_between_setups_is_that_of_their_mean():
    moved = np.array([-0.002, 0.001, 0.003, 0.002])
    merged = merge_modes(parts(moved=moved))
    assert merged.frequencies == pytest.approx(MODES.frequencies * (1 + moved.mean()), rel=1e-12)
    assert merged.frequencies_repeatability == pytest.approx(MODES.frequencies * moved.std(ddof=1) / 2, rel=1e-9)
    assert merge_modes(parts(moved=moved), groups=["a", "b", "c", "c"]).frequencies_repeatability is None
    assert merge_modes(parts(moved=moved)[:3]).frequencies_repeatability is None


def test_means_are_weighted_by_known_variances():
    moved, std = np.array([0.0, 0.004, 0.0, 0.0]), np.array([0.001, 0.002, 0.001, 0.002])
    merged = merge_modes(parts(moved=moved, std=std))
    weight = 1 / std**2
    assert merged.frequencies == pytest.approx(MODES.frequencies * (1 + moved @ weight / weight.sum()), rel=1e-12)
    assert merged.frequencies_std == pytest.approx(1 / np.sqrt(weight.sum()), rel=1e-12)


def test_a_mode_that_one_setup_lacks_gets_its_shape_from_the_response_there():
    given = parts()
    given[1] = given[1].take([0, 2, 3, 4])
    alone = merge_modes(given)
    assert len(alone) == 4
    assert "only 3 of 4 setups have it: 1, 3, 4" in alone.left_out[0].reason
    responses = [chain5().impulse_response(400, outputs=list(dofs)) for dofs in SENSORS]
    whole = merge_modes(given, responses=responses)
    assert np.diag(mac(whole.shapes, MODES.shapes)) == pytest.approx(1, abs=1e-9)
    assert whole.reasons[1]["setups"] == "found in 3 of 4"


def test_a_mode_of_one_setup_alone_is_left_out():
    given = parts()
    extra = given[0].take([0])
    odd = ModalModel(
        poles=np.append(given[0].poles, 1.4 * extra.poles),
        shapes=np.column_stack([given[0].shapes, extra.shapes]),
        output_dofs=given[0].output_dofs,
    )
    merged = merge_modes([odd, *given[1:]])
    assert len(merged) == 5
    assert [each.reason for each in merged.left_out] == ["only 1 of 4 setups have it: 1"]


def test_setups_without_a_common_output_are_refused():
    with pytest.raises(DataError, match="they have none in common"):
        merge_modes([MODES.select(outputs=["1:+X"]), MODES.select(outputs=["2:+X"])])
    with pytest.raises(DataError, match="the list is empty"):
        merge_modes([])


def groups_of_columns(shifts, rate=20.0):
    """Columns of four groups, each the response of its own poles: the modes' with a shift."""
    t = np.arange(300) / rate
    rng = np.random.default_rng(1)
    columns = []
    for shift in shifts:
        residues = rng.standard_normal((2, 3, 2, 2)) @ [1, 1j]
        grown = np.exp(np.outer(t, POLES + shift))
        columns.append(2 * np.einsum("tn,nlm->tlm", grown, residues).real)
    values = np.concatenate(columns, axis=2)
    labels = [name for name in "abcd" for _ in range(2)]
    return ImpulseResponse(values=values, sampling_rate=rate, kind="correlation", groups=labels, first_sample=0)


POLES = np.array([-0.2 + 8j, -0.3 + 21j])


def test_a_group_moves_a_pole_to_where_its_own_columns_have_it():
    shifts = 1e-4 * np.array([[1 + 2j, -1j], [-1, 2], [0.5j, 1 - 1j], [-0.5 - 2j, -1]])
    found = steps_of_groups(POLES, groups_of_columns(shifts))
    # a step of Gauss and Newton is right to the second order of the shift times the length of the response
    assert found == pytest.approx(shifts, abs=3e-7)
    modes = ModalModel(poles=POLES, shapes=np.ones((3, 2)))
    told = with_repeatability(modes, groups_of_columns(shifts))
    f = np.abs(POLES + shifts) / (2 * np.pi)
    assert told.frequencies_repeatability == pytest.approx(f.std(axis=0, ddof=1) / 2, rel=1e-2)


def test_fewer_than_four_groups_tell_nothing():
    response = groups_of_columns(np.zeros((4, 2)))
    three = ImpulseResponse(values=response.values[..., :6], sampling_rate=20.0, groups=list("aabbcc"))
    assert with_repeatability(MODES, three) is MODES
