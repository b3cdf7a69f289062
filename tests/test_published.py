"""What indexes, archives and journals are told: valid, of one version, with references that are cited and figures that a command prints."""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any

import pytest

from modalscope import methods
from tests.support import ROOT

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
    assert 750 <= len(body.split()) <= 1250


def test_every_reference_of_the_paper_is_cited_and_can_be_found() -> None:
    entries = dict(re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", BIBLIOGRAPHY, re.MULTILINE | re.DOTALL))
    assert set(re.findall(r"@(\w+)", PAPER.split("---\n", 2)[2])) == set(entries)
    for key, entry in entries.items():
        assert re.search(r"^  (doi = \{10\.\d{4,}/\S+\}|url = \{https://\S+\})$", entry, re.MULTILINE), key
        assert {"author", "title", "year"} <= set(re.findall(r"^  (\w+) = ", entry, re.MULTILINE)), key


def test_the_figures_of_the_paper_are_those_of_the_commands_beside_them() -> None:
    """The README's are held to `modalscope demo` and to its table by tests of its own; the rows are counted here."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    paper = " ".join(PAPER.split())
    assert f"`modalscope methods` prints {len({row.name for row in methods()})} rows" in paper
    (simulated,) = [line for line in readme.splitlines() if line.startswith("| 60 ambient records")]
    (hold,) = [line for line in readme.splitlines() if line.startswith("| their 95 % intervals")]
    for figure in ("335 of 337 modes", "2 wrong", "336 of 337", "pyOMA2 1.4.3"):
        assert figure in simulated
        assert figure in paper.replace("`", "")
    assert re.findall(r"(\d+) %", hold.partition("|")[2].partition("|")[2])[:2] == ["95", "97"]
    for figure in ("334", "0.8 s a record", "67", "12 records", "12 s a record"):
        assert figure in hold
        assert figure in paper
