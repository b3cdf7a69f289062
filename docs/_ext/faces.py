"""Pages of the reference, one a name, made from what the package offers, each with the examples that use it."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any


def setup(app: Any) -> dict[str, Any]:
    app.connect("builder-inited", lambda app: write_pages(Path(app.srcdir)), priority=50)
    app.connect("builder-inited", lambda app: touch_examples(Path(app.srcdir)), priority=900)
    app.connect("autodoc-process-docstring", plain_bars, priority=900)
    return {"parallel_read_safe": True}


def plain_bars(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Take the bars of |x| for bars, and not for the substitutions of reStructuredText."""
    lines[:] = [
        line if "``" in line or line.lstrip().startswith((">>>", "...")) else line.replace("|", "\\|") for line in lines
    ]


def write_pages(source: Path) -> None:
    """Write `generated/reference`: the face and its namespaces."""
    import modalscope as ms

    folder = source / "generated" / "reference"
    folder.mkdir(parents=True, exist_ok=True)
    spaces = [name for name in ms.__all__ if inspect.ismodule(getattr(ms, name))]
    groups = {"modalscope": [name for name in ms.__all__ if name not in spaces]}
    groups |= {f"modalscope.{space}": sorted(getattr(ms, space).__all__) for space in spaces}
    lines = ["# Reference", "", "Everything that is offered, with the examples that use it.", ""]
    tree = []
    for group, names in groups.items():
        lines += [f"## `{group}`", "", "| | |", "|---|---|"]
        for name in names:
            thing = getattr(ms if group == "modalscope" else getattr(ms, group.partition(".")[2]), name)
            page = f"{group}.{name}"
            _write_page(folder / f"{page}.rst", thing, page)
            first = (
                (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ").replace("|", "\\|").replace("`", "")
            )
            lines.append(f"| [`{name}`]({page}.rst) | {first} |")
            tree.append(f"{page.removeprefix('modalscope.')} <{page}>")
        lines.append("")
    lines += ["```{toctree}", ":hidden:", "", *tree, "```", ""]
    (folder / "index.md").write_text("\n".join(lines), encoding="utf-8")


def _write_page(path: Path, thing: Any, page: str) -> None:
    title = page
    kind = "autoclass" if inspect.isclass(thing) else "autofunction" if callable(thing) else "autodata"
    members = "\n   :members:" if inspect.isclass(thing) else ""
    text = f"{title}\n{'=' * len(title)}\n\n.. {kind}:: {page}{members}\n\n"
    text += f".. rubric:: Examples that use it\n\n.. include:: ../backreferences/{page}.examples\n"
    path.write_text(text, encoding="utf-8")


def touch_examples(source: Path) -> None:
    """Give every page of the reference a list of examples, be it empty."""
    folder = source / "generated" / "backreferences"
    folder.mkdir(parents=True, exist_ok=True)
    for page in (source / "generated" / "reference").glob("*.rst"):
        for line in page.read_text(encoding="utf-8").splitlines():
            if line.startswith(".. include:: ../backreferences/"):
                target = folder / line.rpartition("/")[2]
                if not target.exists():
                    target.write_text("No example uses it yet.\n", encoding="utf-8")
