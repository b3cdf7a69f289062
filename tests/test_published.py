"""What indexes, archives and journals are told: valid, of one version, with references that are cited and figures that a command prints."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from modalscope import methods
from modalscope.interfaces.cli.commands import COMMANDS
from tests.support import ROOT
from tools.home import written

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
BIBLIOGRAPHY = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")


def told(name: str) -> Any:
    text = (ROOT / name).read_text(encoding="utf-8")
    return json.loads(text) if name.endswith(".json") else pytest.importorskip("yaml").safe_load(text)


# What https://zenodo.org accepts of a software, and what CodeMeta 3.0 and CFF 1.2.0 ask for
ZENODO = {
    "title",
    "description",
    "upload_type",
    "access_right",
    "license",
    "language",
    "version",
    "creators",
    "keywords",
}
CODEMETA = {"@context", "@type", "name", "description", "version", "license", "author", "programmingLanguage"}
CFF = {"cff-version", "message", "title", "authors"}


def test_archives_and_indexes_are_told_what_they_ask_for() -> None:
    zenodo, codemeta, citation = told(".zenodo.json"), told("codemeta.json"), told("CITATION.cff")
    assert set(zenodo) == ZENODO
    assert (zenodo["upload_type"], zenodo["access_right"]) == ("software", "open")
    assert set(codemeta) >= CODEMETA
    assert (codemeta["@context"], codemeta["@type"]) == ("https://w3id.org/codemeta/3.0", "SoftwareSourceCode")
    assert set(citation) >= CFF
    assert citation["cff-version"] == "1.2.0"


def test_all_of_them_say_the_same_as_the_package() -> None:
    zenodo, codemeta, citation = told(".zenodo.json"), told("codemeta.json"), told("CITATION.cff")
    assert {each["version"] for each in (zenodo, codemeta, citation)} == {PROJECT["version"]}
    assert {zenodo["license"], codemeta["license"].rpartition("/")[2], citation["license"]} == {PROJECT["license"]}
    assert {zenodo["title"], citation["title"]} == {citation["title"]}
    assert codemeta["description"] == PROJECT["description"]
    assert codemeta["softwareRequirements"] == PROJECT["dependencies"]
    assert codemeta["dateModified"] == citation["date-released"]
    authors = [each["name"] for each in PROJECT["authors"]]
    for named in (zenodo["creators"], codemeta["author"], citation["authors"]):
        assert [each["name"] for each in named] == authors


def test_the_paper_has_the_sections_and_the_length_that_the_journal_asks_for() -> None:
    _, front, body = PAPER.split("---\n", 2)
    front = pytest.importorskip("yaml").safe_load(front)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(front)
    known = {each["index"] for each in front["affiliations"]}
    assert all(each["affiliation"] in known for each in front["authors"])
    heads = re.findall(r"^# (.*)$", body, re.MULTILINE)
    assert heads[:4] == ["Summary", "Statement of need", "State of the field", "What is new"]
    assert heads[-1] == "References"
    assert 750 <= len(body.split()) <= 1000


def test_every_reference_of_the_paper_is_cited_and_can_be_found() -> None:
    entries = dict(re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", BIBLIOGRAPHY, re.MULTILINE | re.DOTALL))
    assert set(re.findall(r"@(\w+)", PAPER.split("---\n", 2)[2])) == set(entries)
    for key, entry in entries.items():
        assert re.search(r"^  (doi = \{10\.\d{4,}/\S+\}|url = \{https://\S+\})$", entry, re.MULTILINE), key
        assert {"author", "title", "year"} <= set(re.findall(r"^  (\w+) = ", entry, re.MULTILINE)), key


def test_the_figures_of_the_paper_are_those_of_the_commands_beside_them() -> None:
    """The README's are held to `modalscope demo` by tests of its own; the rows are counted here, the arena's figures are its scores."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    paper = " ".join(PAPER.split())
    assert f"`modalscope methods` prints {len({row.name for row in methods()})} rows" in paper
    scores = json.loads((ROOT / "arena" / "scores.json").read_text(encoding="utf-8"))
    fields = scores["totals"]
    ambient, shaker = (
        {p: (t["found"], t["false"] + t["twice"]) for p, t in fields[f].items()} for f in ("ambient", "shaker")
    )
    ours, by_hand = (fields["ambient"][p] for p in ("modalscope", "pyOMA2 by hand"))
    assert ambient["modalscope"] == (ours["modes"], 0) == (49, 0)
    assert ambient["pyOMA2 Reynders"] == (47, 0)
    assert ambient["pyOMA2 Kvaale"] == (48, 1)
    assert (ambient["KOMA"][0], ambient["pyoma-toolbox"][0], ours["sets"]) == (44, 30, 8)
    assert (
        "| 8 ambient tests with 49 known modes, hands off | 49 found, none false | KOMA 44; pyOMA2's automatic"
        in readme
    )
    assert "presets: 47 and none false, or 48 and 1; pyoma-toolbox 30 |" in readme
    others = [t for p, t in fields["ambient"].items() if p != "modalscope" and not p.startswith("row ")]
    damping, shapes = (sorted(t[key] for t in others) for key in ("zeta_error", "shape_error"))
    rows = [counts for program, counts in ambient.items() if program.startswith("row ")]
    assert rows == [(49, 0)] * len(rows) != []  # "and so do single rows of its table"
    for words in (
        "On the eight ambient tests",
        f"finds all {ours['found']} modes hands off, with none false",
        f"`KOMA` finds {ambient['KOMA'][0]};",
        "find 47 with none false, or 48 with one.",
        f"error of damping is {100 * ours['zeta_error']:.1f} % for `modalscope`",
        f"and {100 * damping[0]:.1f} to {100 * damping[-1]:.1f} % for the other programs",
        f"(1 - MAC) {ours['shape_error']:.1e} and {shapes[0]:.1e} to {shapes[-1]:.1e}.",
    ):
        assert words in paper
    counted = {1: "one", 8: "eight", 9: "nine"}[len({tuple(p["requires"]) for p in scores["programs"].values()})]
    assert f"`make arena` compares {counted} programs" in paper
    assert f"(docs/arena/index.md): {counted} programs, {len(scores['sets'])} tests |" in readme
    assert (shaker["modalscope"], shaker["SDynPy PolyPy"], shaker["sdypy-EMA"]) == ((33, 0), (31, 0), (24, 7))
    assert "33 known modes | 33 found, none false | SDynPy PolyPy 31, sdypy-EMA 24 and 7 false or twice;" in readme
    assert (ours["f_held"], ours["zeta_held"]) == ([33, 37], [31, 36])
    assert (by_hand["f_held"], by_hand["zeta_held"]) == ([36, 37], [32, 37])
    assert by_hand["zeta_error"] < ours["zeta_error"]  # "its damping is more exact, too", says the README
    assert by_hand["shape_error"] > ours["shape_error"]
    assert "| 33 of 37 frequencies, 31 of 36 damping ratios | pyOMA2: 36 and 32 of 37, poles" in readme
    assert "33 of 37 of these modes, those of `pyOMA2`, whose poles a person picked, of 36." in paper
    demo = "Within the 95 % intervals: 7 of 7 published frequencies, 7 of 7 damping ratios."
    assert f"`modalscope demo` prints\n\n```\n{demo}\n```" in PAPER  # tests/test_readme.py runs it


@pytest.mark.slow
def test_what_the_paper_says_of_the_report_is_what_reproduce_prints(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "modalscope", "reproduce"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    paper = " ".join(PAPER.split())
    (same, values), *identities, (_, misprints) = re.findall(r"^(\d+) of (\d+): ", done.stdout, re.MULTILINE)
    assert f"{same} of {values} published values agree" in paper
    assert f"{sum(int(held) for held, _ in identities)} identities hold" in paper
    assert f"{int(misprints) // 2} equations and remarks that are printed wrong" in paper  # as printed and corrected


def places(root: Path) -> list[Any]:
    """Return what each file says of where the sources are, None where it says nothing."""
    urls = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"].get("urls", {})
    citation = re.search(
        r'^repository-code: "(.*)"$', (root / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE
    )
    codemeta = json.loads((root / "codemeta.json").read_text(encoding="utf-8"))
    return [urls.get("Source"), citation and citation.group(1), codemeta.get("codeRepository")]


def test_where_the_project_lives_is_said_once_and_everywhere(tmp_path: Path) -> None:
    assert len(set(places(ROOT))) == 1
    for name in ("pyproject.toml", "CITATION.cff", "codemeta.json"):
        shutil.copy(ROOT / name, tmp_path)
    written("https://example.org/first/", "https://example.org/docs", tmp_path)
    once = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()}
    written("https://example.org/second", "https://example.org/docs/", tmp_path)
    assert places(tmp_path) == ["https://example.org/second"] * 3
    written("https://example.org/first", "https://example.org/docs/", tmp_path)
    assert {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == once
    with pytest.raises(ValueError, match="begins with https://"):
        written("example.org", "https://example.org/docs", tmp_path)


def workflow(name: str) -> Any:
    return told(f".github/workflows/{name}.yml")["jobs"]


def test_a_change_is_tried_on_three_systems_and_by_every_python_that_is_declared() -> None:
    matrix = workflow("tests")["tests"]["strategy"]["matrix"]
    declared = [text.rpartition(" ")[2] for text in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", text)]
    assert matrix["python"] == declared == ["3.11", "3.12", "3.13", "3.14"]
    assert len({system.partition("-")[0] for system in matrix["system"]}) == 3
    assert workflow("tests")["packages"]["steps"][-1]["run"] == "make versions"


def test_a_release_holds_no_password_and_is_signed_where_it_is_built() -> None:
    jobs = workflow("release")
    assert "secrets." not in (ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8")
    used = {name: [step.get("uses", "").partition("@")[0] for step in job["steps"]] for name, job in jobs.items()}
    assert {"actions/attest-build-provenance", "actions/attest-sbom"} <= set(used["build"])
    assert jobs["publish"]["permissions"] == {"id-token": "write"}
    assert used["publish"] == ["actions/download-artifact", "pypa/gh-action-pypi-publish"]
    assert jobs["publish"]["environment"] == "release"


@pytest.mark.parametrize("path", sorted((ROOT / ".github" / "workflows").glob("*.yml")), ids=lambda path: path.stem)
def test_a_workflow_asks_make_for_what_there_is(path: Path) -> None:
    targets = set(re.findall(r"^([\w-]+):(?!=)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    text = path.read_text(encoding="utf-8") + (ROOT / ".readthedocs.yaml").read_text(encoding="utf-8")
    asked = {word for line in re.findall(r"\bmake ((?:[\w-]+ ?)+)$", text, re.MULTILINE) for word in line.split()}
    assert asked
    assert asked <= targets
    jobs = workflow(path.stem).values()
    assert all("timeout-minutes" in job for job in jobs)
    # a version is a name that its owner may move; the commit is not, and the version stands beside it for people and for Dependabot
    used = re.findall(r"uses: (.*)$", text, re.MULTILINE)
    assert used
    assert [each for each in used if not re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", each)] == []


FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("[0-9]*.yml"))


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_a_form_asks_for_what_the_answer_needs(path: Path) -> None:
    form = told(f".github/ISSUE_TEMPLATE/{path.name}")
    assert {"name", "description", "body"} <= set(form)
    asked = {each["id"]: each for each in form["body"] if each["type"] != "markdown"}
    assert "version" in asked
    assert all(each["attributes"]["label"] for each in asked.values())
    text = path.read_text(encoding="utf-8")
    commands = set(re.findall(r"`modalscope (\w+)", text))
    assert commands <= {command.name for command in COMMANDS}
    wanted = {"1-file": {"info", "origin", "expected"}, "2-modes": {"info", "document", "command"}, "3-other": {"what"}}
    assert {name for name, each in asked.items() if each.get("validations", {}).get("required")} >= wanted[path.stem]
