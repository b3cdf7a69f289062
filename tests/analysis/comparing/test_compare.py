from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from modalscope import systems
from modalscope.analysis.comparing import CAUSES, Comparison, compare, run
from modalscope.analysis.comparing.agreement import pair
from modalscope.analysis.comparing.identities import check_identities
from modalscope.analysis.comparing.kinship import SAME, kinship, pole_distance, subspace_angle
from modalscope.analysis.comparing.routes import plan
from modalscope.analysis.comparing.run import MethodResult, find_by_name
from modalscope.data import DataError, FrequencyResponse, ImpulseResponse
from modalscope.identification.diagrams import stabilize
from modalscope.identification.matrices.hankel import Hankel
from modalscope.identification.method_names import cell_label, methods
from modalscope.identification.pipeline import factored
from modalscope.identification.stabilize import swept
from modalscope.selection.judging.select import select
from modalscope.selection.likelihood import deviations
from modalscope.selection.likelihood.deviations import deviations_of
from modalscope.signals.preprocess import estimate_correlation

#: 40 dB.
NOISE = 0.01

#: Identities hold to 100 eps sigma_1 / sigma_n; at 40 dB the last kept singular value is at most 1e4 times smaller.
IDENTITY = 1e-9

ORDERS, FEW = range(4, 21, 2), range(4, 15, 2)


def chain(seed: int = 0, **changes: object) -> ImpulseResponse:
    return systems.chain5().impulse_response(300, noise=NOISE, seed=seed, **changes)  # type: ignore[arg-type]


def chain_lines(seed: int = 0) -> FrequencyResponse:
    lines = np.arange(15, 376) * 0.02  # multiples of their spacing, so that the time rows can take them
    return systems.chain5().frequency_response(lines, quantity="acceleration", noise=NOISE, seed=seed)


def coarse_lines() -> FrequencyResponse:
    lines = chain_lines()
    return FrequencyResponse(values=lines.values[::4], frequencies=lines.frequencies[::4], quantity="acceleration")


@pytest.fixture(scope="module")
def clean() -> Comparison:
    return compare(chain(), orders=ORDERS, workers=1)


@pytest.fixture(scope="module")
def lines() -> Comparison:
    return compare(chain_lines(), ["era", "least_squares", "alternate/s", "lscf"], orders=ORDERS, workers=1)


@pytest.mark.slow
def test_every_mode_of_a_known_structure_is_found_and_trusted_within_its_stated_scatter(clean: Comparison) -> None:
    truth = systems.chain5().modes()
    assert len(clean.modes) == 5
    assert all(t.trusted for t in clean.trust)
    # 95 % lie within it; of ten values 99 % within 1.7 of it
    assert np.all(np.abs(clean.modes.frequencies - truth.frequencies) < 1.7 * clean.scatter.frequency)
    assert np.all(np.abs(clean.modes.damping_ratios - truth.damping_ratios) < 1.7 * clean.scatter.damping)
    assert clean.fit_error == pytest.approx(NOISE, rel=0.1)  # what is left is the noise
    assert not clean.findings


def test_intervals_of_the_consensus_are_the_stated_scatter(clean: Comparison) -> None:
    ends = clean.modes.interval()["frequency"]
    np.testing.assert_allclose(np.ptp(ends, axis=1) / 2, clean.scatter.frequency, rtol=1e-3)


def test_every_cell_that_samples_allow_is_a_row_and_the_others_are_noted(clean: Comparison) -> None:
    assert {r.method.domain for r in clean.results} == {"time", "z"}
    assert any(
        "era (s), polyreference (s), alternate (s), least_squares (s) left out" in str(note) for note in clean.notes
    )
    assert all(r.seconds > 0 and r.fit_error is not None for r in clean.results if not r.failure)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_rows_of_one_data_matrix_factor_it_once_and_find_what_each_finds_alone(
    workers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, diagrams = [], []
    monkeypatch.setattr(run, "factored", lambda *given: made.append(given) or factored(*given))
    monkeypatch.setattr(run, "swept", lambda *given, **how: diagrams.append(given) or swept(*given, **how))
    cells, data = ["era/z", "least_squares/z", "alternate/z", "polyreference/z", "era/s"], coarse_lines()
    together = compare(data, cells, orders=FEW, workers=workers)
    # ERA and least squares of lines have one and the same modes, and ERA and the alternate method two factorizations of one matrix
    assert (len(made), len(diagrams)) == (4, 4)
    matrices = {id(given[2].matrix): given[2].settings["block_rows"] for given in made}
    assert len(matrices) == 3
    assert len(set(matrices.values())) == 2
    for result, cell in zip(together.results, cells, strict=True):
        name, domain = cell.split("/")
        sizes = {"block_rows": result.diagram.settings["block_rows"]} if name == "polyreference" else {}
        alone = stabilize(data, method=name, domain=domain, orders=FEW, **sizes)
        assert (result.method.name, result.diagram.method) == (name, name)
        assert np.allclose(result.diagram.poles, alone.poles, rtol=1e-10, atol=0)
        assert np.allclose(result.diagram.frequencies_std, alone.frequencies_std, rtol=1e-6, atol=0, equal_nan=True)
        if name == "least_squares":
            assert [str(note) for note in result.diagram.notes] == [str(note) for note in alone.notes]
            assert np.allclose(result.modes.poles, select(alone).poles, rtol=1e-10, atol=0)


def test_rows_of_the_same_poles_have_deviations_in_common_and_shapes_of_their_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked, between = [], []
    projected = Hankel.projected
    monkeypatch.setattr(Hankel, "projected", lambda *given: between.append(given) or projected(*given))
    monkeypatch.setattr(
        deviations,
        "deviations_of",
        lambda *given: asked.extend((one.order, k) for one in given[2:] for k in one.which) or deviations_of(*given),
    )
    monkeypatch.setattr(
        "modalscope.analysis.comparing.comparison.analysis_of", lambda *given: (None, "")
    )  # asks the same again
    era, least_squares = compare(chain(), ["era/time", "least_squares/time"], orders=ORDERS, workers=1).results
    assert sorted(set(asked)) == sorted(asked)
    assert [factors.d.size for _, factors in between].count(ORDERS[-1]) == 1  # identities have theirs
    alone = compare(chain(), ["least_squares/time"], orders=ORDERS, workers=1).results[0]
    assert np.array_equal(least_squares.diagram.shapes, alone.diagram.shapes)
    assert not np.allclose(least_squares.diagram.shapes, era.diagram.shapes, rtol=1e-6)
    for name in ("frequencies_std", "damping_ratios_std"):
        assert np.allclose(getattr(least_squares.diagram, name), getattr(alone.diagram, name), rtol=1e-6)


def test_methods_that_are_the_same_have_distance_zero_and_one_vote(clean: Comparison) -> None:
    kin = clean.kinship
    a, b = kin.names.index("era (time)"), kin.names.index("least_squares (time)")
    assert kin.distances[a, b] < SAME
    # coordinates are roots of eigenvalues: rounding of 1e-12 in distances becomes 1e-6
    assert kin.places[a] == pytest.approx(kin.places[b], abs=1e-4)
    assert kin.class_of("era (time)") == kin.class_of("least_squares (time)")
    assert clean.groups[0].voters == len(kin.classes)
    assert kin.distances.max() < 1  # all found the structure


@pytest.mark.slow
def test_identities_hold_on_noisy_samples_and_lines(clean: Comparison, lines: Comparison) -> None:
    assert len(clean.identities) >= 5
    for identity in (*clean.identities, *lines.identities):
        assert identity.residual < IDENTITY, identity.name


def test_an_identity_that_cannot_be_checked_says_why() -> None:
    short = ImpulseResponse(values=chain().values[:4], sampling_rate=20.0)
    found = check_identities(short, 2)
    assert all(i.residual < IDENTITY or i.note for i in found)


def test_transformed_data_are_compared_but_have_no_vote(lines: Comparison) -> None:
    assert {r.exact for r in lines.results if r.method.domain == "time"} == {False}
    assert all(not name.endswith("(time)") for g in lines.groups for name in g.votes)
    assert "era (time)" in lines.groups[0].members
    truth = systems.chain5().modes()
    assert np.all(np.abs(lines.modes.frequencies - truth.frequencies) < 1.7 * lines.scatter.frequency)


def test_a_biased_method_is_named_as_the_witness_of_its_bias(lines: Comparison) -> None:
    """LSCF's normal equations have noise on both sides, and its damping is biased; the others differ by what the noise explains."""
    biased = {name for each in lines.scatter.biased for name in each}
    assert biased == {"lscf (z)"}
    said = [cause for d in lines.disagreements for cause in d.causes if cause.name == "bias"]
    assert said
    assert all("by PolyMAX (lscf, z) is" in cause.evidence for cause in said)
    assert "deviations of the difference" in next(d.what for d in lines.disagreements if d.mode is not None)


def test_a_certificate_is_made_when_asked_and_what_it_refutes_is_not_trusted() -> None:
    loud = systems.chain5().impulse_response(300, noise=0.1, seed=0)
    c = compare(loud, ["era/time", "alternate/time"], orders=FEW, workers=1, replicates=6)
    assert c.certified is not None
    index = {g.members[c.certified.method]: k for k, g in enumerate(c.groups) if c.certified.method in g.members}
    assert not c.certified.certificate.holds.all()
    for j, holds in enumerate(c.certified.certificate.holds):
        assert holds or not c.trust[index[j]].trusted


def test_a_method_that_fails_is_a_row_that_says_why_and_stops_no_other() -> None:
    c = compare(chain(), ["era", "era/s", "alternate/time"], orders=ORDERS, workers=1)
    failed = c["era (s)"]
    assert failed.modes is None
    assert "no rational transform" in failed.failure
    assert len(c["alternate (time)"].modes or ()) == 5
    assert "failed" in c.table()
    assert f"1 of 4 methods failed: {failed.label}" in c.verdict


def test_no_method_at_all_gives_a_verdict_and_no_modes() -> None:
    c = compare(chain(), ["era/s"], orders=ORDERS)
    assert not len(c.modes)
    assert c.verdict.startswith("No method could use these data.")
    assert c.table()


def test_progress_counts_to_the_end_whatever_fails() -> None:
    seen: list[tuple[int, int]] = []
    compare(
        chain(),
        ["era/time", "era/s"],
        orders=ORDERS,
        workers=1,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert seen[-1] == (2 * len(ORDERS), 2 * len(ORDERS))
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


def test_the_same_whatever_the_number_of_workers() -> None:
    one, two = (compare(chain(), ["era/time", "alternate"], orders=FEW, workers=n) for n in (1, 2))
    assert np.array_equal(one.modes.poles, two.modes.poles)
    assert one.verdict == two.verdict


def test_a_comparison_is_copied_and_pickled(clean: Comparison) -> None:
    for again in (copy.deepcopy(clean), pickle.loads(pickle.dumps(clean))):
        np.testing.assert_array_equal(again.modes.frequencies, clean.modes.frequencies)
        assert again.table() == clean.table()


def test_the_table_holds_modes_methods_and_verdict(clean: Comparison) -> None:
    text = clean.table()
    for r in clean.results:
        assert r.label in text
    assert f"{clean.modes.frequencies[0]:.4f}" in text
    first, consensus, verdict, methods, *each = text.split("\n\n")
    assert verdict == clean.verdict  # where it is read first, not below the widest table
    assert methods.startswith("Methods")
    assert [f"mode {k + 1}" in table for table in each for k in range(len(clean.groups))].count(True) == len(
        clean.groups
    )
    assert max(map(len, "\n".join(each).splitlines())) <= 140
    assert clean.table(each=False) == f"{first}\n\n{consensus}\n\n{verdict}\n\n{methods}"


def test_named_methods_cells_and_pairs_are_understood() -> None:
    response = chain()
    cells, _ = plan(response, ["era", ("alternate", "time"), "prce/time"], [2, 4])
    assert [str(c.method) for c in cells] == ["era (time)", "era (z)", "alternate (time)", "prce (time)"]
    with pytest.raises(DataError, match="Did you mean 'era'"):
        plan(response, ["eraa"], None)
    with pytest.raises(DataError, match="no method was named"):
        plan(response, [], None)
    with pytest.raises(DataError, match="order needs a whole number of at least 1"):
        plan(response, "all", [0, 2])


def test_uneven_lines_leave_the_time_domain_out_with_a_note() -> None:
    r = chain_lines()
    uneven = r.at_lines(np.r_[0:300, 301 : r.lines])
    cells, notes = plan(uneven, "all", None)
    assert all(c.method.domain != "time" for c in cells)
    assert any("era (time), polyreference (time)" in str(note) and "left out" in str(note) for note in notes)


def test_pole_sets_are_compared_by_half_bandwidths_and_shares() -> None:
    s = np.array([-1 + 50j, -1 + 90j])
    w = np.array([3.0, 1.0])
    assert pole_distance((s, w), (s, w)) == 0
    assert pole_distance((s, w), (s[::-1], w[::-1])) == 0
    assert pole_distance((s, w), (s + 0.5, w)) == pytest.approx(0.5)  # half of a half bandwidth of at most 1
    assert pole_distance((s, w), (s[:1], w[:1])) == pytest.approx(1 - (0.75 + 1) / 2)  # the second stands alone


def test_subspaces_of_the_same_modes_make_no_angle_whatever_their_scaling() -> None:
    modes = systems.chain5().modes()
    turned = replace(modes, shapes=modes.shapes * np.exp(1j * np.arange(5)))
    assert subspace_angle(modes, turned) < 1e-4  # the arc cosine of 1 - eps is 1e-6 degrees
    assert subspace_angle(modes.take([0]), modes.take([4])) > 45
    assert subspace_angle(modes, modes.take([])) == 90


def test_modes_are_paired_by_shape_where_frequencies_cannot_tell() -> None:
    response = systems.close4().impulse_response(400, noise=NOISE, seed=3)
    c = compare(response, ["era/time", "prce/time"], orders=range(8, 17, 2), workers=1)
    assert len(c.modes) == 4
    for g in c.groups:
        assert min(g.mac.values()) > 0.95  # shapes of a pair are orthogonal: a wrong pairing would give 0
    confirmed, unconfirmed = pair(c.results, kinship(c.results))
    assert [g.frequency for g in confirmed] == [g.frequency for g in c.groups]
    assert not unconfirmed


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("era (time)", "era (time)"),
        ("ERA/z", "era (z)"),
        ("ERA-FD", "era (z)"),
        (("era", "time"), "era (time)"),
        ("ssi-cov", "alternate (time)"),
        ("SSI_COV", "alternate (time)"),
        ("alternate", "alternate (time)"),
        ("Kung", "alternate (time)"),
        ("polymax", "lscf (z)"),
        ("p-LSCF", "lscf (z)"),
    ],
)
def test_a_result_is_found_by_any_name_of_its_method(name: str, wanted: str) -> None:
    table = {str(m): MethodResult(method=m, exact=True) for m in methods()}
    kept = [table[n] for n in ("era (time)", "era (z)", "alternate (time)", "lscf (z)")]
    assert find_by_name(kept, name) is table[wanted]


def test_a_result_that_is_not_there_is_an_error_that_names_the_nearest(clean: Comparison) -> None:
    with pytest.raises(DataError, match=r"'nonsense': there are era \(time\), "):
        clean["nonsense"]
    with pytest.raises(DataError, match=r"Did you mean 'polyreference \(time\)'"):
        clean["polyrefrence/time"]
    with pytest.raises(DataError, match=r"'era': that is era \(time\) and era \(z\)"):
        clean["era"]


def test_labels_tell_every_cell_of_the_table_apart() -> None:
    labels = [m.label for m in methods()]
    assert len(set(labels)) == len(labels)
    assert {"ERA", "SSI-cov (alternate)", "PRCE"} <= set(labels)
    assert cell_label("era", "time") == "ERA"
    assert cell_label("of another program", "z") == "of another program (z)"


def test_a_consensus_that_explains_too_little_says_so_first() -> None:
    """Two states hold one of five modes of ambient vibration, where nothing is looked for in what is left."""
    record = systems.chain5().simulate(inputs="ambient", samples=20000, sampling_rate=20.0, seed=0)
    c = compare(estimate_correlation(record), ["era/time", "alternate/time"], orders=[2], workers=1)
    assert c.fit_error > 0.6
    assert "% of the response is unexplained" in c.verdict.splitlines()[0]
    assert "TOO MUCH UNEXPLAINED" in c.table()


def test_every_cause_has_a_remedy() -> None:
    assert all(text.endswith(".") for text in CAUSES.values())


@pytest.mark.slow
def test_all_sets_shows_rows_without_a_vote_which_decide_nothing_and_results_come_one_by_one() -> None:
    response = systems.chain5().frequency_response(np.linspace(0.1, 9, 120), noise=0.01, seed=0)
    orders, came = range(4, 17, 6), []
    usual = compare(response, orders=orders)
    every = compare(response, orders=orders, all_sets=True, partial=came.append)
    aside = [result for result in every.results if not result.method.votes]
    assert {result.method.name for result in aside} == {"loewner", "aaa", "vector-fitting"}
    assert not any(result.exact for result in aside)
    assert any(result.method.votes for result in usual.results)
    assert [trust.why for trust in every.trust] == [trust.why for trust in usual.trust]
    assert np.array_equal(every.modes.frequencies, usual.modes.frequencies)
    assert any("Shown without a vote" in str(note) and "loewner (s)" in str(note) for note in every.notes)
    assert sorted(result.name for result in came) == sorted(result.name for result in every.results)
    assert {result.name: len(result.modes or ()) for result in came} == {
        result.name: len(result.modes or ()) for result in every.results
    }


def test_where_no_thread_can_be_started_cells_come_one_after_the_other(monkeypatch):
    """As in a sandbox, or on a machine that is full."""

    def full(*_):
        raise RuntimeError("can't start new thread")

    before = compare(chain(), ["era/time", "least_squares/time"], orders=FEW, workers=2)
    monkeypatch.setattr("threading.Thread.start", full)
    found = compare(chain(), ["era/time", "least_squares/time"], orders=FEW, workers=2)
    for one, other in zip(before.results, found.results, strict=True):
        assert np.array_equal(one.modes.poles, other.modes.poles)
