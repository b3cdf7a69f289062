"""Sets: a file NAME.toml each, which says what was tested, where it comes from, and which modes are known.

`read` in that file names a function below, or one of a module beside it, NAME.py: it takes the paths of the files and the table `options`,
and returns data of modalscope; a simulated one returns the modes, too, and the Cramer-Rao bound where it is known.
"""

from __future__ import annotations

import hashlib
import os
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import modalscope as ms
from arena.child import loaded
from arena.sets import readers

__all__ = ["FIELDS", "ArenaSet", "Missing", "Reference", "all_sets"]

HERE = Path(__file__).parent

#: Where sets lie that do not come with the program; the shipped ones are in `examples/`.
PLACES = (HERE.parents[1] / "examples", Path(os.environ.get("MODALSCOPE_DATA") or HERE.parents[2] / "shared" / "data"))

#: What a test is, by how the structure was excited or measured.
FIELDS = ("hammer", "shaker", "ambient", "decay", "earthquake", "setups", "months", "full field", "control")

#: Who says what the modes are: nature's own answer, their authors' print, other programs', or nobody. The first two are scored.
SCORED, UNSCORED = ("exact", "published"), ("computed", "none")


class Missing(Exception):
    """A file is not here, or is another one than the set names."""


@dataclass(frozen=True)
class Reference:
    """The modes that are known of a set.

    Parameters
    ----------
    kind : {"exact", "published", "computed", "none"}
    frequencies : array, (n,)
        Hz.
    damping : array, (n,)
        Ratios; NaN where nobody gave one.
    tolerance : array, (n,)
        Hz, as published; NaN where there is none.
    reach : array, (n,)
        Hz: a mode within it is this one. The half-power half-bandwidth, or a wider one where the set says so.
    shapes : array, (l, n), optional
    complete : bool
        Whether these are all modes of the band: other ones are false then.
    bound : array, (3, n), optional
        Least deviations of frequencies (Hz) and damping ratios, and least means of 1 - MAC: the Cramer-Rao bound; NaN where it has none.
    """

    kind: str
    frequencies: np.ndarray
    damping: np.ndarray
    tolerance: np.ndarray
    reach: np.ndarray
    shapes: np.ndarray | None
    complete: bool
    bound: np.ndarray | None = None


@dataclass(frozen=True)
class ArenaSet:
    """One test: what its file says, `about`, read when asked."""

    name: str
    about: dict[str, Any]

    @property
    def scored(self) -> bool:
        """Whether its modes are known well enough to say who found them."""
        return self.about["reference"]["kind"] in SCORED

    @property
    def band(self) -> tuple[float, float] | None:
        """The band in Hz that all programs are given, if any."""
        return tuple(self.about["band"]) if "band" in self.about else None

    def paths(self) -> list[Path]:
        """Return its files; `Missing` where one is not here, or differs from what the set was made with."""
        found = []
        for name, digest in self.about.get("files", {}).items():
            path = next((place / name for place in PLACES if (place / name).is_file()), None)
            if path is None:
                raise Missing(f"{name} is not here: MODALSCOPE_DATA names its folder; from: {self.about['source']}")
            if hashlib.sha256(path.read_bytes()).hexdigest() != digest:
                raise Missing(f"{path} is not the file of this set: its sha256 differs from {digest[:12]}...")
            found.append(path)
        return found

    def read(self) -> tuple[Any, Reference]:
        """Return the data and what is known of their modes."""
        name = self.about["read"]
        own = HERE / f"{self.name}.py"
        module = loaded(str(own)) if own.is_file() else readers
        given = getattr(module, name)(self.paths(), **self.about.get("options", {}))
        data, *known = given if isinstance(given, tuple) else (given,)
        return data, self._reference(*known)

    def _reference(self, modes: ms.ModalModel | None = None, bound: np.ndarray | None = None) -> Reference:
        told = self.about["reference"]
        f = np.array(told.get("frequencies", []) if modes is None else modes.frequencies, float)
        damping = np.resize(told.get("damping_ratios", np.nan) if modes is None else modes.damping_ratios, f.size)
        tolerance = np.resize(told.get("tolerance_hz", np.nan), f.size)
        return Reference(
            kind=told["kind"],
            frequencies=f,
            damping=damping,
            tolerance=tolerance,
            reach=np.fmax(np.fmax(np.nan_to_num(damping) * f, told.get("found_within", 0.0) * f), tolerance),
            shapes=modes.shapes if modes is not None and len(modes.shapes) > 1 else None,
            complete=told.get("complete", False),
            bound=bound,
        )


@cache
def all_sets() -> dict[str, ArenaSet]:
    """Return every set by its name."""
    return {
        path.stem: ArenaSet(path.stem, tomllib.loads(path.read_text("utf-8"))) for path in sorted(HERE.glob("*.toml"))
    }
