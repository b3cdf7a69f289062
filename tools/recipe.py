"""Write where the archive of a release lies, and its SHA-256, into the recipe of conda.

`python -m tools.recipe dist/modalscope-0.2.0.tar.gz https://files.example.org/modalscope-0.2.0.tar.gz`
"""

from __future__ import annotations

import re
import sys
from hashlib import sha256
from pathlib import Path

__all__ = ["RECIPE", "sourced"]

RECIPE = Path(__file__).resolve().parents[1] / "conda" / "recipe.yaml"

_SOURCE = re.compile(r"^source:\n(?:  .*\n)+", re.MULTILINE)


def sourced(recipe: str, archive: Path, address: str) -> str:
    """Return a recipe that builds from an archive at an address, by the hash of the archive that lies here.

    Raises ValueError: the archive is not of the version of the recipe, or the address does not end in its name.
    """
    version = re.search(r'^  version: "(.*)"$', recipe, re.MULTILINE)
    name = f"modalscope-{version[1] if version else ''}.tar.gz"
    if archive.name != name or not address.endswith(f"/{name}"):
        raise ValueError(f"the recipe is of {name}; the archive is {archive.name}, the address {address}")
    source = f"source:\n  url: {address}\n  sha256: {sha256(archive.read_bytes()).hexdigest()}\n"
    return _SOURCE.sub(lambda _: source, recipe, count=1)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    RECIPE.write_text(sourced(RECIPE.read_text(encoding="utf-8"), Path(sys.argv[1]), sys.argv[2]), encoding="utf-8")
