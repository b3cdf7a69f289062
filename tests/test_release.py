"""What is given away: versions, requirements and licences say the same everywhere."""

from __future__ import annotations

import re
import tomllib
from hashlib import sha256
from pathlib import Path

import pytest

from tests.support import ROOT
from tools.licences import WITH_LGPL
from tools.recipe import sourced
from tools.release import EXTRAS, PYTHONS, faults_of_wheel, skipped_files

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def bare(requirement: str) -> str:
    return re.split(r"[\[<>=!~ ]", requirement)[0]


def test_citation_recipe_and_changelog_state_the_version() -> None:
    version = PROJECT["version"]
    assert re.search(rf"^version: {re.escape(version)}$", read("CITATION.cff"), re.MULTILINE)
    assert f'context:\n  version: "{version}"\n' in read("conda/recipe.yaml")
    assert f"## [{version}]" in read("CHANGELOG.md")


def test_the_conda_recipe_needs_what_the_project_needs_and_says_that_it_is_untested() -> None:
    recipe = read("conda/recipe.yaml")
    run = recipe.partition("  run:\n")[2].partition("\ntests:")[0]
    wanted = {f"{bare(each)} {each[len(bare(each)) :]}" for each in PROJECT["dependencies"]}
    stated = {line.strip(" -").replace("matplotlib-base", "matplotlib") for line in run.strip().splitlines()}
    assert stated == wanted | {f"python {PROJECT['requires-python']}"}
    assert "UNTESTED" in recipe


def test_the_conda_recipe_builds_a_release_by_the_hash_of_its_archive(tmp_path: Path) -> None:
    archive = tmp_path / f"modalscope-{PROJECT['version']}.tar.gz"
    archive.write_bytes(b"an archive")
    address = f"https://files.example.org/{archive.name}"
    recipe = sourced(read("conda/recipe.yaml"), archive, address)
    assert f"source:\n  url: {address}\n  sha256: {sha256(b'an archive').hexdigest()}\n\nbuild:\n" in recipe
    assert sourced(recipe, archive, address) == recipe
    with pytest.raises(ValueError, match="the recipe is of"):
        sourced(recipe, tmp_path / "modalscope-0.0.1.tar.gz", address)


def test_the_conda_recipe_is_one_by_its_tool() -> None:
    rattler = pytest.importorskip("rattler_build", reason="rattler-build is not installed")
    (rendered,) = rattler.Stage0Recipe.from_yaml(read("conda/recipe.yaml")).render()
    assert rendered.recipe.package.version == PROJECT["version"]


def test_every_requirement_stands_in_the_list_of_licences() -> None:
    groups = PROJECT["optional-dependencies"]
    known = set(re.findall(r"^\| ([\w.-]+) \|", read("docs/licences.md"), re.MULTILINE))
    needed = {bare(each) for each in PROJECT["dependencies"]}
    needed |= {bare(each) for name, group in groups.items() if name != "dev" for each in group}
    assert needed - {"modalscope"} <= known


def test_the_extra_all_is_every_extra_for_users_that_binds_nobody() -> None:
    groups = PROJECT["optional-dependencies"]
    (everything,) = groups["all"]
    named = set(everything.partition("[")[2].rstrip("]").split(","))
    left_out = {"all", "dev", "docs", "torch", "video"}  # torch: gigabytes, for who has a card
    assert named == set(groups) - left_out - WITH_LGPL
    assert EXTRAS in groups


def test_a_python_that_is_declared_is_one_that_the_check_tries() -> None:
    declared = [text.rpartition(" ")[2] for text in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", text)]
    assert declared
    assert set(declared) <= set(PYTHONS)


def test_a_wheel_with_anything_else_in_it_or_without_its_marks_is_refused() -> None:
    good = [
        "modalscope/__init__.py",
        "modalscope/__main__.py",
        "modalscope/py.typed",
        "modalscope-0.dist-info/licenses/LICENSE",
    ]
    assert faults_of_wheel(good) == []
    assert faults_of_wheel([*good, "tests/x.py"]) == ["it holds tests/x.py"]
    assert faults_of_wheel(good[1:3]) == ["it has no licence"]


def test_the_environment_with_extras_tries_every_file_that_wanted_one() -> None:
    told = """<testsuites><testsuite>
      <testcase file="tests/a.py" name="one"/>
      <testcase file="tests/b.py" name="two"><skipped message="could not import 'pandas'"/></testcase>
      <testcase file="tests/b.py" name="three"/>
      <testcase file="tests/c.py" name="four"><skipped message="">h5py is not installed: modalscope[hdf5]</skipped></testcase>
      <testcase file="tests/d.py" name="five"><skipped message="measured data are not there"/></testcase>
    </testsuite></testsuites>"""
    assert skipped_files(told) == ["tests/b.py", "tests/c.py"]
