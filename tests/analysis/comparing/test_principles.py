from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modalscope import systems
from modalscope.analysis.comparing import Comparison, compare, run
from modalscope.analysis.comparing.identities import Identity
from modalscope.analysis.comparing.kinship import Kinship
from modalscope.analysis.comparing.principles import Witness, headline, principles_of, witnesses_of
from modalscope.identification.method_names import find_method
from modalscope.identification.stabilize import swept
from modalscope.numerics.executors import executor, working
from tests.analysis.comparing.made import group, result

CELLS = ("era (z)", "least_squares (z)", "era (s)", "least_squares (s)", "alternate (z)")
HELD = Identity("poles of ERA = nonzero poles of least squares", "z", "Eq. 28", 20, 2e-15, "", ("era", "least_squares"))


def kin(*classes: tuple[int, ...]) -> Kinship:
    methods = tuple(
        find_method(*(part.rstrip(")") for part in (*name.split(" ("), name.split(" (")[1]))) for name in CELLS
    )
    k = len(CELLS)
    distances = np.full((k, k), 0.25)
    for members in classes:
        distances[np.ix_(members, members)] = 3e-9
    return Kinship(CELLS, 20, distances, np.zeros((k, k)), np.zeros((k, 2)), classes, methods)


TWO_PAIRS = kin((0, 1), (2, 3), (4,))


def test_the_first_line_counts_and_names_what_is_one_and_gives_the_largest_residual() -> None:
    results = [result(name, [(10, 0.01, (1, 0))]) for name in CELLS]
    larger = Identity("dual", "z", "Eq. 17", 20, 4e-14)
    unknown = Identity("dual", "s", "Eq. 17", 20, float("nan"), "too few blocks")
    principles = principles_of(TWO_PAIRS, [HELD])
    line = headline(TWO_PAIRS, results, principles, [HELD, larger, unknown])
    assert line == "5 methods, 3 different ones: ERA = least squares in z and s; identities hold to 4e-14"
    failed = [*results, result("prce (time)", None)]
    assert (
        headline(TWO_PAIRS, failed, principles, [])
        == "5 of 6 methods, 3 different ones: ERA = least squares in z and s"
    )


def test_a_principle_says_by_what_identity_its_members_are_one_else_how_near_they_are() -> None:
    in_z, in_s, alone = principles_of(TWO_PAIRS, [HELD])
    assert (in_z.name, in_z.members) == ("ERA = least squares", ("era (z)", "least_squares (z)"))
    nearness = "poles alike within 3e-09 half bandwidths at order 20"
    assert in_z.why == f"poles of ERA = nonzero poles of least squares (Eq. 28), residual 2e-15; {nearness}"
    assert in_s.why == nearness  # the identity was checked in z only
    assert alone.why == "nearest to ERA-FD (era, z), whose poles differ by 0.25 half bandwidths at order 20"
    assert principles_of(kin((0, 1, 4), (2, 3)), [HELD])[0].why == nearness  # which the identity does not make one


def test_witnesses_are_votes_by_route_domain_and_principle() -> None:
    results = [result(name, [(10, 0.01, (1, 0))], route="records" if name == "era (s)" else "") for name in CELLS]
    found = witnesses_of([group(votes=("era (z)", "era (s)"), voters=3)], results, principles_of(TWO_PAIRS, [HELD]))
    assert found == ((Witness("", "z", "ERA = least squares"), Witness("records", "s", "ERA = least squares")),)


@pytest.fixture(scope="module")
def compared() -> Comparison:
    lines = np.arange(30, 751, 4) * 0.01
    data = systems.chain5().frequency_response(lines, quantity="acceleration", noise=0.01, seed=0)
    return compare(data, ["era/z", "least_squares/z", "alternate/z"], orders=range(8, 15, 2), workers=1)


def test_a_comparison_begins_with_what_differs_and_has_a_witness_for_each_vote(compared: Comparison) -> None:
    first = str(compared).splitlines()[0]
    assert first == compared.headline == compared.table().splitlines()[0]
    assert first.startswith("3 methods, 2 different ones: ERA = least squares in z; identities hold to ")
    assert [p.members for p in compared.principles] == [("era (z)", "least_squares (z)"), ("alternate (z)",)]
    assert compared.principles[0].why.startswith("poles of ERA = nonzero poles of truncated least squares")
    assert [len(w) for w in compared.witnesses] == [len(g.votes) for g in compared.groups] == [2] * 5
    assert repr(compared).startswith(f"<comparison of {first}; ")


def test_threads_of_a_comparison_work_where_the_caller_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folders = []
    monkeypatch.setattr(run, "swept", lambda *given, **how: folders.append(executor().folder) or swept(*given, **how))
    data = systems.chain5().impulse_response(200, noise=0.01, seed=0)
    with working(save=tmp_path):
        compare(data, ["era/time", "alternate/time"], orders=[10], workers=2)
    assert folders == [tmp_path, tmp_path]
