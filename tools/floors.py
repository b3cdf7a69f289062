"""Draw the floors into the documents, from the one place where they are written: `[tool.importlinter]` in pyproject.toml.

`python -m tools.floors` (or `make architecture`) rewrites what stands between the two marks of ARCHITECTURE.md and CONTRIBUTING.md;
a test fails where that is stale.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

__all__ = ["DRAWINGS", "Layer", "layers", "main", "redrawn"]

ROOT = Path(__file__).resolve().parents[1]
PROJECT, SOURCE = ROOT / "pyproject.toml", ROOT / "src" / "modalscope"

OPEN, CLOSE = "<!-- floors: make architecture writes this -->", "<!-- end of floors -->"

_LAYER = re.compile(r'^\s*"([^"]+)",\s*# (.*)$', re.MULTILINE)


class Layer(NamedTuple):
    """One floor: its packages or modules, each with what happens there."""

    names: tuple[str, ...]
    notes: tuple[str, ...]


def layers(container: str, text: str) -> list[Layer]:
    """Return the floors of a package, the highest first, of those that are there.

    A layer's comment says what happens in it; where it stands for several packages, `;` parts what is said of each.

    Parameters
    ----------
    container : str
        The package, such as modalscope.selection.judging.
    text : str
        Of the project file.
    """
    notes = dict(_LAYER.findall(text))
    contracts = tomllib.loads(text)["tool"]["importlinter"]["contracts"]
    whole = next(one for one in contracts if one.get("containers") == [container])
    found = []
    for layer in whole["layers"]:
        names = [name.strip(" ()") for name in re.split("[:|]", layer)]
        note = notes.get(layer, "")
        said = [one.strip() for one in note.split(";")] if len(names) > 1 else [note]
        said += [""] * (len(names) - len(said))
        kept = [(name, note) for name, note in zip(names, said, strict=False) if _is_there(container, name)]
        if kept:
            found.append(Layer(*map(tuple, zip(*kept, strict=True))))
    return found


def _is_there(container: str, name: str) -> bool:
    place = SOURCE.joinpath(*container.split(".")[1:], name)
    return place.is_dir() or (place.with_suffix(".py").exists() and name != "__main__")


def tree(text: str) -> str:
    """Return the packages as a tree with what happens in each, and in those inside them."""
    inner = {
        one["containers"][0] for one in tomllib.loads(text)["tool"]["importlinter"]["contracts"] if "containers" in one
    }
    lines = ["```", "src/modalscope/", "  __init__.py       the face: names, each loaded when it is first asked for"]
    for layer in layers("modalscope", text):
        for name, note in zip(*layer, strict=True):
            lines.append(f"  {name + '/':18s}{note}")
            below = layers(f"modalscope.{name}", text) if f"modalscope.{name}" in inner else []
            lines += [f"    {one + '/':16s}{said}" for layer in below for one, said in zip(*layer, strict=True) if said]
    return "\n".join([*lines, "```"])


def table(text: str) -> str:
    """Return the floors as a table, numbered from the ground."""
    inner = {
        one["containers"][0] for one in tomllib.loads(text)["tool"]["importlinter"]["contracts"] if "containers" in one
    }
    found = layers("modalscope", text)
    rows = ["| floor | package | what happens there | packages inside, the highest first |", "|---|---|---|---|"]
    for k, ((name, *_), notes) in enumerate(found):
        below = layers(f"modalscope.{name}", text) if f"modalscope.{name}" in inner else []
        inside = ", ".join(f"`{one}`" for layer in below for one, said in zip(*layer, strict=True) if said)
        rows.append(f"| {len(found) - 1 - k} | `{name}` | {'; '.join(note for note in notes if note)} | {inside} |")
    return "\n".join(rows)


#: Which document shows the floors how.
DRAWINGS: dict[str, Callable[[str], str]] = {"ARCHITECTURE.md": tree, "CONTRIBUTING.md": table}


def redrawn(document: str, drawing: str) -> str:
    r"""Return a document with a drawing between its two marks.

    Examples
    --------
    >>> print(redrawn(f"Before.\n{OPEN}\nold\n{CLOSE}\nAfter.", "new").replace(OPEN, "(").replace(CLOSE, ")"))
    Before.
    (
    new
    )
    After.
    """
    before, opened, rest = document.partition(OPEN)
    _, closed, after = rest.partition(CLOSE)
    if not (opened and closed):
        raise ValueError(f"the document has no place for the floors, {OPEN} and {CLOSE}")
    return f"{before}{OPEN}\n{drawing}\n{CLOSE}{after}"


def main() -> None:
    """Rewrite the documents."""
    text = PROJECT.read_text(encoding="utf-8")
    for name, draw in DRAWINGS.items():
        path = ROOT / name
        path.write_text(redrawn(path.read_text(encoding="utf-8"), draw(text)), encoding="utf-8")


if __name__ == "__main__":
    main()
