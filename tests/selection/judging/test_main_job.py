"""The main job: measured and simulated responses to modes, with nothing set."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.refining import refined_where_it_helps
from modalscope.data.rebuilt import fit_of
from tests.support import BEAM, FIVE, add_noise, measured


@pytest.fixture(scope="module")
def beam() -> tuple[ms.ModalModel, ms.StabilizationDiagram]:
    diagram = ms.stabilize(ms.read(BEAM / "beam_hammer.uff"), band=(100, 4500))
    return ms.select(diagram), diagram


def published() -> list[tuple[float, float]]:
    with (BEAM / "published_modes.csv").open() as file:
        return [(float(row["frequency_hz"]), float(row["damping_ratio"])) for row in csv.DictReader(file)]


@pytest.mark.slow
def test_the_published_modes_of_the_measured_beam_are_found_and_none_twice(beam):
    # .6 Hz: the authors' own spread over single responses is .2 to .5 Hz and they print one digit; damping is printed with two,
    # and that of the first mode rests on the few lines between the band's edge and 180 Hz
    modes, _ = beam
    for k, (f, zeta) in enumerate(published()):
        near = np.flatnonzero(np.abs(modes.frequencies - f) < 0.002 * f)
        assert near.size == 1
        assert abs(modes.frequencies[near[0]] - f) < 0.6
        assert abs(modes.damping_ratios[near[0]] / zeta - 1) < (0.3 if k == 0 else 0.2)


@pytest.mark.slow
def test_modes_of_the_beam_beyond_the_published_ones_are_its_torsion_series_and_one_weak_mode_each_with_its_gain(beam):
    # a free beam twists at f, 2 f, 3 f; disjoint hammer points give these again, and the one at 4260 Hz, which has no name
    modes, _ = beam
    known = np.array([f for f, _ in published()])
    others = [j for j, f in enumerate(modes.frequencies) if np.min(np.abs(known - f)) > 0.002 * f]
    torsion = [1376.6, 2782.0, 4163.8]
    assert [min(abs(modes.frequencies[j] - f) for j in others) < 0.0005 * f for f in torsion] == [True] * 3
    for j in others:
        why = modes.reasons[j]
        assert why["gain"] == modes.gain[j] > why["noise_gain"]
        assert why["orders_found"] >= 0.25 * why["orders_tried"]
        if np.min(np.abs(modes.frequencies[j] / torsion - 1)) > 0.0005:
            assert abs(modes.frequencies[j] - 4259.8) < 1
            # narrower than the errors are correlated, so that more of it counts; the least of the torsion series has seven times the bar
            assert modes.gain[j] < 4 * why["noise_gain"]


@pytest.mark.slow
def test_parts_of_a_resonance_of_the_beam_that_shifts_are_named_and_not_listed(beam):
    modes, _ = beam
    parts = [c for c in modes.left_out if c.reason.startswith("duplicate of")]
    assert parts
    for c in parts:
        assert np.min(np.abs(modes.frequencies / c.frequency - 1)) < 0.002


@pytest.mark.slow
def test_modes_of_the_beam_have_both_deviations_and_those_that_are_not_refined_neither(beam):
    modes, diagram = beam
    found = refined_where_it_helps(diagram, modes)
    assert len(found) == len(modes)
    (note,) = (note for note in found.notes if note.kind == "not refined")
    stayed = np.isin(found.poles, modes.poles)
    assert 0 < np.count_nonzero(stayed) == note.numbers["modes"] < len(modes) / 2
    for name in ("frequencies", "damping_ratios"):
        for kind in ("std", "repeatability"):
            deviations = getattr(found, f"{name}_{kind}")
            assert np.all(deviations[~stayed] > 0)
            assert np.all(np.isnan(deviations[stayed]))
    # hammer points agree by no more than a bandwidth
    agreement = found.frequencies_repeatability[~stayed]
    assert np.all(agreement < (found.frequencies * found.damping_ratios)[~stayed])


@pytest.mark.slow
def test_the_rebuilt_responses_explain_the_measured_beam(beam):
    # residues of rank one and two residual lines leave under a tenth, of which noise and the roving hammer's shifts are the larger part
    modes, diagram = beam
    assert fit_of(modes, diagram.response) < 0.1
    assert all(why["fit_loss"] > 0 for why in modes.reasons)


def test_the_three_mass_record_gives_the_published_table_to_every_digit():
    record = ms.systems.three_masses_record()
    found = ms.identify(record, method="era", domain="time", order=34, block_rows=50, block_columns=50).modes
    assert len(found) == 17
    table = np.array(
        [
            # f Hz, zeta %, MSV, EMAC, EMACO, MPC, CMIO: pyyeti's documentation of its ERA example
            [1.3330, 6.5080, 0.838, 0.761, 0.779, 0.946, 0.737],
            [7.4181, 6.9215, 0.851, 0.768, 0.796, 0.999, 0.795],
            [13.7967, 4.8219, 1.000, 0.753, 0.837, 0.998, 0.836],
        ]
    )
    for row in table:
        k = int(np.argmin(np.abs(found.frequencies - row[0])))
        named = {name: values[k] for name, values in found.indicators.items()}
        # half a unit of the last printed digit
        assert abs(found.frequencies[k] - row[0]) < 0.5e-4
        assert abs(100 * found.damping_ratios[k] - row[1]) < 0.5e-4
        printed = [named["msv"], named["emac"], named["emaco"], named["mpc"], named["emaco"] * named["mpc"]]
        assert np.max(np.abs(np.array(printed) - row[2:])) < 0.51e-3


@pytest.mark.parametrize("name", FIVE)
@pytest.mark.parametrize("cell", [("era", "time"), ("alternate", "s")])
def test_both_first_cells_give_the_poles_of_the_five_structures_and_rebuild_their_responses(name, cell):
    structure = FIVE[name]()
    truth = structure.state_space().continuous_poles
    method, domain = cell
    if domain == "time":
        data = structure.impulse_response(400)
    else:
        data = structure.frequency_response(np.linspace(0.3, 8, 160), quantity="acceleration")
    found = ms.identify(data, method=method, domain=domain, order=truth.size)
    poles = np.concatenate([found.modes.poles, found.modes.poles.conj()])
    worst = max(np.min(np.abs(poles - s)) / abs(s) for s in truth)
    d = found.singular_values
    # rounding in the data reaches the poles through the weakest singular value
    assert worst < max(1e-10, 100 * np.finfo(float).eps * d[0] / d[truth.size - 1])
    assert found.fit_error < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["acceleration", "displacement"])
def test_select_finds_the_five_storeys_and_nothing_else_for_every_seed(quantity):
    building = ms.systems.spring_chain()
    truth = building.modes()
    clean = building.frequency_response(np.linspace(0.1, 10, 400), inputs=[0, 4], quantity=quantity)
    for seed in range(2):
        modes = ms.select(ms.stabilize(add_noise(clean, 40, np.random.default_rng(seed))))
        assert len(modes) == 5
        # 40 dB on 400 lines: a standard deviation of a few 1e-5 in frequency, a few 1e-3 in damping (relative)
        assert np.max(np.abs(modes.frequencies / truth.frequencies - 1)) < 1e-3
        assert np.max(np.abs(modes.damping_ratios / truth.damping_ratios - 1)) < 0.1


@pytest.mark.slow
def test_the_same_data_give_the_same_modes():
    data = add_noise(ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 160)), 40, np.random.default_rng(1))
    first, second = (ms.select(ms.stabilize(data)) for _ in range(2))
    assert np.array_equal(first.poles, second.poles)
    assert np.array_equal(first.shapes, second.shapes)


@pytest.mark.slow
@pytest.mark.parametrize("name", FIVE)
def test_impulse_responses_with_noise_give_the_right_number_of_modes(name):
    structure = FIVE[name]()
    oscillations = int(np.sum(structure.state_space().continuous_poles.imag > 0))
    data = add_noise(structure.impulse_response(400), 40, np.random.default_rng(0))
    assert len(ms.select(ms.stabilize(data))) == oscillations


def test_noise_alone_has_no_modes():
    rng = np.random.default_rng(0)
    values = rng.standard_normal((300, 3, 1)) + 1j * rng.standard_normal((300, 3, 1))
    frf = ms.FrequencyResponse(values=values, frequencies=np.linspace(1, 50, 300), quantity="acceleration")
    assert len(ms.select(ms.stabilize(frf))) == 0


@pytest.mark.slow
def test_of_the_close_pairs_of_a_measured_aircraft_one_is_two_modes_and_the_other_is_told():
    with np.load(measured("hati_gvt", "hati_ws3_frf.npz")) as file:
        data = ms.FrequencyResponse(values=file["H"][:, :, None], frequencies=file["freq"], quantity="acceleration")
    modes = ms.select(ms.stabilize(data, band=(3, 36)))
    for f in (9.175, 9.471):
        assert np.sum(np.abs(modes.frequencies / f - 1) < 0.003) == 1
    # Independent programs find 18.91 and 19.12 Hz; each of the ten roving runs alone shows one mode, at 18.91 to 19.17 Hz. One mode that
    # shifts by .35 % explains as much as two: it is said, and both are had by name.
    near = [c for c in modes.left_out if abs(c.frequency / 19.0 - 1) < 0.01]
    assert np.sum(np.abs(modes.frequencies / 19.0 - 1) < 0.01) == 2 or any(
        "one mode that shifts" in c.reason for c in near
    )
    both = ms.select(ms.stabilize(data, band=(3, 36)), take=[18.91, 19.12], tolerance=0.004).frequencies
    for f in (18.91, 19.12):
        assert np.min(np.abs(both / f - 1)) < 0.003
