"""Join the fragments of changelog.d into CHANGELOG.md, under what is not released yet.

`python -m tools.changelog` (or `make changelog`) makes each fragment a bullet of that section, to be sorted by subject, opens it where
it is not there yet, and removes the fragments. One fragment is one change, in one or two sentences for those who use it; with a file
for each, changes that are made side by side do not meet in one place.
"""

from __future__ import annotations

import itertools
import re
import textwrap
from collections.abc import Mapping
from pathlib import Path

__all__ = ["fragments", "joined", "main"]

ROOT = Path(__file__).resolve().parents[1]
WIDTH = 140

_SECTION = re.compile(r"^## ", re.MULTILINE)


def fragments(folder: Path) -> dict[Path, str]:
    """Return the text of every fragment in a folder, in the order of their names."""
    return {path: " ".join(path.read_text(encoding="utf-8").split()) for path in sorted(folder.glob("*.md"))}


def joined(changelog: str, version: str, day: str, texts: Mapping[Path, str]) -> str:
    r"""Return a changelog with the texts as last bullets of a version's section.

    Parameters
    ----------
    changelog : str
        Sections open with `## [version] - day`, the newest first.
    version, day : str
        Of the section; the day only where the section is new.
    texts : mapping
        As `fragments` returns them.

    Examples
    --------
    >>> print(joined("# Changelog\n\n## [0.1.0] - 2020-01-01\n\n- One.\n", "0.1.0", "", {Path("two.md"): "Two."}))
    # Changelog
    <BLANKLINE>
    ## [0.1.0] - 2020-01-01
    <BLANKLINE>
    - One.
    - Two.
    <BLANKLINE>
    """
    bullets = [textwrap.fill(text, WIDTH, initial_indent="- ", subsequent_indent="  ") for text in texts.values()]
    if not bullets:
        return changelog
    starts = [found.start() for found in _SECTION.finditer(changelog)] + [len(changelog)]
    heading = f"## [{version}]"
    for start, end in itertools.pairwise(starts):
        if changelog.startswith(heading, start):
            section = "\n".join([changelog[start:end].rstrip(), *bullets])
            return "\n\n".join(part for part in (changelog[:start] + section, changelog[end:].rstrip()) if part) + "\n"
    section = "\n".join([f"{heading} - {day}" if day else heading, "", *bullets])
    return "\n\n".join([changelog[: starts[0]].rstrip(), section, changelog[starts[0] :].rstrip()]).rstrip() + "\n"


def main() -> None:
    """Write the changelog and remove the fragments that it now holds."""
    path, texts = ROOT / "CHANGELOG.md", fragments(ROOT / "changelog.d")
    path.write_text(joined(path.read_text(encoding="utf-8"), "Unreleased", "", texts), encoding="utf-8")
    for fragment in texts:
        fragment.unlink()
    print(f"{len(texts)} changes written under Unreleased")


if __name__ == "__main__":
    main()
