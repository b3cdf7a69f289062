"""What is given away: the source archive holds all that its own tests read."""

from __future__ import annotations

import re
import tomllib

from tests.support import ROOT


def test_the_source_archive_holds_what_its_tests_read() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = set(project["tool"]["hatch"]["build"]["targets"]["sdist"]["include"])
    code = [path.read_text(encoding="utf-8") for folder in ("tests", "tools") for path in (ROOT / folder).rglob("*.py")]
    read = {f"/{name}" for text in code for name in re.findall(r"\bROOT / \"([\w.-]+)\"", text)}
    assert {"/src", "/examples", "/docs"} <= read
    # the project file always goes along; documents at the top go by their suffix
    assert {name for name in read if not name.endswith((".md", ".toml"))} <= included
    assert {"/tests", "/tools", "/*.md"} <= included
