"""Write what the runs gave: `arena/scores.json` and times apart, the pages of `docs/arena`, and a data package a set.

Pages are functions of the scores, and hold no times: a second run writes them to the digit.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import Any

from arena.programs import all_contestants
from arena.scores import totals
from arena.sets import FIELDS, HERE as SETS, ArenaSet, all_sets

__all__ = ["index", "package", "set_page", "with_totals", "write"]

ROOT = Path(__file__).parent
SCORES, TIMES = ROOT / "scores.json", ROOT / "times.json"
DOCS = ROOT.parent / "docs" / "arena"

OURS = "modalscope"

#: Frequencies that a cell of a page lists.
_SHOWN = 12

Told = dict[str, Any]


def runs_of(scores: Told, program: str, names: Iterable[str]) -> list[tuple[Told, Told]]:
    """Return the entries of sets with the runs of a program there."""
    entries = (scores["sets"][name] for name in names)
    return [(entry, entry["results"][program]) for entry in entries if program in entry["results"]]


def scored_in(scores: Told, field: str) -> list[str]:
    """Return the names of the scored sets of a field."""
    return [name for name, entry in scores["sets"].items() if entry["scored"] and entry["field"] == field]


def with_totals(scores: Told) -> Told:
    """Return scores in order, with who took part and the totals by field."""
    programs = {
        n: {"what": c.what, "settings": c.source, "requires": list(c.requires)} for n, c in all_contestants().items()
    }
    found = {f: {p: totals(runs_of(scores, p, scored_in(scores, f))) for p in programs} for f in FIELDS}
    found = {f: there for f, each in found.items() if (there := {p: t for p, t in each.items() if t["sets"]})}
    sets = {}
    for name, entry in sorted(scores["sets"].items()):
        runs = entry["results"]
        sets[name] = entry | {"results": {p: runs[p] for p in programs if p in runs}}
    return {"schema": "scores.schema.json", "programs": programs, "totals": found, "sets": sets}


def _of(hits: int, count: int, ends: list[float] | None = None) -> str:
    """Return a share in words, with its interval where that is one."""
    told = "" if ends is None or ends[0] == ends[1] else f" ({100 * ends[0]:.0f}-{100 * ends[1]:.0f} %)"
    return f"{hits} of {count}{told}" if count else "-"


def _number(x: float | None, scale: float = 1.0) -> str:
    return "-" if x is None else f"{scale * x:.3g}"


def table(head: str, rows: Iterable[Iterable[str]]) -> str:
    """Return a table; the names of its columns are separated by semicolons."""
    columns = head.split("; ")
    lines = [columns, ["---"] * len(columns), *([cell.replace("|", "/") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def page(*blocks: str) -> str:
    """Return a page of headings, paragraphs, lists and tables."""
    return "\n\n".join(block for block in blocks if block) + "\n"


_HEAD = (
    "program; tests; found; false; twice; wrong without a word; f error; damping error [%]; 1 - MAC; over the bound; "
    "intervals of f hold; of damping; numbers by a person"
)


def row_of(program: str, t: Told) -> list[str]:
    """Return the line of a program in the table of a field."""
    failed = f", {t['failed']} failed" if t["failed"] else ""
    cells = [f"**{program}**" if program == OURS else program, f"{t['sets']}{failed}"]
    cells += [_of(t["found"], t["modes"], t["found_interval"]), str(t["false"]), str(t["twice"])]
    cells.append(_of(t["wrong_without_a_word"], t["reported"]))
    cells += [_number(t["f_error"]), _number(t["zeta_error"], 100), _number(t["shape_error"])]
    cells.append(", ".join(map(_number, t["over_bound"])) if any(t["over_bound"]) else "-")
    cells += [_of(*t[f"{key}_held"], t[f"{key}_coverage"]) for key in ("f", "zeta")]
    return [*cells, str(t["human"])]


def worst(scores: Told, count: int = 3) -> list[tuple[str, Told]]:
    """Return the sets on which our own program does worst: missed, false, twice and wrong without a word, over the known modes."""
    told = {n: totals(runs_of(scores, OURS, [n])) for field in FIELDS for n in scored_in(scores, field)}
    bad = {
        n: (t["missed"] + t["false"] + t["twice"] + t["wrong_without_a_word"]) / t["modes"]
        for n, t in told.items()
        if t["modes"]
    }
    return [(n, told[n]) for n in sorted(bad, key=lambda n: (-bad[n], n))[:count]]


def better(scores: Told, field: str, program: str) -> str:
    """Return in words what another program does better than ours on the sets of a field that both did, or nothing.

    Errors are compared on the modes that both found.
    """
    results = {n: scores["sets"][n]["results"] for n in scored_in(scores, field)}
    names = [n for n, runs in results.items() if all(runs.get(p, {}).get("status") == "done" for p in (program, OURS))]
    a, b = (totals(runs_of(scores, p, names)) for p in (program, OURS))
    said = [f"finds {a['found']} modes, modalscope {b['found']}"] if a["found"] > b["found"] else []
    for words, keys in (("false or twice", ("false", "twice")), ("wrong without a word", ("wrong_without_a_word",))):
        x, y = (sum(t[key] for key in keys) for t in (a, b))
        said += [f"has {x} {words}, modalscope {y}"] if x < y else []
    pairs = [pair for n in names for pair in _both_found(results[n], program)]
    for key, words in (
        ("f_error", "frequency, in half bandwidths"),
        ("zeta_error", "damping, relative"),
        ("shape_error", "1 - MAC"),
    ):
        known = [(x[key], y[key]) for x, y in pairs if key in x and key in y]
        x, y = (median(column) for column in zip(*known, strict=True)) if known else (0, 0)
        said += [f"median error of {words}: {x:.2g}, modalscope {y:.2g}"] if x < y else []
    return (
        f"- **{program}**{_person(a)} on {_many(len(names), 'test')} with {_many(a['modes'], 'mode')}: {'; '.join(said)}."
        if said
        else ""
    )


def _both_found(results: Told, program: str) -> list[tuple[Told, Told]]:
    """Return the modes of a set that both found: of the program, and ours."""
    a, b = ({m["known"]: m for m in results[p].get("modes", []) if m["is"] == "found"} for p in (program, OURS))
    return [(a[known], b[known]) for known in a if known in b]


_TOP = """# The arena

{programs} programs in {variants} variants on {sets} tests, {measured} of them measured; {scored} are scored.
[The rules](rules.md), [the contestants](contestants.md), [times and memory](times.md),
[how to add a test, a program or a list of modes](add.md).

Which program for your test? Go to its kind: {kinds}.
Ambient is wind or traffic without a measured force; setups are several such records, between which sensors move. The first line there
names the programs that reported nothing false or twice; the table tells the errors, and how often a program was
**wrong without a word**. `make arena` measures all of it again, `make arena FIELD=ambient PROGRAM=koma` a part.

## Where modalscope is worst"""


def index(scores: Told) -> str:
    """Return the page of all tables."""
    sets, fields = scores["sets"], scores["totals"]
    counts = {"variants": len(scores["programs"]), "sets": len(sets), "scored": sum(s["scored"] for s in sets.values())}
    counts["programs"] = len({tuple(p["requires"]) for p in scores["programs"].values()})
    counts["measured"] = sum("(simulated)" not in s["title"] for s in sets.values())
    kinds = ", ".join(f"[{field}](#{field.replace(' ', '-')})" for field in fields)
    bad = [
        f"- [{sets[name]['title']}](sets/{name}.md): {t['found']} of {t['modes']} found, {t['false']} false, "
        f"{t['twice']} twice, {t['wrong_without_a_word']} wrong without a word."
        for name, t in worst(scores)
    ]
    blocks = [_TOP.format(kinds=kinds, **counts), "\n".join(bad), "## What others do better"]
    blocks.append("On the scored tests of a field that both did; errors on the modes that both found.")
    for field in fields:
        said = "\n".join(text for p in fields[field] if not _ours(p) and (text := better(scores, field, p)))
        blocks += [f"**{field.capitalize()}**", said or "- Nothing that is scored here."]
    for field, each in fields.items():
        links = ", ".join(f"[{n}](sets/{n}.md)" for n in scored_in(scores, field))
        rows = (row_of(p, t) for p, t in each.items())
        blocks += [f"## {field.capitalize()}", f"{in_short(each)}\n\nTests: {links}.", table(_HEAD, rows)]
    blocks += [
        "## Tests without a published reference",
        "They are not scored; their pages list what every program finds.",
    ]
    blocks.append("\n".join(f"- [{s['title']}](sets/{n}.md): {s['by']}." for n, s in sets.items() if not s["scored"]))
    hidden = ["rules", "contestants", "times", "add", *(f"sets/{n}" for n in sets)]
    return page(*blocks, "\n".join(["```{toctree}", ":hidden:", "", *hidden, "```"]))


def _ours(program: str) -> bool:
    """Tell modalscope and single rows of its table from other programs."""
    return program == OURS or program.startswith("row ")


def in_short(each: Told) -> str:
    """Return who found modes in a field with none false or twice, the most first; single rows of our table left out."""
    clean = [(p, t) for p, t in each.items() if t["found"] and not t["false"] + t["twice"]]
    clean.sort(key=lambda one: (-one[1]["found"] / one[1]["modes"], one[1]["human"]))
    told = [f"{p} found {t['found']} of {t['modes']}{_person(t)}" for p, t in clean if p == OURS or not _ours(p)]
    return f"Nothing false or twice: {'; '.join(told)}." if told else "No program found modes with none false or twice."


def _person(t: Told) -> str:
    """Return how many numbers a person gave, in brackets, or nothing."""
    return f" ({_many(t['human'], 'number')} by a person)" if t["human"] else ""


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'s'[: count != 1]}"


def contestants_page(scores: Told) -> str:
    """Return the page that says who takes part, with which settings and versions."""
    told = scores["programs"].items()
    rows = ([name, p["what"], p["settings"], ", ".join(p["requires"]) or "this one"] for name, p in told)
    return page("# Contestants", table("contestant; what it does; settings from; versions", rows))


def _list(values: list[float]) -> str:
    more = f" and {len(values) - _SHOWN} more" if len(values) > _SHOWN else ""
    return ", ".join(f"{x:.5g}" for x in values[:_SHOWN]) + more


#: How well the modes of a set are known.
_KNOWN = {"exact": "Known exactly", "published": "Published", "computed": "Computed, not scored", "none": "Not known"}


def set_page(name: str, s: Told) -> str:
    """Return the page of a set."""
    pairs = zip(s["known"], s["known_damping"], strict=True)
    known = ", ".join(f"{f:.6g}" + ("" if z is None else f" ({100 * z:.3g} %)") for f, z in pairs)
    said = [f"Field: {s['field']}. Source: {s['source']}. Licence: {s['licence']}. Cite: {s['citation']}."]
    said.append(f"**{_KNOWN[s['reference']]}**: {s['by']}." + (f" {known} Hz." if known else ""))
    said += [f"{key.capitalize()}: {s[key]}." for key in ("tolerance", "remark") if s[key]]
    rows = []
    for program, run in s["results"].items():
        if run["status"] == "done":
            kinds = [[m["f"] for m in run["modes"] if m["is"] == kind] for kind in ("found", "false", "twice", "other")]
            marked = str(sum(mode["marked"] for mode in run["modes"]))
            rows.append([program, _of(len(kinds[0]), len(s["known"])), *map(_list, kinds), marked])
        elif run["status"] != "cannot":
            rows.append([program, run["status"], run["text"], "", "", "", ""])
    lists = table("program; found; found [Hz]; false [Hz]; twice [Hz]; not known [Hz]; marked unsure", rows)
    return page(f"# {s['title']}", *said, f"![All lists over one stabilization diagram](../pictures/{name}.png)", lists)


def times_page(scores: Told, times: Told) -> str:
    """Return the page of CPU seconds and memory."""
    blocks = ["# Times and memory"]
    blocks.append("CPU seconds and megabytes above the data, one thread each, over the tests of a field.")
    for field in FIELDS:
        names, rows = [n for n, s in scores["sets"].items() if s["field"] == field], []
        for program in scores["programs"]:
            if spent := [times[n][program] for n in names if program in times.get(n, {})]:
                cpu, memory = ([each[key] for each in spent] for key in ("cpu", "memory"))
                rows.append([program, str(len(spent)), f"{median(cpu):.3g}", f"{max(cpu):.3g}", f"{max(memory):.0f}"])
        if rows:
            blocks += [f"## {field.capitalize()}", table("program; tests; median CPU s; largest; largest MB", rows)]
    return page(*blocks)


def package(one: ArenaSet, entry: Told) -> Told:
    """Return the description of a set as a Frictionless data package: its files, and the known modes in place."""
    columns = ("frequency_hz", "damping_ratio")
    rows = [dict(zip(columns, pair, strict=True)) for pair in zip(entry["known"], entry["known_damping"], strict=True)]
    files = enumerate(one.about.get("files", {}).items())
    modes = {"name": "known-modes", "profile": "tabular-data-resource", "data": rows}
    modes["schema"] = {"fields": [{"name": name, "type": "number"} for name in columns]}
    return {
        "profile": "data-package",
        "name": one.name.replace("_", "-"),
        "title": entry["title"],
        "description": f"{_KNOWN[entry['reference']]}: {entry['by']}",
        "licenses": [{"name": entry["licence"]}],
        "sources": [{"title": entry["source"]}, {"title": entry["citation"]}],
        "resources": [*({"name": f"file-{k}", "path": p, "hash": f"sha256:{d}"} for k, (p, d) in files), modes],
    }


def written(value: Any) -> str:
    """Return JSON, a mode a line."""
    if isinstance(value, Mapping) and any(isinstance(x, Mapping | list) for x in value.values()):
        return "{" + ",\n".join(f"{json.dumps(k)}: {written(x)}" for k, x in value.items()) + "}"
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return "[\n" + ",\n".join(map(json.dumps, value)) + "]"
    return json.dumps(value)


def write(scores: Told, times: Told) -> None:
    """Write the scores, the times, the pages and the data packages."""
    scores = with_totals(scores)
    texts = {SCORES: written(scores) + "\n", TIMES: written(dict(sorted(times.items()))) + "\n"}
    texts[DOCS / "index.md"] = index(scores)
    texts[DOCS / "contestants.md"] = contestants_page(scores)
    texts[DOCS / "times.md"] = times_page(scores, times)
    for name, entry in scores["sets"].items():
        texts[DOCS / "sets" / f"{name}.md"] = set_page(name, entry)
        told = package(all_sets()[name], entry)
        texts[SETS / f"{name}.datapackage.json"] = json.dumps(told, indent=1, ensure_ascii=False) + "\n"
    for path, text in texts.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
