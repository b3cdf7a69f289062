"""Write where the project lives into every file that says so: `python -m tools.home SOURCE DOCUMENTATION`.

The table `project.urls` of pyproject.toml is the place; CITATION.cff and codemeta.json follow it. Said again with other addresses,
it replaces them.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path
from urllib.parse import urlsplit

__all__ = ["main", "written"]

ROOT = Path(__file__).resolve().parents[1]


def written(source: str, documentation: str, root: Path = ROOT) -> None:
    """Write the addresses of the sources and of the documentation into pyproject.toml, CITATION.cff and codemeta.json.

    Raises `ValueError`: an address that does not begin with https:// and a host.
    """
    source, documentation = source.rstrip("/"), documentation.rstrip("/") + "/"
    for address in (source, documentation):
        if urlsplit(address).scheme != "https" or not urlsplit(address).netloc:
            raise ValueError(f"{address} is no address of a page. Give one that begins with https://")
    urls = {
        "Documentation": documentation,
        "Source": source,
        "Issues": f"{source}/issues",
        "Changelog": f"{source}/blob/main/CHANGELOG.md",
    }
    table = "[project.urls]\n" + "".join(f'{name} = "{url}"\n' for name, url in urls.items()) + "\n"
    project, citation, codemeta = (root / name for name in ("pyproject.toml", "CITATION.cff", "codemeta.json"))
    text = re.sub(r"^\[project\.urls\]\n(?:\w+ = .*\n)*\n", "", project.read_text(encoding="utf-8"), flags=re.MULTILINE)
    text = text.replace("[project.scripts]\n", f"{table}[project.scripts]\n", 1)
    assert tomllib.loads(text)["project"]["urls"] == urls
    project.write_text(text, encoding="utf-8")
    text = re.sub(r"^(?:repository-code|url): .*\n", "", citation.read_text(encoding="utf-8"), flags=re.MULTILINE)
    told = f'repository-code: "{source}"\nurl: "{documentation}"\n'
    citation.write_text(text.replace("license: ", f"{told}license: ", 1), encoding="utf-8")
    rest = json.loads(codemeta.read_text(encoding="utf-8"))
    rest |= {"codeRepository": source, "issueTracker": urls["Issues"], "softwareHelp": documentation}
    codemeta.write_text(json.dumps(rest, indent=2) + "\n", encoding="utf-8")


def main() -> int:
    """Write the two addresses; 2 where they are not given."""
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    written(sys.argv[1], sys.argv[2])
    return 0


if __name__ == "__main__":
    sys.exit(main())
