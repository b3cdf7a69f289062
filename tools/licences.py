"""The licences of what modalscope needs, by what the installed packages say of themselves; nothing is asked of the network.

`python -m tools.licences` prints a line a package: name, version, licence, and whether it comes with modalscope itself or with an
extra; `--sbom` prints a bill of materials instead (CycloneDX).

No package may be under the GPL or AGPL; one under the LGPL may come with an extra that `WITH_LGPL` names.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from typing import Any

__all__ = ["FOR_SOME_FILES", "WITH_LGPL", "Package", "bill", "licence_of", "main", "needed", "refused"]

#: Extras that may bring packages under the LGPL.
WITH_LGPL: frozenset[str] = frozenset({"mdf", "tdms"})

#: Licences that a package names for a few of its files only, and how the names of these end: they count where the files are installed.
FOR_SOME_FILES: dict[str, tuple[str, str]] = {
    "docutils": ("GNU General Public License (GPL)", ".el")  # its mode for Emacs, by COPYING.rst
}

_NAME = re.compile(r"\s*([A-Za-z0-9._-]+)\s*(?:\[([^\]]*)\])?")
_EXTRA = re.compile(r"extra\s*==\s*['\"]([^'\"]+)['\"]")
_GPL = re.compile(r"\bA?GPL|(?<!Lesser )(?<!Library )\bGeneral Public License|\bGNU Affero", re.IGNORECASE)
_LGPL = re.compile(r"\bLGPL|(Lesser|Library or Lesser|Library) General Public License", re.IGNORECASE)
#: Of a licence's own text only its head is read: the rest names other licences.
_HEAD = 200


@dataclass(frozen=True, order=True, slots=True)
class Package:
    """An installed package, its licence, and the extra that brings it; "" is modalscope itself."""

    name: str
    version: str
    licence: str
    extra: str


def licence_of(package: metadata.Distribution) -> str:
    """Return the licence by the expression, the classifiers or the field of a package, whichever there is first.

    A licence that stands for files which are not installed is left out (`FOR_SOME_FILES`); where no list of files is known, they count.
    """

    def told(name: str) -> list[str]:
        return [str(text) for text in package.metadata.get_all(name) or ()]

    classified = [text.split(" :: ")[-1] for text in told("Classifier") if text.startswith("License")]
    partial, ending = FOR_SOME_FILES.get(package.name, ("", ""))
    if partial in classified and package.files and not any(str(f).endswith(ending) for f in package.files):
        classified.remove(partial)
    written = " ".join(" ".join(told("License"))[:_HEAD].split())
    return " ".join(told("License-Expression")) or "; ".join(classified) or written


def needed(name: str = "modalscope") -> list[Package]:
    """Return every installed package that modalscope or one of its extras needs, each with the first that brings it."""
    extras = metadata.distribution(name).metadata.get_all("Provides-Extra", [])
    found: dict[str, Package] = {}
    for extra in ("", *extras):
        waiting, seen = [(name, frozenset({extra}))], set[tuple[str, frozenset[str]]]()
        while waiting:
            one = waiting.pop()
            if one in seen:
                continue
            seen.add(one)
            for required, more in _requirements(*one):
                package = _installed(required)
                if package is None or (required == name and more == one[1]):
                    continue
                if required != name:
                    found.setdefault(required, Package(required, package.version, licence_of(package), extra))
                waiting.append((required, more))
    return sorted(found.values())


def _requirements(name: str, extras: frozenset[str]) -> Iterator[tuple[str, frozenset[str]]]:
    package = _installed(name)
    for text in (package.requires if package else None) or ():
        head, _, marker = text.partition(";")
        extra = _EXTRA.search(marker)
        match = _NAME.match(head)
        if match and (extra is None or extra[1] in extras):
            more = frozenset(part.strip() for part in (match[2] or "").split(",") if part.strip())
            yield match[1].lower().replace("_", "-"), more


def _installed(name: str) -> metadata.Distribution | None:
    try:
        return metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None


def refused(packages: list[Package]) -> list[Package]:
    """Return what may not be: the GPL anywhere, the LGPL outside of its extras, and packages that say nothing."""

    def may_not(package: Package) -> bool:
        if not package.licence:
            return True
        if _LGPL.search(package.licence):
            return package.extra not in WITH_LGPL
        return bool(_GPL.search(package.licence))

    return [package for package in packages if may_not(package)]


def bill(packages: list[Package], version: str) -> dict[str, Any]:
    """Return the bill of materials in CycloneDX 1.5: modalscope, and what it and its extras need."""

    def component(name: str, version: str, **more: Any) -> dict[str, Any]:
        reference = f"pkg:pypi/{name}@{version}"
        return {"type": "library", "bom-ref": reference, "name": name, "version": version, "purl": reference, **more}

    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component("modalscope", version)},
        "components": [
            component(
                package.name,
                package.version,
                scope="optional" if package.extra else "required",
                licenses=[{"license": {"name": package.licence}}],
            )
            for package in packages
        ],
    }


def main() -> int:
    """Print the list, or with `--sbom` the bill of materials; 1 where something in it may not be."""
    packages = needed()
    if "--sbom" in sys.argv[1:]:
        print(json.dumps(bill(packages, metadata.version("modalscope")), indent=1))
        return 0
    for package in packages:
        print(
            f"{package.name} {package.version}: {package.licence or '(none)'} ({package.extra or 'modalscope itself'})"
        )
    wrong = refused(packages)
    for package in wrong:
        print(f"may not be: {package.name}, {package.licence or 'without a licence'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
