"""What modalscope needs may be given on: no package under the GPL, and the LGPL only where it is said."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest

from tools.licences import FOR_SOME_FILES, WITH_LGPL, Package, bill, licence_of, needed, refused


@pytest.mark.slow
def test_no_package_is_under_a_licence_that_binds_its_users() -> None:
    packages = needed()
    assert {"numpy", "scipy", "matplotlib"} <= {package.name for package in packages if not package.extra}
    assert {"h5py", "pytest"} <= {package.name for package in packages}
    assert refused(packages) == []


@pytest.mark.parametrize(
    ("licence", "allowed"),
    [
        ("MIT", True),
        ("BSD-3-Clause AND MIT", True),
        ("MPL-2.0", True),
        ("GPL-3.0-or-later", False),
        ("GNU General Public License v3 (GPLv3)", False),
        ("AGPL-3.0-only", False),
        ("LGPL-2.1-only", False),
        ("GNU Lesser General Public License v3 (LGPLv3)", False),
        ("", False),
    ],
)
def test_licences_are_told_apart(licence: str, allowed: bool) -> None:
    assert (refused([Package("a", "1", licence, "")]) == []) is allowed


def test_the_lgpl_may_come_with_the_extras_that_say_so() -> None:
    assert refused([Package("a", "1", "LGPL-3.0-only", extra) for extra in WITH_LGPL]) == []


@pytest.mark.parametrize(("file", "allowed"), [("docutils/core.py", True), ("share/rst.el", False)])
def test_a_licence_for_some_files_counts_where_they_are_installed(tmp_path: Path, file: str, allowed: bool) -> None:
    folder = tmp_path / "docutils-1.dist-info"
    folder.mkdir()
    told = ("Public Domain", "OSI Approved :: GNU General Public License (GPL)")
    lines = [
        "Metadata-Version: 2.1",
        "Name: docutils",
        "Version: 1",
        *(f"Classifier: License :: {each}" for each in told),
    ]
    (folder / "METADATA").write_text("\n".join(lines) + "\n")
    (folder / "RECORD").write_text(f"{file},,\n")
    licence = licence_of(metadata.Distribution.at(folder))
    assert "docutils" in FOR_SOME_FILES
    assert (refused([Package("docutils", "1", licence, "docs")]) == []) is allowed


def test_the_bill_of_materials_lists_each_package_once_with_its_licence() -> None:
    made = bill([Package("numpy", "2.0", "BSD-3-Clause", ""), Package("h5py", "3.1", "BSD-3-Clause", "hdf5")], "0.3.0")
    assert (made["bomFormat"], made["metadata"]["component"]["purl"]) == ("CycloneDX", "pkg:pypi/modalscope@0.3.0")
    numpy, h5py = made["components"]
    assert (numpy["bom-ref"], numpy["scope"], h5py["scope"]) == ("pkg:pypi/numpy@2.0", "required", "optional")
    assert h5py["licenses"] == [{"license": {"name": "BSD-3-Clause"}}]
