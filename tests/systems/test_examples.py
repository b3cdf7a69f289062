"""Structures of examples: the published truth of three masses, and a record that repeats."""

from __future__ import annotations

import numpy as np

from modalscope import systems


def test_three_masses_have_the_published_truth() -> None:
    modes = systems.three_masses().modes()
    np.testing.assert_allclose(modes.frequencies, [1.33603, 7.39083, 13.79671], atol=5e-6)
    np.testing.assert_allclose(modes.damping_ratios, [0.02, 0.075, 0.05], atol=5e-8)


def test_three_masses_record_starts_at_one_metre_per_second_and_repeats_its_noise() -> None:
    clean, noisy = systems.three_masses_record(noisy=False), systems.three_masses_record()
    np.testing.assert_array_equal(clean.values[0, :, 0], np.ones(3))
    assert (clean.samples, clean.kind, clean.quantity) == (100, "free decay", "velocity")
    np.testing.assert_array_equal(noisy.values, systems.three_masses_record().values)
    scatter = (noisy.values - clean.values).std()
    assert abs(scatter / 0.05 - 1) < 4 / np.sqrt(
        2 * 300
    )  # four standard deviations of a standard deviation of 300 numbers
