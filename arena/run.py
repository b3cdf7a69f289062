"""Run programs on sets, and write what comes of it: `python -m arena.run [--field F] [--program P] [--set S]`, or `make arena`.

A run that is there and whose set, program and settings have not changed is not done again, so that a stopped one goes on where it was.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import modalscope as ms
from arena import pages
from arena.child import MONTHS, SECONDS
from arena.picture import draw
from arena.programs import PLACE, Contestant, all_contestants, ready
from arena.scores import judged, rounded
from arena.sets import FIELDS, ArenaSet, Missing, Reference, all_sets

__all__ = ["main", "stored", "tried"]

HERE = Path(__file__).parent

#: One thread of the linear algebra libraries, for everybody, and nothing drawn on a screen.
_ALONE = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL", "NUMBA")}
_ALONE |= {"MPLBACKEND": "Agg", "QT_QPA_PLATFORM": "offscreen", "PYTHONHASHSEED": "0", "PYTHONWARNINGS": "ignore"}


def stored(one: ArenaSet, data: Any, reference: Reference, folder: Path | None = None) -> Path:
    """Write a set as every program gets it, and return the path."""
    path = (folder or PLACE / "data") / f"{one.name}.npz"
    path.parent.mkdir(parents=True, exist_ok=True)
    f = [float(f"{x:.3g}") for x in reference.frequencies]
    answers = {"frequencies": f or None, "lowest frequency": min(f, default=None), "modes": len(f) or None}
    answers |= {"decimation": one.about.get("decimate", 1), "start": one.about.get("start", 0)}
    about = {"kind": one.about["kind"], "band": one.band, "answers": answers}
    parts = data.parts if isinstance(data, ms.Setups) else [data]
    about |= {"quantity": getattr(data, "quantity", None), "labels": [list(part.output_dofs) for part in parts]}
    setups = {f"setup{k:03d}": part.outputs for k, part in enumerate(parts)} if data is not parts[0] else {}
    names = ("sampling_rate",) if setups else ("outputs", "inputs", "values", "frequencies", "sampling_rate", *MONTHS)
    held = {name: np.asarray(value) for name in names if (value := getattr(parts[0], name, None)) is not None}
    np.savez(path, about=np.array(json.dumps(about)), **setups, **held)
    return path


def _digest(path: Path) -> str:
    """Return the digest of what programs are given, whichever way it was made; the file itself holds the time."""
    digest = hashlib.sha256()
    with np.load(path) as held:
        for name in held.files:
            digest.update(f"{name} {held[name].shape} ".encode() + held[name].tobytes())
    return digest.hexdigest()


def outcome(contestant: Contestant, one: ArenaSet, data: Path, digest: str) -> dict[str, Any]:
    """Return what a program gives on a set: from an earlier run where neither it nor the data changed, else from a new one."""
    if contestant.path.is_dir():
        return _handed(contestant, one)
    if one.about["kind"] not in contestant.takes:
        return {"status": "cannot", "text": f"not made for {one.about['kind']}", "human": 0}
    key = hashlib.sha256("\n".join((contestant.name, contestant.code(), digest)).encode()).hexdigest()
    kept = PLACE / "runs" / one.name / f"{contestant.name.replace(' ', '_')}.json"
    if kept.is_file() and (found := json.loads(kept.read_text("utf-8")))["key"] == key:
        return dict(found)
    wrong = ready(contestant)
    found = (
        {"status": "failed", "text": f"it does not install: {wrong}", "human": 0} if wrong else _run(contestant, data)
    )
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({"key": key, **found}), "utf-8")
    return found


def _run(contestant: Contestant, data: Path) -> dict[str, Any]:
    """Run a program in a process of its own."""
    result = data.with_name(f"{data.stem}.{contestant.name.replace(' ', '_')}.json")
    result.unlink(missing_ok=True)
    work = [contestant.python.absolute(), HERE / "child.py", contestant.path, contestant.name, data, result]
    try:
        subprocess.run(work, env=os.environ | _ALONE, timeout=4 * SECONDS, capture_output=True, cwd=PLACE)
    except subprocess.TimeoutExpired:
        return {"status": "limit", "text": f"more than {4 * SECONDS} seconds", "human": 0}
    if not result.is_file():
        text = f"ended by the system: more than {SECONDS} CPU seconds, or it broke down"
        return {"status": "limit", "text": text, "human": 0}
    found = dict(json.loads(result.read_text("utf-8")))
    result.unlink()
    return found


def _handed(contestant: Contestant, one: ArenaSet) -> dict[str, Any]:
    """Return a list of modes that somebody handed in (docs/arena/add.md says its columns)."""
    path = contestant.path / f"{one.name}.csv"
    if not path.is_file():
        return {"status": "cannot", "text": "not handed in", "human": 0}
    rows = list(csv.DictReader(path.read_text("utf-8-sig").splitlines()))

    def column(name: str) -> list[float | None]:
        return [float(row[name]) if row.get(name) else None for row in rows]

    found: dict[str, Any] = {"frequencies": column("frequency_hz"), "damping_ratios": column("damping_ratio")}
    for key in ("frequency", "damping"):
        found[f"{key}_interval"] = list(zip(column(f"{key}_low"), column(f"{key}_high"), strict=True))
    told = {"status": "done", "human": int(sum(x or 0 for x in column("human")))}
    return found | told | {"marked": [bool(row.get("marked")) for row in rows]}


def _entry(one: ArenaSet, reference: Reference) -> dict[str, Any]:
    """Return what the scores say of a set itself."""
    told = one.about["reference"]
    known, damping = ([rounded(x) for x in column] for column in (reference.frequencies, reference.damping))
    if one.band and not all(one.band[0] <= f <= one.band[1] for f in known):
        raise ms.DataError(f"a known mode lies beyond the band {one.band} Hz; widen it, or leave the mode out")
    entry = {name: one.about[name] for name in ("title", "field", "kind", "source", "licence", "citation")}
    entry |= {"reference": reference.kind, "by": told["by"], "complete": reference.complete, "scored": one.scored}
    entry |= {"tolerance": told.get("tolerance", ""), "remark": told.get("remark", "")}
    bound = () if reference.bound is None else reference.bound.T
    entry |= {"known": known, "known_damping": damping}
    return entry | {"bound": [[rounded(x, 4) for x in of_mode] for of_mode in bound]}


def tried(one: ArenaSet, contestants: Iterable[Contestant]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the entry of a set with all runs judged, and what they cost."""
    data, reference = one.read()
    entry, path = _entry(one, reference), stored(one, data, reference)
    digest = _digest(path)
    runs = {contestant.name: outcome(contestant, one, path, digest) for contestant in contestants}
    path.unlink()
    labels = getattr(data, "output_dofs", ())
    entry["results"] = {name: judged(reference, labels, one.band, run) for name, run in runs.items()}
    costs = {name: {x: rounded(run[x], 3) for x in ("cpu", "memory")} for name, run in runs.items() if "cpu" in run}
    return entry, costs


def main(arguments: list[str] | None = None) -> None:
    """Run what is asked, and write the scores and the pages."""
    parser = argparse.ArgumentParser(prog="python -m arena.run")
    parser.add_argument("--field", default="", choices=("", *FIELDS))
    parser.add_argument("--program", default="", help="programs whose names hold this")
    parser.add_argument("--set", default="", help="sets whose names hold this")
    parser.add_argument("--no-pictures", action="store_true", help="leave the pictures as they are")
    parser.add_argument("--store", type=Path, help="a folder: write the data as programs get them, and run nothing")
    asked = parser.parse_args(arguments)
    scores, times = (
        json.loads(path.read_text("utf-8")) if path.is_file() else {} for path in (pages.SCORES, pages.TIMES)
    )
    scores["sets"] = {name: entry for name, entry in scores.get("sets", {}).items() if name in all_sets()}
    contestants = [c for c in all_contestants().values() if asked.program.lower() in c.name.lower()]
    sets = [s for s in all_sets().values() if asked.set in s.name and asked.field in ("", s.about["field"])]
    if not (contestants and sets):
        parser.error("no test or no program has such a name: arena/sets/*.toml, and VARIANTS in arena/contestants/*.py")
    sets.sort(key=lambda one: not one.scored)  # what counts first
    if asked.store is not None:
        print(*(stored(one, *one.read(), asked.store) for one in sets), sep="\n")
        return
    for one in sets:
        try:
            entry, costs = tried(one, contestants)
        except (Missing, ms.DataError) as missing:
            print(f"{one.name}: left out: {missing}", flush=True)
            continue
        told = ", ".join(f"{n} {_short(r)}" for n, r in entry["results"].items() if r["status"] != "cannot")
        print(f"{one.name} ({len(entry['known'])} modes known): {told}", flush=True)
        entry["results"] = scores["sets"].get(one.name, {}).get("results", {}) | entry["results"]
        scores["sets"][one.name] = entry
        times[one.name] = times.get(one.name, {}) | costs
        pages.write(scores, times)
        if not asked.no_pictures:
            draw(one, pages.with_totals(scores)["sets"][one.name], pages.DOCS / "pictures" / f"{one.name}.png")


def _short(run: dict[str, Any]) -> str:
    if run["status"] != "done":
        return f"{run['status']} ({run['text']})"
    return "/".join(str(sum(mode["is"] == x for mode in run["modes"])) for x in ("found", "false", "twice", "other"))


if __name__ == "__main__":
    main()
