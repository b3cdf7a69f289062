"""What modalscope needs may be given on: no package under the GPL, and the LGPL only where it is said."""

from __future__ import annotations

import pytest

from tools.licences import WITH_LGPL, Package, needed, refused


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
