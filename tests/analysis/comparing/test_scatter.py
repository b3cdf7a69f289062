"""The stated scatter: what the shared noise does to the consensus, and what methods disagree by beyond it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.run import MethodResult, Moved
from modalscope.analysis.comparing.scatter import Scatter, stated
from modalscope.data import ImpulseResponse
from modalscope.identification.matrices.influence import Outer, SampleInfluence
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.covariance import PoleInfluence
from modalscope.selection.likelihood.noise import Noise, Parts, White
from modalscope.systems import chain5
from tests.analysis.comparing.made import ALTERNATE, ERA, LEAST, group, result

#: The normal quantile of 95 %.
Z = 1.959964

RNG = np.random.default_rng(0)
DATA = ImpulseResponse(values=RNG.standard_normal((4, 1, 1)), sampling_rate=50.0)
POLE = poles_from(np.array([10.0]), np.array([0.02]))

#: Gradients of the pole by four samples; the second has nothing in common with the first.
ONE = np.array([1 + 2j, 0.5, 0, 0])
TWO = np.array([0, 0, 1j, -1 + 1j])


def read(name: str, gradient: np.ndarray, noise: Noise | None = None, data: ImpulseResponse = DATA) -> MethodResult:
    """Return a method that found one mode, whose pole moves with the samples by a gradient."""
    term = Outer(np.fft.fft(gradient)[None, :, None], np.ones((1, 4, 1), complex))
    influence = PoleInfluence(SampleInfluence((term,)), np.ones(1, complex))
    known = Moved(data, noise or White(np.array([[0.01]]), "here"), influence, POLE, np.array([0]))
    return result(name, [(10, 0.02, (1, 0))], moved=known)


def by_sample(gradient: np.ndarray) -> np.ndarray:
    """Return the change of frequency and damping (2, 4) for a change of every sample, by differences."""
    ends = [POLE + sign * 1e-6 * gradient for sign in (1, -1)]
    f = (np.abs(ends[0]) - np.abs(ends[1])) / (2 * np.pi)
    zeta = -ends[0].real / np.abs(ends[0]) + ends[1].real / np.abs(ends[1])
    return np.array([f, zeta]) / 2e-6


def apart(first: float, second: float, between: float = 0.0) -> Group:
    """Return a mode whose frequency is the mean of two votes."""
    one = group((first + second) / 2, 0.02, (ERA, ALTERNATE), 2, frequency_between=between)
    return replace(one, frequencies={ERA: first, ALTERNATE: second}, members={ERA: 0, ALTERNATE: 0})


def judged(g: Group, results: Sequence[MethodResult]) -> Scatter:
    return stated([g], results)


def test_of_one_vote_it_is_what_the_noise_does_to_it() -> None:
    found = judged(group(10, 0.02, (ERA,), 1), [read(ERA, ONE)])
    expected = 0.1 * np.linalg.norm(by_sample(ONE), axis=1)
    np.testing.assert_allclose([found.frequency_noise[0], found.damping_noise[0]], expected, rtol=1e-6)
    np.testing.assert_allclose([found.frequency[0], found.damping[0]], Z * expected, rtol=1e-6)
    assert found.frequency_bias[0] == found.damping_bias[0] == 0


def test_between_two_votes_it_is_what_the_noise_does_to_their_mean() -> None:
    found = judged(group(10, 0.02, (ERA, ALTERNATE), 2), [read(ERA, ONE), read(ALTERNATE, TWO)])
    expected = 0.1 * np.linalg.norm(by_sample((ONE + TWO) / 2), axis=1)
    np.testing.assert_allclose([found.frequency_noise[0], found.damping_noise[0]], expected, rtol=1e-6)


def test_of_parts_of_a_record_it_is_their_scatter_with_students_quantile() -> None:
    parts = Parts(RNG.standard_normal((20, 4, 1, 1)), 1.0)
    found = judged(group(10, 0.02, (ERA,), 1), [read(ERA, ONE, parts)])
    moved = by_sample(ONE) @ parts.deviations[:, :, 0, 0].T
    expected = np.linalg.norm(moved, axis=1)
    np.testing.assert_allclose([found.frequency_noise[0], found.damping_noise[0]], expected, rtol=1e-6)
    assert found.frequency[0] / found.frequency_noise[0] == pytest.approx(2.093, abs=1e-3)  # 19 degrees of freedom
    assert found.degrees == 19


@pytest.mark.parametrize(("second", "far"), [(ONE, True), (0.999 * ONE, True), (TWO, False)])
def test_a_distance_is_bias_when_the_noise_that_methods_share_cannot_make_it(second: np.ndarray, far: bool) -> None:
    """Two deviations of either: between methods that read the noise alike they are much, between others nothing."""
    away = 2 * 0.1 * np.linalg.norm(by_sample(ONE)[0])
    found = judged(apart(10, 10 + away), [read(ERA, ONE), read(ALTERNATE, second)])
    assert set(found.biased[0]) == ({ERA, ALTERNATE} if far else set())
    if far:  # the consensus is the mean of both
        (bias,) = found.biased[0][ALTERNATE]
        assert (bias.kind, bias.away) == ("frequency", pytest.approx(away / 2))
    assert found.known[0] == {ERA, ALTERNATE}


def test_what_is_no_share_of_a_deviation_is_no_bias_however_sure() -> None:
    little = 0.8 * 0.1 * np.linalg.norm(by_sample(ONE)[0])
    assert not judged(apart(10, 10 + little), [read(ERA, ONE), read(ALTERNATE, ONE)]).biased[0]


def test_what_methods_scatter_by_beyond_the_noise_widens_what_is_stated() -> None:
    noise = 0.1 * np.linalg.norm(by_sample(ONE)[0])
    found = judged(apart(10, 10, between=3 * noise), [read(ERA, ONE), read(ALTERNATE, ONE)])
    assert found.frequency_bias[0] == pytest.approx(3 * noise)
    assert found.frequency[0] == pytest.approx(Z * np.sqrt(10) * noise, rel=1e-6)
    assert found.deviation("frequency")[0] == pytest.approx(np.sqrt(10) * noise, rel=1e-6)
    # votes that read nothing alike scatter by the noise: each lies half of both from their mean
    both = np.sqrt(np.sum(by_sample(ONE)[0] ** 2) + np.sum(by_sample(TWO)[0] ** 2))
    found = judged(apart(10, 10, between=0.9 * 0.05 * both), [read(ERA, ONE), read(ALTERNATE, TWO)])
    assert found.frequency_bias[0] == 0


def test_methods_on_other_data_do_not_count_and_what_is_not_known_is_said_to_be() -> None:
    other = replace(DATA, values=2 * DATA.values)
    found = judged(apart(10, 11), [read(ERA, ONE), read(ALTERNATE, TWO, data=other)])
    assert found.known[0] == {ERA}
    found = judged(apart(10, 10, between=0.1), [result(ERA), result(ALTERNATE)])
    assert found.frequency[0] == pytest.approx(Z * 0.1)
    assert np.isnan(found.frequency_noise[0])
    assert not found.biased[0]


def test_of_modes_that_are_split_where_methods_are_compared_the_reported_deviations_are_taken() -> None:
    def told(name: str, f: float, zeta: float) -> MethodResult:
        one = result(name, [(10, 0.02, (1, 0))])
        assert one.modes is not None
        std = {"frequencies_std": np.array([f]), "damping_ratios_std": np.array([zeta])}
        return replace(one, modes=replace(one.modes, **std))

    found = judged(apart(10, 10), [told(ERA, 0.1, 0.001), told(ALTERNATE, 0.1, 0.003)])
    assert found.frequency_noise[0] == pytest.approx(0.1)
    assert found.damping_noise[0] == pytest.approx(0.001 * np.sqrt(5))
    assert not found.known[0]


def test_nothing_is_stated_more_exactly_than_rounding_allows() -> None:
    found = judged(group(10, 0.02, (ERA,), 1), [result(ERA), result(LEAST)])
    assert (found.frequency[0], found.damping[0]) == (pytest.approx(1e-8), pytest.approx(2e-11))


@pytest.mark.slow
def test_methods_differ_over_many_seeds_as_the_deviation_of_their_difference_says() -> None:
    """Ten seeds, five modes: the mean square of 100 differences over deviations is 1 within 3.5 x sqrt(2 / 100), were they independent."""
    ratio = []
    for seed in range(10):
        data = chain5().impulse_response(400, noise=0.01, seed=seed)
        c = ms.compare(data, ["era/time", "polyreference/time"], orders=[8, 10, 12], workers=1)
        two = [(k, g) for k, g in enumerate(c.groups) if len(g.members) == 2]
        for kind in ("frequencies", "damping_ratios"):
            ratio += [
                (getattr(g, kind)["polyreference (time)"] - getattr(g, kind)["era (time)"]) / deviation(c, k, kind)
                for k, g in two
            ]
    assert np.mean(np.square(ratio)) == pytest.approx(1, abs=0.5)


def deviation(c: ms.Comparison, k: int, kind: str) -> float:
    """Return the deviation of the difference of two methods, from covariances of each with itself and the other."""
    from modalscope.analysis.comparing.run import covariance

    a, b = (r.moved for r in c.results)
    assert a is not None
    assert b is not None
    g = c.groups[k]
    rows = np.array([a.row[g.members["era (time)"]]]), np.array([b.row[g.members["polyreference (time)"]]])
    i = int(kind == "damping_ratios")
    own, its, both = (
        covariance(x, y, p, q, a.noise)[i][0]
        for x, y, p, q in ((a, a, rows[0], rows[0]), (b, b, rows[1], rows[1]), (a, b, *rows))
    )
    return float(np.sqrt(own + its - 2 * both))
