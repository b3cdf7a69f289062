"""Pictures of a comparison have a mark for every value, and name every method."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.plot.methods import deviations_picture, map_picture
from modalscope.interfaces.plot.picture import Areas, Marks, Words
from modalscope.systems import chain5


@pytest.fixture(scope="module")
def comparison() -> ms.Comparison:
    lines = 0.025 * np.arange(
        12, 301
    )  # multiples of their spacing: they have an inverse transform, whose methods have no vote
    data = chain5().frequency_response(lines, noise=0.03, seed=1)
    return ms.compare(data, ["era/z", "alternate/s", "lscf/z", "era/time"], orders=range(6, 15, 4))


def test_every_value_of_a_method_has_a_mark(comparison: ms.Comparison) -> None:
    panels = deviations_picture(comparison).panels
    assert [panel.title for panel in panels] == ["Frequency", "Damping"]
    told = [k for k, trust in enumerate(comparison.trust) if trust.grade != "doubtful"]
    for panel in panels:
        marks = [item for item in panel.items if isinstance(item, Marks)]
        for domain in ("z", "s", "time"):
            methods = [r.name for r in comparison.results if r.modes is not None and r.method.domain == domain]
            values = sum(name in comparison.groups[k].frequencies for k in told for name in methods)
            assert sum(len(m.x) for m in marks if m.words == f"domain {domain}") >= values
        (band,) = [item for item in panel.items if isinstance(item, Areas)]
        assert len(band.corners) == len(comparison.groups)
        # transformed data have no vote
        assert sum(m.hollow for m in marks) == sum(r.modes is not None and not r.exact for r in comparison.results)
        assert any(m.hollow for m in marks)


def test_a_doubtful_mode_does_not_set_the_scale(comparison: ms.Comparison) -> None:
    groups = comparison.groups
    far = replace(groups[0], damping_ratios=dict.fromkeys(groups[0].damping_ratios, 9.0))
    trust = (replace(comparison.trust[0], grade="doubtful"), *comparison.trust[1:])
    assert all(each.grade != "doubtful" for each in trust[1:])
    spoilt = replace(comparison, groups=(far, *groups[1:]), trust=trust)
    as_it_was = replace(comparison, trust=trust)
    ends = [[(panel.y.low, panel.y.high) for panel in deviations_picture(c).panels] for c in (spoilt, as_it_was)]
    assert ends[0] == ends[1]


def test_the_map_names_every_method(comparison: ms.Comparison) -> None:
    kin = comparison.kinship
    items = map_picture(kin).panels[0].items
    assert sum(len(item.x) for item in items if isinstance(item, Marks)) == len(kin.names)
    (words,) = [item for item in items if isinstance(item, Words)]
    assert sorted(name for text in words.texts for name in text.split(" = ")) == sorted(kin.labels)


def test_a_report_on_a_comparison_draws_without_pictures_as_data(comparison: ms.Comparison, tmp_path: Path) -> None:
    path = ms.report(comparison, tmp_path / "c.html")
    page = path.read_text(encoding="utf-8")
    assert "<img" not in page
    assert page.count('<svg class="chart"') >= 4
    assert path.stat().st_size < 400_000
