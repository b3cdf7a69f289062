from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import DataError, ModalModel, StabilizationDiagram
from modalscope.identification.options import LineOptions
from modalscope.interfaces.plot.gallery import pictures_of
from modalscope.interfaces.plot.picture import Axis
from modalscope.interfaces.plot.shapes import shape_picture
from modalscope.interfaces.plot.web.fits import lines_of_response
from modalscope.interfaces.plot.web.svg import alone, envelope, svg
from modalscope.interfaces.reporting import report, sections
from modalscope.interfaces.reporting.document import write_page
from modalscope.interfaces.reporting.html import Section
from modalscope.interfaces.reporting.modes import figures_of
from modalscope.interfaces.reporting.record import data_section, identification_script, stabilization_script
from modalscope.interfaces.reporting.sections import mode_pictures
from modalscope.selection.judging.description import described
from modalscope.systems import chain5
from tests.interfaces.plot import examples
from tests.selection.judging.ambient_records import random_structure

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Reader(HTMLParser):
    """Checks that tags close in order, and collects what a page holds."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str, str]] = []
        self.words: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def values(self, tag: str, name: str) -> list[str]:
        return [value for t, n, value in self.attributes if (t, n) == (tag, name)]


def read(path: Path) -> Reader:
    reader = Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    assert not reader.open
    return reader


def judged() -> ModalModel:
    """Return modes with everything a report may show."""
    modes = examples.modes()
    n = len(modes)
    reasons = tuple(
        {
            "orders_found": 7 - k,
            "orders_tried": 7,
            "frequency_spread_hz": 0.001,
            "fit_loss": 0.125,
            "agrees": True,
            "nearest": {"mode": 2, "mac": 0.04},
            "text": f"Found at {7 - k} of 7 orders.",
        }
        for k in range(n)
    )
    spread = np.array([1e-5, 1e-5, 1e-3, 1e-5, 1e-5])
    indicators = {"mpc": np.ones(n), "emac": np.full(n, np.nan)}
    return replace(
        modes,
        frequencies_spread=np.full(n, 0.001),
        damping_ratios_spread=spread,
        indicators=indicators,
        reasons=reasons,
    )


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "chain.html"
    return report(
        (judged(), examples.diagram()), path, source="chain.uff", command="modalscope identify chain.uff -o chain.html"
    )


@pytest.mark.slow
def test_nothing_is_asked_from_outside(written: Path) -> None:
    page = read(written)
    text = written.read_text(encoding="utf-8")
    # what the page's own scripts ask for is seen in a browser (test_browser.py)
    still = re.sub(r"<script.*?</script>|base64,[A-Za-z0-9+/=]+", "", text, flags=re.DOTALL)
    assert not re.search(r"(?:https?:)?//[\w.]", still)
    assert not {"link", "iframe", "object", "embed"} & set(page.tags)
    assert "src=" not in " ".join(re.findall(r"<script[^>]*>", text))
    assert all(value.startswith("data:image/svg+xml;base64,") for value in page.values("img", "src"))
    assert all(value.startswith("#") for value in page.values("a", "href"))
    assert "@import" not in text
    assert "url(" not in text


def test_every_picture_is_whole_described_and_asks_for_nothing(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    pictures = re.findall(r'<svg class="chart".*?</svg>', text, re.DOTALL)
    # diagram, singular values, fit errors, five shapes, MAC, four channels
    assert len(pictures) == 1 + 2 + 5 + 1 + 4
    for picture in pictures:
        tree = ElementTree.fromstring(picture)
        assert tree.attrib["aria-label"]
        assert not [k for node in tree.iter() for k in node.attrib if k.endswith(("href", "style"))]
        assert {node.tag for node in tree.iter()} <= {"svg", "path", "text", "rect", "title"}
    assert "<img" not in text


@pytest.mark.slow
def test_a_report_needs_no_matplotlib(tmp_path: Path) -> None:
    lines = (
        "import sys, modalscope as ms; from tests.interfaces.plot import examples",
        f"ms.report((examples.modes(), examples.diagram()), {str(tmp_path / 'r.html')!r})",
        "assert 'matplotlib' not in sys.modules",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines)], check=True, cwd=Path(__file__).parents[3])


def test_links_lead_to_the_sections_in_order(written: Path) -> None:
    page = read(written)
    anchors = page.values("section", "id")
    assert page.values("a", "href") == [f"#{anchor}" for anchor in anchors]
    still = [anchor for anchor in anchors if anchor != "explore"]  # there where the front end is built
    assert still[:4] == ["summary", "modes", "intervals", "stabilization"]
    assert {"shapes", "mac", "responses", "reasons", "data", "settings", "notes", "repeat"} == set(still[4:])


def test_the_verdict_counts_the_modes_tells_the_fit_and_names_the_least_sure(written: Path) -> None:
    words = " ".join(read(written).words)
    assert "5 modes between" in words
    assert re.search(r"Unexplained: [\d.]+ % of the response", words)
    assert "Least certain: mode 3" in words  # its spread was made a hundred times the others'


def test_the_table_of_modes_holds_every_value() -> None:
    modes = judged()
    body = figures_of(modes)
    cells = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in body.split("<tr>")[2:]]
    heads = re.findall(r"<th [^>]*>([^<]*)</th>", body)
    names = ("f [Hz]", "f spread", "damping [%]", "damping spread")
    f, f_spread, zeta, zeta_spread = ([float(row[heads.index(name)]) for row in cells] for name in names)
    assert f == pytest.approx(modes.frequencies, rel=1e-5)  # about six digits are written
    assert zeta == pytest.approx(100 * modes.damping_ratios, abs=5e-4)  # three decimals of a per cent
    assert f_spread == pytest.approx(modes.frequencies_spread)
    assert zeta_spread == pytest.approx(100 * np.asarray(modes.damping_ratios_spread))
    assert "emac" in body
    assert "<td>-</td>" in body  # an indicator that is not known
    assert body.count("<tr>") == 6


def test_every_mode_has_its_reason() -> None:
    section = sections.reasons_section(judged())
    assert section.body.count("<li>") == 5
    assert "</b> Found at 6 of 7 orders." in section.body


@pytest.mark.slow
def test_what_users_write_cannot_become_markup(tmp_path: Path) -> None:
    evil = '<script>alert("1")</script>'
    modes = replace(judged(), reasons=({"text": evil},) * 5, scaling=evil)
    diagram = replace(examples.diagram(), notes=(evil,), settings=LineOptions(exclude=evil))
    path = report((modes, diagram), tmp_path / "r.html", title=evil, source=evil, command=evil)
    page = read(path)
    assert "<script>alert" not in path.read_text(encoding="utf-8")  # the page's own scripts draw shapes that move
    assert " ".join(page.words).count(evil) >= 7


def test_the_script_repeats_the_identification() -> None:
    text = stabilization_script(examples.diagram(), "chain.uff")
    compile(text, "script", "exec")
    assert "orders=range(2, 15, 2)" in text
    assert "block_rows=8" in text
    assert "band=[0.3, 7.5]" in text
    assert "weights" not in text  # not given
    weights = np.linspace(0.1, 1, 3)
    given = stabilization_script(replace(examples.diagram(), settings=LineOptions(weights=weights)), None)
    compile(given, "script", "exec")
    assert f"weights={weights.tolist()!r}" in given  # every digit


@pytest.mark.slow
def test_running_the_script_gives_the_same_modes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    f = examples.response().frequencies
    ms.write(tmp_path / "chain.npz", chain5().frequency_response(f, noise=0.01, seed=1))
    first = ms.stabilize(
        ms.read(tmp_path / "chain.npz"), orders=range(2, 21, 2), band=(0.5, 4.0), tolerances={"shape": 0.1}
    )
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(stabilization_script(first, "chain.npz"), "script", "exec"), names)
    again = names["diagram"]
    assert isinstance(again, StabilizationDiagram)
    assert np.array_equal(again.poles, first.poles)
    assert np.array_equal(again.stable, first.stable)
    assert (tmp_path / "report.html").exists()


def test_the_command_and_the_notes_are_there(written: Path) -> None:
    words = " ".join(read(written).words)
    assert "modalscope identify chain.uff -o chain.html" in words
    assert "orders 16 to 20 left out" in words
    assert f"not drawn: {examples.REAL} real" in words


@pytest.mark.slow
def test_the_fit_error_of_every_channel_is_listed() -> None:
    r = examples.response()
    errors = np.linspace(0.01, 0.08, 8).reshape(4, 2)
    body = sections.responses_section(r, (0.05, errors), lines_of_response(examples.modes(), r)).body
    assert [f"{100 * e:.2f}" for e in errors.ravel()] == re.findall(r'--shade:\d+%">([\d.]+)<', body)
    worst = re.findall(r'aria-label="output ([^,]+), input ([^,]+): measured', body)[0]
    assert worst == (r.output_dofs[3], r.input_dofs[1])


@pytest.mark.slow
def test_modes_without_participation_are_reported_without_rebuilt_responses(tmp_path: Path) -> None:
    modes = replace(judged(), participation=None, input_dofs=(), units="m")
    page = read(report((modes, examples.diagram()), tmp_path / "r.html"))
    assert "participation of the modes is not known" in " ".join(page.words)


@pytest.mark.slow
def test_no_modes_and_samples_are_reported_too(tmp_path: Path) -> None:
    irf = examples.modes().impulse_response(300, 20.0)
    diagram = replace(examples.diagram(), response=irf, domain="time")
    none = examples.modes().take([])
    page = read(report((none, diagram), tmp_path / "r.html"))
    assert "0 modes between 0.3 and 7.5 Hz" in " ".join(page.words)
    assert "dirac response" in page.words


def test_the_same_result_gives_the_same_picture() -> None:
    assert svg(shape_picture(judged(), 1)) == svg(shape_picture(judged(), 1))


@pytest.mark.parametrize("channel", [(0, 0), (3, 1)])
def test_a_curve_keeps_its_highest_and_lowest_point(channel: tuple[int, int]) -> None:
    lines = lines_of_response(examples.modes(), examples.response())
    level = np.abs(lines.measured[:, channel[0], channel[1]])
    f, drawn = envelope(lines.frequencies, level, 60)
    assert (drawn.min(), drawn.max()) == (level.min(), level.max())
    assert len(f) == len(drawn) <= 2 * 60
    assert np.all(np.diff(f) >= 0)


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [(0.0, 10.0, ["0", "2", "4", "6", "8", "10"]), (-2.0, 2.0, ["-2", "-1", "0", "1", "2"]), (177.0, 177.2, None)],
)
def test_ticks_are_round_and_inside(low: float, high: float, labels: list[str] | None) -> None:
    ticks = Axis("", low, high).ticks()
    assert 3 <= len(ticks) <= 8
    assert all(
        low - 1e-9 <= value <= high + 1e-9 and float(label) == pytest.approx(value, abs=1e-12) for value, label in ticks
    )
    assert labels is None or [label for _, label in ticks] == labels


def test_decades_have_powers_of_ten() -> None:
    assert [label for _, label in Axis("", 1e-6, 1.0, log=True).ticks()] == [
        "10⁻⁶",
        "10⁻⁵",
        "10⁻⁴",
        "10⁻³",
        "10⁻²",
        "10⁻¹",
        "10⁰",
    ]
    assert [label for _, label in Axis("", 0.03, 0.4, log=True).ticks()] == ["0.05", "0.1", "0.2"]


def test_a_report_cut_short_leaves_the_earlier_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.html"
    path.write_text("an earlier good report")

    def broken(*given: object) -> Section:
        raise RuntimeError("the picture cannot be drawn")

    monkeypatch.setattr(sections, "stabilization_section", broken)
    with pytest.raises(RuntimeError):
        report((judged(), examples.diagram()), path)
    assert path.read_text() == "an earlier good report"
    assert list(tmp_path.iterdir()) == [path]


def test_a_write_that_fails_leaves_the_earlier_report_and_no_other_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.html"
    path.write_text("an earlier good report")

    def full(self: Path, data: str, **options: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(DataError, match="no space left on device"):
        write_page(path, "title", "subtitle", [Section("one", "One", "")])
    assert path.read_bytes() == b"an earlier good report"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
def test_a_diagram_alone_is_reported_with_the_modes_it_shows(tmp_path: Path) -> None:
    diagram = ms.stabilize(chain5().impulse_response(300, noise=0.01, seed=0), orders=range(2, 21, 2))
    pair = report((ms.select(diagram), diagram), tmp_path / "pair.html").read_bytes()
    assert report(diagram, tmp_path / "alone.html").read_bytes() == pair
    result = SimpleNamespace(modes=ms.select(diagram), diagram=diagram, findings=None)
    assert report(result, tmp_path / "result.html").read_bytes() == pair


@pytest.mark.slow
@pytest.mark.parametrize("form", ["samples", "lines"])
def test_an_identification_is_reported_with_its_model(form: str, tmp_path: Path) -> None:
    if form == "samples":
        found = ms.identify(chain5().impulse_response(300, noise=0.01, seed=0), method="polyreference", order=10)
    else:
        f = np.linspace(0.3, 7.5, 400)
        found = ms.identify(chain5().frequency_response(f, noise=0.01, seed=0), method="alternate", order=10)
    page = read(report(found, tmp_path / "r.html", source="chain.npz"))
    anchors = [value for tag, name, value in page.attributes if tag == "section" and name == "id"]
    assert anchors == ["summary", "modes", "model", "shapes", "mac", "responses", "data", "settings", "notes", "repeat"]
    words = " ".join(page.words)
    assert "order 10" in words
    assert "Unexplained: " in words
    assert f" {described(found.modes)[0].frequency} " in words
    assert ("extraneous poles" in words) is (form == "samples")
    assert "stable yes" in words  # every state of the model decays
    assert np.all(found.state_space.continuous_poles.real < 0)


@pytest.mark.slow
def test_running_the_script_of_an_identification_gives_the_same_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ms.write(tmp_path / "chain.npz", chain5().impulse_response(300, noise=0.01, seed=0))
    monkeypatch.chdir(tmp_path)
    first = ms.identify(ms.read("chain.npz"), method="era", order=12, block_rows=40)
    names: dict[str, object] = {}
    exec(compile(identification_script(first, "chain.npz"), "script", "exec"), names)
    again = names["found"]
    assert isinstance(again, ms.Identification)
    assert np.array_equal(again.state_space.A, first.state_space.A)
    assert (tmp_path / "report.html").exists()


@pytest.mark.slow
def test_modes_that_explain_too_little_are_a_warning_that_comes_first(tmp_path: Path) -> None:
    diagram = ms.stabilize(chain5().impulse_response(300, noise=0.01, seed=0), orders=range(2, 21, 2))
    modes = ms.select(diagram)
    text = report((modes.take([4]), diagram), tmp_path / "r.html").read_text()
    assert '<h2>Summary</h2>\n<p class="loud">WARNING: ' in text
    assert 'class="loud"' not in report((modes, diagram), tmp_path / "r.html").read_text()


def test_the_data_are_examined_and_what_is_wrong_stands_there() -> None:
    clean = chain5().frequency_response(np.linspace(0.3, 7.5, 300), quantity="acceleration", noise=0.01, seed=0)
    values = np.array(clean.values)
    values[:, 1] *= -1
    assert "No data problem found." in data_section(clean, None).body
    turned = data_section(replace(clean, values=values), None).body
    assert "driving-point response has the wrong sign: force or sensor reversed" in turned
    assert "Change the sign of 2:+X or of its force" in turned
    assert (
        "No data problem" in data_section(replace(clean, values=values), None, findings=()).body
    )  # those of the record


def test_other_suffixes_folders_and_things_are_errors(tmp_path: Path) -> None:
    pair = (examples.modes(), examples.diagram())
    with pytest.raises(DataError, match=r"reports are \.html files"):
        report(pair, tmp_path / "r.pdf")
    with pytest.raises(DataError, match="the system refuses"):
        report(pair, tmp_path / "missing" / "r.html")
    with pytest.raises(DataError, match="it was given int"):
        report(3, tmp_path / "r.html")  # type: ignore[arg-type]
    with pytest.raises(DataError, match="title of a report: expected text, got int"):
        report(pair, tmp_path / "r.html", title=3)  # type: ignore[arg-type]
    with pytest.raises(DataError, match="command of a report: expected text, got list"):
        report(pair, tmp_path / "r.html", command=["modalscope"])  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_bands_of_a_record_have_one_diagram_and_responses_and_settings_each(tmp_path: Path) -> None:
    structure = random_structure(401)
    result = ms.analyze(structure.record(1, 1401))
    assert len(result.diagrams) == 2
    text = ms.report(result, tmp_path / "bands.html").read_text()
    assert "Identified in 2 bands: " in text
    assert text.count('<section id="stabilization') == 1
    for anchor in ("responses", "settings"):
        assert text.count(f'<section id="{anchor}"') == text.count(f'<section id="{anchor}-2"') == 1
    low, high = result.diagrams[1].settings["band"]
    assert f"Settings, {low:.4g} to {high:.4g} Hz" in text


@pytest.mark.slow
def test_modes_of_several_bands_have_the_numbers_of_their_table_in_one_diagram(tmp_path: Path) -> None:
    data = chain5().frequency_response(np.linspace(0.3, 7.5, 300), quantity="acceleration", noise=0.01, seed=0)
    result = ms.analyze(data, band=[(0.3, 4.5), (4.5, 7.5)], orders=range(4, 13, 4))
    below = int(np.count_nonzero(result.modes.frequencies < 4.5))
    assert 0 < below < len(result.modes) == 5
    text = ms.report(result, tmp_path / "bands.html").read_text()
    diagram = text.partition('id="stabilization')[2].partition("</svg>")[0]
    assert re.findall(r">(\d)   [\d.]+<", diagram) == list("12345")
    poles = sum(np.count_nonzero(np.isin(each.kinds, ("mode", "unstable"))) for each in result.diagrams)
    assert sum(map(int, re.findall(r"\((\d+)\)<", diagram))) == poles


def test_one_output_has_neither_shapes_nor_their_similarity() -> None:
    modes = chain5().modes()
    assert [section.anchor for section in mode_pictures(modes)] == ["shapes", "mac"]
    assert not list(mode_pictures(chain5().modes(outputs=[0])))


def test_pictures_of_their_own_know_no_variables_and_are_whole() -> None:
    pictures = pictures_of(judged(), [examples.diagram()])
    assert set(pictures) == {"diagram", *(f"mode{k}" for k in range(1, 6)), "mac", "response"}
    for picture in (alone(svg(each)) for each in pictures.values()):
        tree = ElementTree.fromstring(picture)
        assert tree.tag == "{http://www.w3.org/2000/svg}svg"
        assert float(tree.attrib["width"]) > 100
        assert "var(" not in picture
        assert "color-mix" not in picture


def test_what_to_measure_next_stands_where_it_can_be_told(tmp_path: Path) -> None:
    lines = chain5().frequency_response(np.linspace(0.2, 8, 300), noise=0.01, seed=0)
    told = ms.analyze(lines, orders=range(2, 13, 2))
    page = report(told, tmp_path / "told.html").read_text(encoding="utf-8")
    assert "What to measure next" in page
    for line in str(ms.next_measurement(told)).split("\n"):
        assert line in page
    wind = chain5().simulate(inputs="ambient", samples=1200, sampling_rate=20.0)
    page = report(ms.analyze(wind, orders=range(2, 13, 2)), tmp_path / "wind.html").read_text(encoding="utf-8")
    assert "What to measure next" not in page
