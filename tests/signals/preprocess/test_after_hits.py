"""What follows hits: free decays with the poles of the structure, whatever is cut off, and how much of it is."""

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.records import Records, Signals, as_records
from modalscope.identification.routes import chosen_route, usual_route
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess import after_hits
from modalscope.signals.preprocess.after_hits import decays_after_hits, remaining
from modalscope.signals.preprocess.impacts import between_hits, find_hits

RATE, PULSE = 100.0, np.array([0.5, 1.0, 0.5])
POLES = 2 * np.pi * np.array([6.0, 11.0]) * (-0.01 + 1j * np.sqrt(1 - 1e-4))
SHAPES = np.array([[1.0, 0.6], [0.4, -1.0], [0.8, 0.3]])


def struck(
    starts: list[int], samples: int, noise: float = 0.0, of_force: float = 0.0, runs: int = 1, places: int = 1
) -> Signals:
    """Hits on two modes in one record or in runs, sampled exactly: y(t) = sum over pulses of 2 Re(phi l exp(s t))."""
    rng = np.random.default_rng(len(starts) + runs)
    u = np.zeros((runs, samples, 1))
    for start in starts:
        u[:, start : start + 3, 0] += PULSE * rng.uniform(1, 2, (runs, 1))
    h = 2 * np.real(np.exp(POLES / RATE * np.arange(samples)[:, None]) @ (SHAPES * [1.0, 0.7]).T.astype(complex) / 1j)
    y = np.stack([[np.convolve(f[:, 0], column)[:samples] for column in h.T] for f in u]).transpose(0, 2, 1)
    y += noise * y.std() * rng.standard_normal(y.shape)
    u += of_force * u.max() * rng.standard_normal(u.shape)
    return Signals(outputs=y, inputs=np.repeat(u, places, axis=2), sampling_rate=RATE, quantities="acceleration")


def basis(samples: int) -> np.ndarray:
    powers = np.exp(POLES / RATE * np.arange(samples)[:, None])
    return np.hstack([powers, powers.conj()])


@pytest.mark.parametrize("of_force", [0.0, 0.005])
def test_what_follows_cut_off_hits_is_the_poles_alone(of_force: float) -> None:
    """One record whose hits follow each other long before the vibration has ended, and noise of the force is none."""
    test = struck([20, 140, 260], 380, of_force=of_force)
    response, band, notes = decays_after_hits(as_records(test), None)
    assert band is not None
    assert band[1] > 35  # what three samples strike
    assert response.kind == "free decay"
    assert response.input_dofs == ("hit 1", "hit 2", "hit 3")
    assert 90 < response.samples <= 117
    assert f"3 free decays after hits, {response.samples} samples each, without scale" in str(notes[-1])
    E = basis(response.samples)
    for k in range(3):
        y = response.values[:, :, k]
        # the median of a run is no part of them: a constant beside the poles
        left = (
            y - np.hstack([E, np.ones((len(E), 1))]) @ np.linalg.lstsq(np.hstack([E, np.ones((len(E), 1))]), y, None)[0]
        )
        assert np.linalg.norm(left) < 1e-9 * np.linalg.norm(y)


def test_the_longest_series_of_decays_is_taken_over_runs_of_their_own_lengths() -> None:
    parts = [struck([20], n, runs=1) for n in (400, 380, 150)]
    records = Records(runs=tuple(part for part in parts))
    response = decays_after_hits(records, None)[0]
    assert response.values.shape[2] == 2
    assert 320 < response.samples < 360


def test_filters_that_ring_take_a_twentieth_of_a_short_decay_and_twenty_samples_of_a_long_one() -> None:
    quiet = {}
    for samples in (150, 1000):
        test = struck([20], samples)
        forces = np.asarray(test.by_run()[1])[:, :, 0]
        first = 20 + int(np.flatnonzero(between_hits(forces, find_hits(forces), 0.01)[0, 20:])[0])
        quiet[samples] = samples - first
        found = decays_after_hits(as_records(test), None)[0].samples
        assert found == quiet[samples] - min(20, int(quiet[samples] / 20))


def test_a_force_below_a_hundredth_of_the_largest_has_ended() -> None:
    force = np.zeros((1, 100))
    force[0, 20:23] = PULSE
    for size, ended in ((0.0101, False), (0.0099, True)):
        force[0, 60] = size
        assert bool(between_hits(force, find_hits(force), 0.01)[0, 60]) is ended
        assert not between_hits(force, find_hits(force))[0, 60]


def test_hits_that_are_cut_off_are_identified_by_their_decays_with_nothing_set() -> None:
    test = struck([20, 140, 260], 380, noise=0.01, of_force=0.005)
    found = ms.analyze(test)
    assert found.diagrams[0].settings.route == "decays"
    truth = np.abs(POLES) / 2 / np.pi
    assert found.modes.frequencies == pytest.approx(truth, rel=1e-3)
    assert found.modes.damping_ratios == pytest.approx([0.01, 0.01], rel=0.05)
    assert [mode.grade for mode in found.modes] == ["good", "good"]
    assert not any("leakage" in str(note) for note in found.notes)
    again = ms.identify(test, route="decays", order=4).modes
    assert again.frequencies == pytest.approx(truth, rel=1e-3)


def test_averages_are_usual_until_three_of_four_outputs_are_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    test = as_records(struck([20], 300, runs=3))
    for left, usual in (((0.0, 0.051, 0.051, 0.2, 0.3), "decays"), ((0.0, 0.049, 0.051, 0.2, 0.3), "frf")):
        monkeypatch.setattr(after_hits, "remaining", lambda *_, left=left: (np.array(left), 300))
        assert usual_route(test) == usual


def test_what_is_left_falls_as_runs_grow_longer() -> None:
    """By exp(-zeta omega t) of the slowest mode; a settled decay has nothing left."""
    left = [remaining(struck([20], n, runs=3), "impact")[0] for n in (200, 300, 600)]
    slowest = -POLES.real.max() / RATE
    assert np.all(np.diff(left, axis=0) < 0)
    assert left[1].max() / left[0].max() == pytest.approx(np.exp(-100 * slowest), rel=0.3)
    settled = remaining(struck([20], 4000, runs=3, noise=0.01), "impact")[0]
    assert np.all(settled == 0)


def test_another_method_keeps_its_own_route() -> None:
    test = as_records(struck([20, 140, 260], 380))
    assert usual_route(test) == "decays"
    assert chosen_route(test, "lscf", None, "auto") == "frf"
    assert chosen_route(test, "era", "time", "auto") == "markov"
    assert chosen_route(test, "era", None, "decays") == "decays"
    with pytest.raises(DataError, match="route='decays'"):
        ms.identify(test, method="lscf", route="decays", order=4)


def test_other_forces_have_no_decays() -> None:
    rng = np.random.default_rng(0)
    shaken = as_records(
        Signals(outputs=rng.standard_normal((500, 2)), inputs=rng.standard_normal((500, 1)), sampling_rate=1.0)
    )
    with pytest.raises(DataError, match="needs one force, of a hammer: the test is of kind 'shaker', with inputs u1"):
        decays_after_hits(shaken, None)
    with pytest.raises(DataError, match="with inputs u1, u2"):
        decays_after_hits(as_records(struck([20], 300, places=2)), None)


def test_methods_are_compared_with_decays_in_place_of_an_observer() -> None:
    compared = ms.compare(struck([20, 140, 260], 380, noise=0.01), methods=["era", "lscf", "alternate"])
    routes = {result.route for result in compared.results}
    assert "decays" in routes
    assert "markov" not in routes
    assert len(compared.modes) == 2
