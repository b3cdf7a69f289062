"""Ambient records to modes with nothing set but the band: correlations, alternate method, automatic selection."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from tests.support import measured


@pytest.mark.slow
def test_the_five_storeys_are_found_in_every_ambient_record_with_the_scatter_that_theory_allows():
    building = ms.systems.spring_chain()
    truth = building.modes()
    errors = []
    for seed in range(20):
        record = building.simulate(
            inputs="ambient", samples=30001, sampling_rate=100.0, process_noise=0.1, noise=0.1, seed=seed
        )
        modes = ms.select(ms.stabilize(record, band=(0.3, 8)))
        nearest = np.argmin(np.abs(modes.frequencies[:, None] - truth.frequencies), axis=0)
        found = modes.take(nearest)
        frequency = found.frequencies / truth.frequencies - 1
        # no mode is missed: neighbours are 14 % apart at least
        assert np.max(np.abs(frequency)) < 0.02
        errors.append((frequency, found.damping_ratios / truth.damping_ratios - 1))
    f, zeta = np.sqrt(np.mean(np.square(errors), axis=0))
    # the least scatter that any method may have of n periods under white forces (Au 2014, "Uncertainty law in ambient modal
    # identification", part I): zeta / (2 pi n) of frequency and 1 / (2 pi zeta n) of damping, squared; 270 periods of the first
    # mode give .24 % and 12 %. A method that needs no model of the forces stays within twice that; the mean of twenty squares
    # is known to a factor of 1.6 at two deviations
    periods = 300.0 * truth.frequencies
    least = np.sqrt(truth.damping_ratios / (2 * np.pi * periods))
    assert np.all(f < 2 * np.sqrt(1.6) * least)
    assert np.all(zeta < 2 * np.sqrt(1.6) * least / truth.damping_ratios)


@pytest.mark.parametrize("band", [None, pytest.param((0.5, 4), marks=pytest.mark.slow)])
def test_the_published_modes_of_a_timber_building_and_nothing_below(band):
    record = ms.read(measured("palisaden", "palisaden_dec5.npz"), rename={"y": "outputs", "fs": "sampling_rate"})
    modes = ms.select(ms.stabilize(record, band=band))
    # published by stochastic subspace identification of the same record
    assert np.allclose(modes.frequencies[:3], [1.88202, 2.42170, 2.68704], rtol=0.003)
    assert np.allclose(modes.damping_ratios[:3], [0.0159, 0.0146, 0.0152], rtol=0.15)
    # the next one was not published; the spectra peak there, too: within half a half bandwidth of 2.6 %
    peaks, _ = ms.preprocess.decomposition(record, segment=4000).peaks(8)
    assert np.min(np.abs(peaks / modes.frequencies[3] - 1)) < 0.013


@pytest.mark.slow
@pytest.mark.parametrize("setup", [0, 1, 2])
def test_the_nine_modes_of_a_simulated_building_in_each_setup(setup):
    with np.load(measured("building_3sl", "tsl3.npz")) as file:
        record = ms.Signals(outputs=file["y"][setup], sampling_rate=float(file["fs"]))
    modes = ms.select(ms.stabilize(record))
    exact = [2.63186, 2.69173, 3.43042, 8.29742, 8.42882, 10.6272, 14.0053, 14.093, 17.5741]
    # the samples lie up to .6 % below the exact frequencies at the top, where the integrator stretches periods
    assert np.allclose(modes.frequencies, exact, rtol=0.01)


def test_the_modes_of_a_simulated_bridge():
    with np.load(measured("bridge_ssicov", "ssicov.npz")) as file:
        record = ms.Signals(outputs=file["y"], sampling_rate=float(file["fs"]))
    modes = ms.select(ms.stabilize(record))
    assert np.allclose(modes.frequencies, [0.2045, 0.3185, 0.4379, 0.5823, 0.8551, 1.1703], rtol=0.01)


def test_the_modes_of_a_simulated_shear_frame():
    record = ms.Signals(outputs=np.load(measured("shear_frame", "data_shearframe.npy")), sampling_rate=12.0)
    modes = ms.select(ms.stabilize(record))
    assert np.allclose(modes.frequencies, [0.1811, 0.5256, 0.8209, 1.0443, 1.1824], rtol=0.015)
