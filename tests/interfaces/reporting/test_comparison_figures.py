"""Pictures of a comparison and of intervals are static SVG, with a mark for every value and each interval on an axis of its own."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.reporting.comparison_figures import deviations_svg, method_distances_svg, method_map_svg
from modalscope.interfaces.reporting.figures import intervals_svg
from modalscope.systems import chain5


@pytest.fixture(scope="module")
def comparison() -> ms.Comparison:
    lines = 0.025 * np.arange(
        12, 301
    )  # multiples of their spacing: they have an inverse transform, whose methods have no vote
    data = chain5().frequency_response(lines, noise=0.03, seed=1)
    return ms.compare(data, ["era/z", "alternate/s", "lscf/z", "era/time"], orders=range(6, 15, 4))


def test_every_value_of_a_method_has_a_mark(comparison: ms.Comparison) -> None:
    drawn = deviations_svg(comparison, "deviations")
    told = [k for k, trust in enumerate(comparison.trust) if trust.grade != "doubtful"]
    for domain, style in (("z", "d-z"), ("s", "d-s"), ("time", "d-time")):
        methods = [r.name for r in comparison.results if r.modes is not None and r.method.domain == domain]
        values = sum(name in comparison.groups[k].frequencies for k in told for name in methods)
        paths = re.findall(rf'<path class="{style}(?: open)?" d="([^"]*)"', drawn)
        assert sum(path.count("M") for path in paths) >= 2 * values + 1  # in both panels, and in the key
    assert drawn.count('class="band"') == 2 * len(comparison.groups)
    voteless = [r.name for r in comparison.results if r.modes is not None and not r.exact]
    seen = any(name in group.frequencies for group in comparison.groups for name in voteless)
    assert seen
    assert ' open" d="M' in drawn


def test_a_doubtful_mode_does_not_set_the_scale(comparison: ms.Comparison) -> None:
    groups = comparison.groups
    far = replace(groups[0], damping_ratios=dict.fromkeys(groups[0].damping_ratios, 9.0))
    trust = (replace(comparison.trust[0], grade="doubtful"), *comparison.trust[1:])
    assert all(each.grade != "doubtful" for each in trust[1:])
    spoilt = replace(comparison, groups=(far, *groups[1:]), trust=trust)
    as_it_was = replace(comparison, trust=trust)
    ticks = [re.findall(r'text-anchor="end">(-?[\d.]+)<', deviations_svg(c, "deviations")) for c in (spoilt, as_it_was)]
    assert ticks[0] == ticks[1]


def test_map_and_distances_name_every_method(comparison: ms.Comparison) -> None:
    kin = comparison.kinship
    circles = re.findall(r'class="d-\w+(?: hollow)?" d="M\d+ \d+m-', method_map_svg(kin, "map"))
    assert len(circles) == len(kin.names) + 3  # and the key
    drawn = method_distances_svg(kin, "distances")
    assert drawn.count("<rect") == len(kin.names) ** 2
    assert all(drawn.count(f">{label}<") == 2 for label in kin.labels)


def test_a_report_on_a_comparison_draws_without_pictures_as_data(comparison: ms.Comparison, tmp_path: Path) -> None:
    path = ms.report(comparison, tmp_path / "c.html")
    page = path.read_text(encoding="utf-8")
    assert "<img" not in page
    assert page.count('<svg class="chart"') >= 4
    assert path.stat().st_size < 400_000


def test_each_interval_has_its_own_axis_with_its_ends() -> None:
    data = chain5().frequency_response(np.linspace(0.3, 7.5, 300), noise=0.01, seed=1)
    modes = ms.analyze(data, orders=range(8, 15, 2)).modes
    assert modes.frequencies_std is not None
    wide = replace(
        modes, frequencies_std=modes.frequencies_std * np.array([1000.0, *[1.0] * (len(modes) - 1)]), unrefined=None
    )
    drawn = intervals_svg(wide, "frequency", "intervals")
    bars = re.findall(r'class="line c-1" d="M(\d+) \d+v80M\d+ \d+H(\d+)', drawn)
    widths = [int(high) - int(low) for low, high in bars]
    assert len(widths) == len(modes)
    assert np.ptp(widths) <= 2  # a wide interval does not make the others invisible
    ends = wide.interval(0.95)["frequency"]
    texts = [float(text) for text in re.findall(r">(\d+\.\d+)<", drawn)]
    assert texts == pytest.approx(ends.ravel().tolist(), rel=1e-3)
