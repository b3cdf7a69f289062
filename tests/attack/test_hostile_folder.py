"""A folder of a stranger opens no file outside of it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from tests.attack.hostile import made
from tests.support import ROOT

pytest.importorskip("h5py", reason="the extra `hdf5` is not installed")

HOSTILE = (sys.executable, "-m", "tests.attack.hostile")

#: Where Python, its packages, the libraries of the system and what these keep of pictures lie.
OURS = (
    *(Path(place).resolve() for place in (sys.prefix, sys.base_prefix, sysconfig.get_path("purelib"))),
    *map(Path, ("/usr", "/lib", "/lib64", "/etc", "/proc", "/sys", "/dev/null", "/dev/urandom", "/dev/shm", ROOT)),
)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("hostile") / "place"
    made(place)
    return place


def outside(place: Path, opened: Iterable[str]) -> list[str]:
    """Return the paths that lie neither in the folder nor where Python, its packages and the results lie."""
    kept = [path for path in map(Path, opened) if not any(path.is_relative_to(folder) for folder in (place, *OURS))]
    odd = [path for path in kept if not {"matplotlib", "fontconfig", "__pycache__", "fonts"} & set(path.parts)]
    return [str(path) for path in odd] + [path for path in opened if Path(path).is_relative_to(place / "outside")]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the folders of the system are those of Linux")
def test_no_command_opens_a_file_outside_of_the_folder(place: Path, tmp_path: Path) -> None:
    note = tmp_path / "note"
    done = subprocess.run(
        [*HOSTILE, "run", str(place), str(note)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.count("['") > 40
    opened = set(note.read_text().splitlines())
    assert len(opened) > 100
    assert outside(place, opened) == []


@pytest.mark.study("robustness")
@pytest.mark.skipif(not shutil.which("strace"), reason="strace is not installed")
@pytest.mark.parametrize("words", [("run", "note"), ("show",)])
def test_no_library_and_no_process_opens_a_file_outside(
    place: Path, tmp_path: Path, words: tuple[str, ...], study: Any
) -> None:
    calls = "trace=open,openat,openat2,creat"
    traced = ["strace", "-f", "-qq", "-z", "-y", "-e", calls, "-o", str(tmp_path / "calls")]
    more = [str(tmp_path / word) for word in words[1:]]
    subprocess.run([*traced, *HOSTILE, words[0], str(place), *more], cwd=ROOT, capture_output=True, check=True)
    opened = set(re.findall(r"= \d+<(/[^>]*)>", (tmp_path / "calls").read_text()))
    odd = outside(place, opened - {str(tmp_path / "note")})
    table = study(
        f"files that a hostile folder opens ({words[0]})", "every file of it, all processes and libraries, by strace"
    )
    table.row("in the folder, of Python and of the system", len(opened) - len(odd))
    table.row("outside", len(odd), most=0)
    assert len(opened) > 100
    assert odd == []
