"""The jobs of `tools.results`: small ones of every kind, through the public face and the command line alone."""

from __future__ import annotations

import csv
import functools
import io
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

import modalscope as ms
from modalscope import systems
from modalscope.interfaces.cli import main

__all__ = ["JOBS", "Missing"]

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
DATA = Path(os.environ.get("MODALSCOPE_DATA") or ROOT.parent / "shared" / "data")

Told = dict[str, Any]

#: The public face, called as users do: what a call does not take is a result, too.
face: Any = ms
records: Any = ms.preprocess

#: Every job by its name, in the order in which they run.
JOBS: dict[str, Callable[[], Told]] = {}


class Missing(Exception):
    """Data that are not here."""


def job(name: str) -> Callable[[Callable[[], Told]], Callable[[], Told]]:
    """Take a function into the list of jobs."""

    def take(function: Callable[[], Told]) -> Callable[[], Told]:
        JOBS[name] = function
        return function

    return take


def measured(*parts: str) -> Path:
    """Return a file of the measured data that lie beside the project."""
    path = DATA.joinpath(*parts)
    if not path.exists():
        raise Missing(f"{'/'.join(parts)} is not there")
    return path


# ---------------------------------------------------------------------------------------------- what a result is, in numbers
def numbers(values: Any) -> Any:
    """Return an array as lists; null for what is no number."""
    if values is None:
        return None
    array = np.asarray(values)
    if array.dtype == bool or array.dtype.kind in "iu":
        return array.tolist()
    if array.ndim == 0:
        return float(array) if np.isfinite(array) else None
    return [numbers(each) for each in array]


def array(values: Any) -> Told:
    """Return the shape of an array, its norm, and that of its entries weighted by where they stand."""
    held = np.asarray(values)
    size = np.abs(np.nan_to_num(held)).ravel()
    weighted = size * (1 + np.arange(size.size) % 97)
    return {"shape": list(held.shape), "values": [float(np.linalg.norm(size)), float(np.linalg.norm(weighted))]}


def kinds(items: Iterable[Any]) -> list[str]:
    """Return the kinds of notes or findings, sorted."""
    return sorted(item.kind for item in items)


def modes(found: ms.ModalModel) -> Told:
    """Return what a list of modes says, without its texts."""
    shapes = np.abs(found.shapes)
    weights = np.arange(1.0, 1 + len(shapes)) @ shapes / np.linalg.norm(shapes, axis=0)
    told: Told = {
        "frequencies": numbers(found.frequencies),
        "damping": numbers(found.damping_ratios),
        "kinds": list(found.kinds),
        "deviations": {
            "frequency": numbers(found.frequencies_std),
            "damping": numbers(found.damping_ratios_std),
            "frequency_spread": numbers(found.frequencies_spread),
            "damping_spread": numbers(found.damping_ratios_spread),
            "frequency_repeatability": numbers(found.frequencies_repeatability),
            "damping_repeatability": numbers(found.damping_ratios_repeatability),
            "gain": numbers(found.gain),
            "shapes": numbers(weights),
        },
        "reasons": sorted({key for reason in found.reasons for key in reason}),
        "indicators": sorted(found.indicators),
        "left_out": {
            "frequencies": [candidate.frequency for candidate in found.left_out],
            "damping": [candidate.damping_ratio for candidate in found.left_out],
        },
        "harmonics": {"frequencies": [harmonic.frequency for harmonic in found.harmonics]},
        "notes": kinds(found.notes),
        "converged": found.converged,
    }
    # nothing was found, or it is not known
    told["deviations"] = {key: value for key, value in told["deviations"].items() if value is not None}
    return told


def settings(held: Any) -> list[str]:
    """Return the names of the options."""
    if isinstance(held, Mapping):
        return sorted(held)
    return sorted(each.name for each in fields(held)) if is_dataclass(held) else []


def diagram(found: ms.StabilizationDiagram) -> Told:
    """Return what a stabilization diagram holds."""
    return {
        "method": [found.method, found.domain],
        "orders": numbers(found.orders),
        "poles": int(found.poles.size),
        "stable": [
            int(np.sum(each))
            for each in (found.stable_frequency, found.stable_damping, found.stable_shape, found.stable)
        ],
        "indicators": sorted(found.indicators),
        "settings": settings(found.settings),
        "notes": kinds(found.notes),
        "fit": {"deviations": numbers(found.fit_errors)},
    }


def result(found: ms.Result) -> Told:
    """Return what a whole analysis gave."""
    return {
        "modes": modes(found.modes),
        "diagrams": [diagram(each) for each in found.diagrams],
        "findings": kinds(found.findings),
        "notes": kinds(found.notes),
        "analysis": settings(found.analysis),
        "options": sorted(found.analysis.options),
        "processing": len(getattr(found.data, "processing", ())),
    }


def identification(found: ms.Identification) -> Told:
    """Return what a method made of data at one order."""
    return {
        "method": [found.method, found.domain, found.order],
        "modes": modes(found.modes),
        "extraneous": len(found.extraneous),
        "fit": {"deviations": found.fit_error},
        "state_space": [
            list(np.shape(each)) for each in (found.state_space.A, found.state_space.B, found.state_space.C)
        ],
        "settings": settings(found.settings),
        "notes": kinds(found.notes),
    }


def data(found: Any) -> Told:
    """Return what a data object holds."""
    told: Told = {"class": type(found).__name__}
    for name in (
        "output_dofs",
        "input_dofs",
        "quantity",
        "quantities",
        "sampling_rate",
        "kind",
        "samples",
        "first_sample",
    ):
        value = getattr(found, name, None)
        told[name] = list(value) if isinstance(value, tuple) else value
    for name in ("outputs", "inputs", "values", "frequencies", "coherence", "variance"):
        if isinstance(getattr(found, name, None), np.ndarray):
            told[name] = array(getattr(found, name))
    for name in ("runs", "parts"):
        inside = getattr(found, name, None)
        if isinstance(inside, tuple):
            told[name] = [data(each) for each in inside if each is not found and is_dataclass(each)]
    told["processing"] = len(getattr(found, "processing", ()))
    return told


def keys(document: Any) -> Told:
    """Return the keys of a JSON document, by where they stand."""
    held: dict[str, set[str]] = {}

    def walk(value: Any, place: str) -> None:
        if isinstance(value, dict):
            held.setdefault(place, set()).update(value)
            for key, each in value.items():
                walk(each, f"{place}.{key}" if place else key)
        elif isinstance(value, list):
            for each in value:
                walk(each, f"{place}[]")

    walk(document, "")
    return {place: sorted(names) for place, names in sorted(held.items())}


def refusal(call: Callable[..., Any], *arguments: Any, **options: Any) -> Told:
    """Return how a call is refused."""
    try:
        call(*arguments, **options)
    except Exception as error:  # noqa: BLE001 - which one it is, is the result
        told: Told = {"error": type(error).__name__}
        if isinstance(error, ms.DataError):
            told["parts"] = [bool(error.asked), bool(error.found), bool(error.change)]
        return told
    return {"error": None}


def command(*words: str | Path) -> Told:
    """Run the command line; return its exit code, and how what it says is laid out."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code: Any = main([str(word) for word in words])
        except SystemExit as stop:
            code = stop.code
    text, remarks = out.getvalue(), err.getvalue()
    told: Told = {
        "exit": code,
        "says": bool(text.strip()),
        "complains": remarks.startswith("modalscope: "),
        "traceback": "Traceback" in remarks,
    }
    if text.startswith("{"):
        told["json"] = keys(json.loads(text))
    return told


def file(path: str | Path) -> Told:
    """Return what a written file holds: keys of JSON, head and rows of CSV, headings of a page, names and data of others."""
    path = Path(path)
    if not path.exists():
        return {"written": False}
    if path.suffix == ".json":
        return {"json": keys(json.loads(path.read_text("utf-8")))}
    if path.suffix == ".csv":
        rows = list(csv.reader(path.read_text("utf-8").splitlines()))
        return {"head": rows[0], "rows": len(rows), "columns": len(rows[-1])}
    if path.suffix == ".html":
        text = path.read_text("utf-8")
        return {"pictures": len(re.findall(r"<img|<svg", text)), "tables": text.count("<table")}
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as held:
            return {"arrays": {name: [str(held[name].dtype.kind), list(held[name].shape)] for name in sorted(held)}}
    return {"written": True, "back": whatever(face.read(path))}


def whatever(thing: Any) -> Told:
    """Return what was read, by what it is."""
    if isinstance(thing, ms.ModalModel):
        return modes(thing)
    if isinstance(thing, ms.StabilizationDiagram):
        return diagram(thing)
    if isinstance(thing, ms.Result):
        return result(thing)
    return data(thing)


# ---------------------------------------------------------------------------------------------------------- simulated data
@functools.cache
def frf(noise: float = 0.02, name: str = "chain5", seed: int = 1) -> ms.FrequencyResponse:
    """Return a noisy frequency response, on lines that an inverse transform can take."""
    return systems.build(name).frequency_response(np.arange(8, 321) / 40, noise=noise, seed=seed)


@functools.cache
def impulse(samples: int = 400) -> ms.ImpulseResponse:
    """Return a noisy impulse response."""
    return systems.build("chain5").impulse_response(samples, sampling_rate=20.0, noise=0.02, seed=2)


@functools.cache
def driven(runs: int = 1) -> Any:
    """Return records with white forces."""
    made = systems.build("chain5")
    return made.simulate(samples=3000, sampling_rate=20.0, noise=0.02, input_noise=0.0, runs=runs, seed=3)


@functools.cache
def ambient(samples: int = 6000) -> ms.Signals:
    """Return a record without inputs."""
    return systems.build("chain5").simulate(inputs="ambient", samples=samples, sampling_rate=20.0, noise=0.05, seed=4)


def tables() -> list[Any]:
    """Return the rows of the table of methods."""
    return list(face.methods())


def by_rows(thing: Any, wanted: Callable[[Any], bool], **options: Any) -> Told:
    """Identify and select by every row of the table that is wanted."""
    told: Told = {}
    for row in filter(wanted, tables()):
        choice = {"method": row.name, "domain": row.domain, **options}
        name = f"{row.name}/{row.domain}"
        told[name] = {"identify": attempt(lambda c=choice: identification(face.identify(thing, order=12, **c)))}
        told[name]["select"] = attempt(lambda c=choice: selected(thing, orders=range(4, 25, 4), **c))
    return told


def attempt(call: Callable[..., Told]) -> Told:
    """Return what a call gives, or that it is refused."""
    try:
        return call()
    except ms.DataError as error:
        return {"refused": [bool(error.asked), bool(error.found), bool(error.change)]}


def selected(thing: Any, choice: Mapping[str, Any] | None = None, **options: Any) -> Told:
    """Make a diagram and select."""
    made = face.stabilize(thing, **options)
    return {"diagram": diagram(made), "modes": modes(face.select(made, **(choice or {})))}


# ------------------------------------------------------------------------------------------------------------------- rows
def takes(row: Any) -> str:
    """Return the name of what a row takes."""
    return str(row.takes.name)


@job("rows: the table")
def _() -> Told:
    told: Told = {}
    for index, row in enumerate(tables()):
        told[str(index)] = [row.name, row.domain, takes(row), *row.forms, *sorted(row.fixed), *row.aliases]
    return told


@job("rows: impulse response, time")
def _() -> Told:
    return by_rows(impulse(), lambda row: row.domain == "time" and takes(row) == "SAMPLES")


@job("rows: impulse response, z")
def _() -> Told:
    return by_rows(impulse(200), lambda row: row.domain == "z" and takes(row) == "RESPONSE")


@job("rows: frequency response, z")
def _() -> Told:
    return by_rows(frf(), lambda row: row.domain == "z" and takes(row) in {"RESPONSE", "LINES"})


@job("rows: frequency response, s")
def _() -> Told:
    return by_rows(frf(), lambda row: row.domain == "s" and takes(row) == "CONTINUOUS")


@job("rows: frequency response, time")
def _() -> Told:
    return by_rows(frf(), lambda row: row.domain == "time" and takes(row) == "SAMPLES")


@job("rows: records on their lines")
def _() -> Told:
    return by_rows(driven(), lambda row: takes(row) == "RECORDS", route="records", deviations=False)


@job("rows: records with inputs, past")
def _() -> Told:
    return by_rows(driven(), lambda row: takes(row) == "DRIVEN")


@job("rows: ambient record, past")
def _() -> Told:
    return by_rows(ambient(), lambda row: takes(row) == "PAST")


@job("rows: ambient record, correlations")
def _() -> Told:
    return by_rows(ambient(), lambda row: takes(row) in {"SAMPLES", "LINES"}, deviations=False)


@job("rows: by alias and unknown")
def _() -> Told:
    aliases = ("polymax", "ssi-cov", "itd", "ERA-FD", "cva", "moesp", "prony", "nonsense")
    things = {"frf": frf(), "impulse": impulse(), "ambient": ambient()}
    return {
        alias: {
            name: attempt(
                lambda a=alias, t=thing: {"order": face.identify(t, method=a, order=8, deviations=False).order}
            )
            for name, thing in things.items()
        }
        for alias in aliases
    }


# ---------------------------------------------------------------------------------------------------------------- options
@job("options: of Hankel matrices")
def _() -> Told:
    choices: list[dict[str, Any]] = [
        {"method": "era", "block_rows": 20, "block_columns": 40},
        {"method": "era", "form": "controllable"},
        {"method": "era", "form": "smaller"},
        {"method": "era", "reduction": "markov"},
        {"method": "era", "reduction": "projection"},
        {"method": "prce", "form": "observable"},
        {"method": "prce", "form": "controllable", "block_columns": 8},
        {"method": "least_squares", "row_shifts": (0, 1, 3, 5, 8, 12)},
        {"method": "era", "row_subsets": [[0, 1]] * 33},
        {"method": "era", "factorization": "gram"},
        {"method": "era", "factorization": "lanczos"},
        {"method": "era", "factorization": "dense"},
        {"method": "polyreference", "reduction": "projection"},
        {"method": "polyreference", "reduction": "markov"},
        {"method": "era", "factorization": "randomized"},
        {"method": "era", "block_rows": -3},
        {"method": "era", "weights": "coherence"},
    ]
    return {
        str(index): attempt(lambda c=choice: identification(face.identify(impulse(200), domain="time", order=10, **c)))
        for index, choice in enumerate(choices)
    }


@job("options: of lines")
def _() -> Told:
    choices: list[dict[str, Any]] = [
        {"method": "lscf", "domain": "z", "weights": "level"},
        {"method": "era", "domain": "z", "weights": "coherence"},
        {"method": "era", "domain": "z", "basis": "orthogonal"},
        {"method": "era", "domain": "s", "basis": "powers"},
        {"method": "era", "domain": "z", "source": "elimination"},
        {"method": "era", "domain": "z", "source": "samples"},
        {"method": "alternate", "domain": "s", "block_rows": 9},
        {"method": "alternate", "domain": "z", "band": (0.5, 4.0)},
        {"method": "alternate", "domain": "z", "exclude": "1"},
        {"method": "alternate", "domain": "z", "exclude": [frf().output_dofs[0]]},
        {"method": "lscf", "domain": "z", "row_shifts": (0, 2, 4)},
    ]
    told = {
        str(index): attempt(lambda c=choice: identification(face.identify(frf(), order=10, **c)))
        for index, choice in enumerate(choices)
    }
    estimated = face.estimate_frf(driven(), segment=400)
    for weights in ("coherence", "variance", "level"):
        options: dict[str, Any] = {"method": "alternate", "domain": "z", "weights": weights}
        told[weights] = attempt(lambda o=options: identification(face.identify(estimated, order=10, **o)))
    return told


@job("options: orders of a sweep")
def _() -> Told:
    held = face.sweep(impulse(200), method="alternate", domain="time", orders=range(2, 30, 4))
    return {str(each.order): {"damping": numbers(each.modes.damping_ratios)} for each in held}


# ------------------------------------------------------------------------------------------------------------ diagrams, lists
@job("select: what is asked")
def _() -> Told:
    made = face.stabilize(frf(), method="lscf", orders=range(2, 31, 2))
    known = systems.build("chain5").modes()
    return {
        "all": modes(face.select(made)),
        "frequencies": modes(face.select(made, frequencies=[0.906, 4.17])),
        "take": attempt(lambda: modes(face.select(made, take=[7.0]))),
        "refuse": modes(face.select(made, refuse=[2.64])),
        "reference": attempt(lambda: modes(face.select(made, reference=known))),
        "far": attempt(lambda: modes(face.select(made, frequencies=[123.0]))),
    }


@job("select: tolerances and a band")
def _() -> Told:
    loose = {"tolerances": {"frequency": 0.05, "damping": 0.3, "shape": 0.1}}
    return {
        "band": selected(frf(), orders=range(2, 31, 4), band=(0.5, 4.8)),
        "loose": attempt(lambda: selected(frf(), orders=range(2, 31, 4), **loose)),
    }


@job("select: much noise")
def _() -> Told:
    return selected(frf(0.3), orders=range(2, 41, 4))


@job("select: close modes")
def _() -> Told:
    return selected(frf(0.02, "close4"), orders=range(2, 31, 4))


@job("select: heavy damping")
def _() -> Told:
    return selected(frf(0.02, "heavy4"), orders=range(2, 31, 4))


@job("select: a beam with many modes")
def _() -> Told:
    beam = systems.clamped_beam(12)
    lines = np.linspace(5, 900, 500)
    measured_at: dict[str, Any] = {"outputs": range(0, 24, 6), "inputs": [0, 12]}
    return {
        str(noise): selected(beam.frequency_response(lines, noise=noise, seed=7, **measured_at), orders=range(4, 45, 4))
        for noise in (0.02, 0.2)
    }


@job("select: several seeds and rows")
def _() -> Told:
    told: Told = {}
    for seed in range(3):
        for row in (("lscf", "z"), ("alternate", "z"), ("era", "s"), ("prce", "time")):
            name = "/".join((str(seed), *row))
            thing = frf(0.15, "over4" if seed == 1 else "ring5", seed)
            options: dict[str, Any] = {"method": row[0], "domain": row[1], "orders": range(2, 41, 2)}
            told[name] = attempt(lambda t=thing, o=options: selected(t, **o))
    return told


@job("select: one input, one output")
def _() -> Told:
    one = frf(0.1).select(outputs=[1], inputs=[0])
    return {
        "frequency response": selected(one, orders=range(2, 31, 2)),
        "impulse response": selected(impulse().select(outputs=[1], inputs=[0]), orders=range(2, 31, 2)),
    }


@job("select: bands merged")
def _() -> Told:
    bands = [(0.2, 3.4), (3.0, 8.0)]
    parts = [face.select(face.stabilize(frf(), orders=range(2, 25, 2), band=band)) for band in bands]
    return modes(face.merge_bands(parts, bands))


# ---------------------------------------------------------------------------------------------------------- whole analyses
@job("analyze: frequency response")
def _() -> Told:
    return result(face.analyze(frf(), orders=range(2, 41, 2)))


@job("analyze: frequency response, all by itself")
def _() -> Told:
    return result(face.analyze(frf(0.05, "ring5")))


@job("analyze: choices")
def _() -> Told:
    short = {"orders": range(2, 31, 4)}
    return {
        "unrefined": result(face.analyze(frf(), refine=False, **short)),
        "bands": result(face.analyze(frf(), band=[(0.2, 3.4), (3.0, 8.0)], **short)),
        "frequencies": result(face.analyze(frf(), frequencies=[0.906, 5.355], **short)),
        "refuse": result(face.analyze(frf(), refuse=[2.64], method="alternate", domain="z", **short)),
    }


@job("analyze: impulse response")
def _() -> Told:
    return result(face.analyze(impulse(), orders=range(2, 31, 4)))


@job("analyze: free decay")
def _() -> Told:
    decay = systems.build("chain5").free_decay(600, velocity=[1, 0, 0, 0, 1], sampling_rate=20.0)
    return result(face.analyze(systems.add_noise(decay, 0.02, 5), orders=range(2, 31, 4)))


@job("analyze: ambient record")
def _() -> Told:
    return result(face.analyze(ambient(), orders=range(2, 41, 4)))


@job("analyze: ambient record with a harmonic")
def _() -> Told:
    record = ambient()
    turning = 0.5 * np.std(record.outputs) * np.sin(2 * np.pi * 3.3 * np.arange(record.samples) / record.sampling_rate)
    made = face.Signals(outputs=record.outputs + turning[:, None], sampling_rate=record.sampling_rate)
    return result(face.analyze(made, orders=range(2, 41, 4)))


@job("analyze: record with inputs")
def _() -> Told:
    return result(face.analyze(driven(), orders=range(2, 31, 4)))


@job("analyze: routes of a record with inputs")
def _() -> Told:
    told: Told = {}
    for route in ("auto", "records", "frf", "markov", "subspace", "nonsense"):
        options: dict[str, Any] = {"route": route, "orders": range(4, 25, 4), "refine": False}
        told[route] = attempt(lambda o=options: result(face.analyze(driven(), **o)))
    return told


@job("analyze: runs")
def _() -> Told:
    runs = driven(2)
    held = face.Records(
        runs=[
            systems.build("chain5").simulate(samples=n, sampling_rate=20.0, noise=0.02, seed=seed)
            for n, seed in ((1500, 11), (1700, 12))
        ]
    )
    return {
        "equal": result(face.analyze(runs, orders=range(4, 25, 4))),
        "unequal": result(face.analyze(held, orders=range(4, 25, 4), refine=False)),
    }


@job("analyze: setups")
def _() -> Told:
    parts = [
        systems.build("chain5").simulate(
            inputs="ambient", samples=5000, sampling_rate=20.0, outputs=[0, other], noise=0.05, seed=other
        )
        for other in (2, 4)
    ]
    held = face.Setups(parts=parts)
    return {
        "setups": result(face.analyze(held, orders=range(4, 31, 4))),
        "apart": attempt(lambda: result(face.analyze(held, apart=True, orders=range(4, 31, 4)))),
        "data": data(held),
    }


@job("analyze: exact data")
def _() -> Told:
    exact = systems.build("chain5").frequency_response(np.linspace(0.2, 8, 200))
    found = face.analyze(exact, orders=range(2, 21, 2))
    return {"frequencies": numbers(found.modes.frequencies), "notes": kinds(found.notes)}


@job("analyze: dead and faulty channels")
def _() -> Told:
    values = np.array(ambient().outputs)
    values[:, 1] = 0.0
    values[2000:2200, 2] = values[2000, 2]
    top = 1.5 * np.std(values[:, 3])
    values[:, 3] = np.clip(values[:, 3], -top, top)
    record = face.Signals(outputs=values, sampling_rate=20.0)
    return {
        "findings": kinds(records.examine(record)),
        "refused": refusal(face.analyze, record, orders=range(4, 25, 4)),
        "result": attempt(lambda: result(face.analyze(record, exclude=["y2"], orders=range(4, 25, 4)))),
    }


# ---------------------------------------------------------------------------------------------------- refining, certifying
@functools.cache
def short() -> ms.Result:
    """Return a short analysis."""
    found: ms.Result = face.analyze(frf(), orders=range(2, 25, 4))
    return found


@job("refine: groups, fixed, complete")
def _() -> Told:
    start = short().modes
    few = start[:4]
    return {
        "again": modes(face.refine(frf(), start)),
        "fixed": modes(face.refine(frf(), start, fixed=start.poles[:1])),
        "complete": modes(face.refine(frf(), few, complete=True)),
        "ungrouped": modes(face.refine(frf(), start, groups=None)),
        "known": modes(face.refine(frf(), systems.build("chain5").modes(quantity="displacement"))),
    }


@job("refine: records")
def _() -> Told:
    start = systems.build("chain5").modes()
    return {
        "driven": attempt(lambda: modes(face.refine(driven(), start))),
        "ambient": attempt(lambda: modes(face.refine(ambient(), start))),
    }


@job("refine: samples")
def _() -> Told:
    found = face.identify(impulse(200), order=12).modes
    return attempt(lambda: modes(face.refine(impulse(200), found)))


@job("certify: few replicates")
def _() -> Told:
    told: Told = {}
    for name, select in (("refined", False), ("selected", True)):
        found = face.certify(short(), replicates=4, select=select)
        told[name] = {
            "modes": modes(found.modes),
            "found": numbers(found.found),
            "holds": numbers(found.holds),
            "order": found.order,
            "intervals": {key: {"deviations": numbers(value)} for key, value in found.frequency.items()},
            "notes": kinds(found.notes),
        }
    return told


@job("validate: inputs and outputs")
def _() -> Told:
    told: Told = {}
    for leaving in ("inputs", "outputs"):
        told[leaving] = attempt(lambda side=leaving: validation(face.validate(frf(), short().modes, leaving=side)))
    return told


def validation(found: ms.Validation) -> Told:
    """Return what leaving parts out showed."""
    return {
        "parts": list(found.parts),
        "white": bool(found.white),
        "deviations": [numbers(found.fit_errors), numbers(found.frequencies_std), found.correlation],
        "notes": kinds(found.notes),
    }


@job("replay: document and data")
def _() -> Told:
    face.write("test.npz", frf())
    first = face.analyze("test.npz", orders=range(2, 25, 4))
    face.write("modes.json", first)
    face.write("choices.analysis.json", first.analysis)
    other = systems.build("chain5").frequency_response(np.linspace(0.2, 8, 300), noise=0.02, seed=9)
    return {
        "first": result(first),
        "again": modes(face.replay("modes.json").modes),
        "choices": modes(face.replay("choices.analysis.json").modes),
        "others": attempt(lambda: modes(face.replay(first.analysis, other, force=True).modes)),
        "refused": refusal(face.replay, first.analysis, other),
        "files": [file("modes.json"), file("choices.analysis.json"), file("test.npz")],
    }


@job("compare: frequency response")
def _() -> Told:
    return comparison(face.compare(frf(), orders=range(4, 25, 4), workers=1))


@job("compare: some methods on a record")
def _() -> Told:
    rows = ["era", "alternate/time", "ssi-data"]
    return attempt(lambda: comparison(face.compare(ambient(), rows, orders=range(4, 25, 4), workers=1)))


def comparison(found: ms.Comparison) -> Told:
    """Return what all methods together say."""
    return {
        "methods": [each.name for each in found.results],
        "modes": modes(found.modes),
        "each": {each.name: None if each.modes is None else modes(each.modes) for each in found.results},
        "failed": sorted(each.name for each in found.results if each.failure),
        "groups": [len(each.members) for each in found.groups],
        "unconfirmed": [len(each.members) for each in found.unconfirmed],
        "trust": [[each.grade, *sorted(cause.name for cause in each.causes)] for each in found.trust],
        "causes": sorted(each.name for each in found.findings),
        "disagreements": [[each.mode, *each.methods] for each in found.disagreements],
        "scatter": {"deviations": [numbers(found.scatter.frequency), numbers(found.scatter.damping)]},
        "fit": {"deviations": found.fit_error},
        "notes": kinds(found.notes),
    }


@job("realize: state-space models")
def _() -> Told:
    told: Told = {}
    for name, thing in (("frf", frf()), ("impulse", impulse()), ("record", driven())):
        model = face.realize(thing, order=10)
        poles = np.sort(np.abs(model.continuous_poles))
        told[name] = {"shape": [list(np.shape(each)) for each in (model.A, model.B, model.C, model.D)], "dt": model.dt}
        told[name]["frequencies"] = numbers(poles / (2 * np.pi))
    face.write("model.npz", face.realize(impulse(), order=10))
    told["file"] = file("model.npz")
    exact = systems.build("chain5").state_space(outputs=range(5), inputs=range(5))
    told["motion"] = attempt(lambda: {"values": numbers(face.equations_of_motion(exact).frequencies)})
    return told


@job("modes: residues, pairs, merged")
def _() -> Told:
    found, known = short().modes, systems.build("chain5").modes()
    pairs = face.pair_modes(found, known)
    return {
        "residues": modes(face.fit_residues(frf(), found)),
        "normal": modes(face.fit_residues(frf(), found, kind="real", residuals=False)),
        "pairs": {"first": numbers(pairs.first), "second": numbers(pairs.second), "deviations": numbers(pairs.mac)},
        "mac": {"deviations": numbers(face.mac(found))},
        "comac": {"deviations": numbers(face.comac(found.shapes[:, pairs.first], known.shapes[:, pairs.second]))},
        "merged": modes(face.merge_modes([found, face.identify(frf(), order=12).modes])),
        "dwell": attempt(lambda: modes(face.tuned_dwell(frf()).modes)),
        "shapes": modes(face.ods(frf(), [0.9, 2.6])),
        "rebuilt": array(found.frequency_response(np.linspace(0.5, 7, 40)).values),
        "indicators": [array(face.indicators.cmif(frf().values)), *map(array, face.indicators.mmif(frf()))],
    }


# -------------------------------------------------------------------------------------------------------- records to responses
@job("estimate_frf: estimators")
def _() -> Told:
    record = driven()
    told: Told = {name: data(face.estimate_frf(record, estimator=name)) for name in ("h1", "h2", "hv", "lpm", "lrm")}
    told["segments"] = data(face.estimate_frf(record, segment=400, overlap=0.25, window="hann"))
    told["zoom"] = attempt(lambda: data(face.estimate_frf(record, segment=500, zoom=(2.0, 3.5))))
    told["unknown"] = refusal(face.estimate_frf, record, estimator="h9")
    told["unforced"] = refusal(face.estimate_frf, ambient())
    return told


@job("estimate_frf: periodic forces")
def _() -> Told:
    rng = np.random.default_rng(6)
    forces = np.tile(rng.standard_normal((2, 256, 2)), (1, 8, 1))
    made = systems.build("chain5").simulate(inputs=forces, sampling_rate=20.0, noise=0.01, seed=6)
    found = face.estimate_frf(made, excitation="periodic", period=256, settle=2)
    return {"response": data(found), "modes": attempt(lambda: selected(found, orders=range(2, 25, 4)))}


@job("estimate_correlation: ways")
def _() -> Told:
    first = ambient().output_dofs[0]
    return {
        "plain": data(face.estimate_correlation(ambient())),
        "lags": data(face.estimate_correlation(ambient(), lags=120, references=[first])),
        "segments": attempt(lambda: data(face.estimate_correlation(ambient(), lags=100, segment=400, window="hann"))),
        "half": data(records.half_spectra(face.estimate_correlation(ambient(), lags=128))),
        "refused": refusal(face.estimate_correlation, ambient(), references=["nowhere"]),
    }


@job("estimate_markov: ways")
def _() -> Told:
    found = face.estimate_markov(driven(), samples=150)
    return {
        "okid": data(found),
        "order": data(face.estimate_markov(driven(), observer_order=12, samples=100)),
        "modes": selected(found, orders=range(4, 25, 4)),
    }


@job("preprocess: records changed")
def _() -> Told:
    record = ambient()
    spectrum = records.decomposition(record, segment=512)
    return {
        "detrended": data(records.detrend(record)),
        "filtered": data(records.filter_band(record, 0.5, 4.0)),
        "decimated": data(records.decimate(record, 2)),
        "integrated": data(records.integrate(record, lowest=0.3)),
        "differentiated": data(records.differentiate(records.integrate(record, times=2, lowest=0.3))),
        "machines": data(records.remove_harmonics(record, [3.3])),
        "spectra": [array(spectrum.frequencies), array(spectrum.singular_values), spectrum.averages],
        "blocks": settings(records.correlation_blocks(record, lags=60)),
    }


@job("modes: scaled by a mass")
def _() -> Told:
    light = systems.spring_chain(4)
    heavy = systems.Structure(
        mass=light.mass + np.diag([0.0, 2.0, 0, 0]), stiffness=light.stiffness, damping=light.damping, dofs=light.dofs
    )
    masses = {light.dofs[1]: 2.0}
    return {"scaled": attempt(lambda: modes(face.scale_by_mass(light.modes(), heavy.modes(), masses)))}


@job("report: pages")
def _() -> Told:
    told: Told = {}
    things: dict[str, Any] = {
        "result": short(),
        "diagram": (short().modes, short().diagram),
        "comparison": face.compare(frf(), ["lscf", "alternate/z"], orders=range(4, 17, 4), workers=1),
    }
    for name, thing in things.items():
        face.report(thing, f"{name}.html", title="A page")
        told[name] = file(f"{name}.html")
    return told


@job("merge: runs and setups")
def _() -> Told:
    parts = [ambient().select(outputs=each) for each in ([0, 1], [0, 2])]
    other = systems.build("chain5").simulate(samples=1000, sampling_rate=20.0, seed=21)
    return {
        "setups": data(face.merge(parts)),
        "runs": data(face.merge([other, other])),
        "responses": attempt(lambda: data(face.merge([frf().select(inputs=[0]), frf().select(inputs=[1])]))),
        "refused": refusal(face.merge, [frf(), ambient()]),
    }


# ------------------------------------------------------------------------------------------------------------------- files
@job("files: every format and back")
def _() -> Told:
    things: dict[str, Any] = {
        "frf": frf(),
        "impulse": impulse(),
        "record": driven(),
        "ambient": ambient(1000),
        "modes": short().modes,
        "result": short(),
        "diagram": short().diagram,
        "structure": systems.build("chain5").geometry,
    }
    told: Told = {}
    for name, thing in things.items():
        for suffix in ("npz", "h5", "mat", "uff", "csv", "json"):
            path = f"{name}.{suffix}"

            def there_and_back(path: str = path, thing: Any = thing) -> Told:
                face.write(path, thing)
                return {
                    "back": attempt(lambda: whatever(face.read(path))),
                    "file": file(path) if path[-1] != "5" else {},
                }

            told[path] = attempt(there_and_back)
    return told


@job("files: tables, stored records and frames")
def _() -> Told:
    import pandas

    record = driven()
    face.write("record.csv", record)
    table = (
        np.column_stack([np.arange(record.samples) / record.sampling_rate, record.inputs[0], record.outputs[0]])
        if (record.outputs.ndim == 3)
        else np.column_stack([np.arange(record.samples) / record.sampling_rate, record.inputs, record.outputs])
    )
    np.savetxt("plain.txt", table[:800], delimiter="\t")
    index = pandas.Index(table[:500, 0], name="time [s]")
    frame = pandas.DataFrame(table[:500, 3:], index=index, columns=list("abcdefgh")[: table.shape[1] - 3])
    face.write("record.h5", ambient(1000))
    return {
        "csv": data(face.read("record.csv")),
        "text": data(face.read("plain.txt", columns="time=1,in=2-3,out=4-7", quantity="acceleration")),
        "rate": attempt(lambda: data(face.read("plain.txt", sampling_rate=20.0, ignore=[1]))),
        "frame": attempt(lambda: data(face.from_frame(frame))),
        "stored": attempt(lambda: data(face.read("record.h5", stored=True))),
        "analysed": attempt(lambda: result(face.analyze("record.h5", orders=range(4, 17, 4)))),
    }


@job("files: bad ones")
def _() -> Told:
    Path("empty.csv").write_text("")
    Path("words.csv").write_text("a,b\nc,d\n")
    Path("cut.npz").write_bytes(b"PK\x03\x04 and no more")
    Path("list.json").write_text("[1, 2]")
    Path("strange.xyz").write_text("1 2 3")
    Path("half.uff").write_text("    -1\n    58\nno more")
    names = ("empty.csv", "words.csv", "cut.npz", "list.json", "strange.xyz", "half.uff", "nowhere.npz", ".")
    return {name: {"read": refusal(face.read, name), "info": command("info", name)} for name in names}


@job("files: bad data")
def _() -> Told:
    broken = np.array(ambient().outputs)
    broken[100, 0] = np.nan
    lines = np.linspace(1, 2, 5)
    return {
        "nan": refusal(lambda: face.analyze(face.Signals(outputs=broken, sampling_rate=20.0))),
        "short": refusal(lambda: face.analyze(face.Signals(outputs=broken[:8], sampling_rate=20.0))),
        "rate": refusal(lambda: face.Signals(outputs=np.zeros((20, 2)), sampling_rate=-1.0)),
        "lines": refusal(lambda: face.FrequencyResponse(values=np.zeros((4, 1, 1), complex), frequencies=lines)),
        "order": refusal(lambda: face.identify(frf(), order=0)),
        "large": refusal(lambda: face.identify(frf(), order=100000)),
        "option": refusal(lambda: face.identify(frf(), colour="red")),
        "band": refusal(lambda: face.analyze(frf(), band=(100.0, 200.0))),
        "type": refusal(lambda: face.analyze(3)),
        "domain": refusal(lambda: face.identify(frf(), method="prce", domain="s")),
    }


# ----------------------------------------------------------------------------------------------------------- the examples
@job("examples: beam, some hammer points")
def _() -> Told:
    beam = face.read(EXAMPLES / "beam_hammer" / "beam_hammer.uff")
    part = beam.select(inputs=[0, 2])
    return {
        "data": data(beam),
        "findings": kinds(records.examine(beam)),
        "result": result(face.analyze(part, band=(100.0, 1200.0), orders=range(2, 41, 4))),
    }


@job("examples: palisaden")
def _() -> Told:
    test = face.read(EXAMPLES / "palisaden" / "palisaden.npz")
    found = face.analyze(test, band=(0.3, 6.0), orders=range(4, 41, 4))
    return {"data": data(test), "findings": kinds(records.examine(test)), "result": result(found)}


@job("examples: impact hits")
def _() -> Told:
    hits = face.read(EXAMPLES / "impact_hits" / "impact_hits.npz")
    response = face.estimate_frf(hits)
    return {
        "data": data(hits),
        "findings": kinds(records.examine(hits)),
        "response": data(response),
        "result": result(face.analyze(response, band=(300.0, 1000.0), orders=range(2, 31, 4))),
    }


# ------------------------------------------------------------------------------------------------------------ measured data
@job("measured: bridge")
def _() -> Told:
    with np.load(measured("bridge_ssicov", "ssicov.npz")) as held:
        record = face.Signals(outputs=held["y"][:15000], sampling_rate=float(held["fs"]))
    found = face.analyze(record, band=(0.1, 1.5), orders=range(4, 33, 4))
    return {"findings": kinds(records.examine(record)), "result": result(found)}


@job("measured: frame")
def _() -> Told:
    made = face.Signals(outputs=np.load(measured("shear_frame", "data_shearframe.npy"))[:6000], sampling_rate=12.0)
    return {"data": data(made), "result": result(face.analyze(made, orders=range(4, 33, 4)))}


@job("measured: building, setups")
def _() -> Told:
    with np.load(measured("building_3sl", "tsl3.npz")) as held:
        heard, rate = held["y"][:, :12000], float(held["fs"])
    parts = [
        face.Signals(
            outputs=run[:, [0, 1, 2, 3 + k, 6 + k]], sampling_rate=rate, output_dofs=["a", "b", "c", f"d{k}", f"e{k}"]
        )
        for k, run in enumerate(heard)
    ]
    setups = face.Setups(parts=parts)
    return {
        "findings": kinds(records.examine(setups)),
        "result": attempt(lambda: result(face.analyze(setups, band=(0.5, 20.0), orders=range(4, 33, 4)))),
    }


@job("measured: wing, records with inputs")
def _() -> Told:
    with np.load(measured("hati_gvt", "hati_ws3_200Hz.npz")) as held:
        runs = [
            face.Signals(outputs=a[:6000], inputs=f[:6000, None], sampling_rate=float(held["fs"]))
            for f, a in zip(held["force"][:3], held["acc"][:3], strict=True)
        ]
    test = face.Records(runs=runs)
    return {
        "data": data(test),
        "findings": kinds(records.examine(test)),
        "result": attempt(lambda: result(face.analyze(test, band=(5.0, 40.0), orders=range(4, 25, 4)))),
    }


@job("measured: wing")
def _() -> Told:
    found = face.read(measured("hati_gvt", "hati_ws3_frf.npz"))
    return {
        "data": data(found),
        "findings": kinds(records.examine(found)),
        "result": result(face.analyze(found, band=(2.0, 40.0), orders=range(4, 33, 4))),
    }


@job("measured: tables and files of recorders")
def _() -> Told:
    told: Told = {}
    for parts in (
        ("footbridge", "node_p1_000.CSV"),
        ("footbridge", "impulse_VI0.txt"),
        ("footbridge", "ambient_testVI.lvm"),
        ("labview_spectrum", "FFT_data.lvm"),
        ("beam_uff", "beam_2kHz.uff"),
    ):
        path = measured(*parts)
        told[parts[-1]] = {"read": attempt(lambda p=path: data(face.read(p))), "info": command("info", path)}
    bridge = measured("footbridge", "node_p1_000.CSV")
    told["with its rate"] = attempt(lambda: data(face.read(bridge, sampling_rate=100.0)))
    return told


# --------------------------------------------------------------------------------------------------------- the command line
@job("command: identify, every output")
def _() -> Told:
    told: Told = {"simulate": command("simulate", "chain5", "--samples", "300", "--noise", "40", "-o", "test.uff")}
    names = [f"modes.{suffix}" for suffix in ("json", "csv", "uff", "npz", "html", "png")]
    outputs = [word for name in names for word in ("-o", name)]
    told["identify"] = command("identify", "test.uff", "--orders", "2:30:4", *outputs)
    told["files"] = {name: file(name) for name in names[:-1]}
    told["picture"] = Path(names[-1]).exists()
    told["json"] = command("identify", "test.uff", "--orders", "2:30:4", "-o", "-", "-q")
    told["refine"] = command("refine", "test.uff", "--modes", "modes.json", "-o", "refined.json")
    told["refined"] = file("refined.json")
    told["mac"] = command("mac", "modes.json", "refined.json", "-o", "-")
    told["report"] = command("report", "modes.json", "-o", "report.html")
    return told


@job("command: identify, choices")
def _() -> Told:
    command("simulate", "chain5", "--samples", "300", "--noise", "40", "-o", "test.npz")
    base = ["identify", "test.npz", "--orders", "2:22:4", "-o"]
    return {
        str(index): {"command": command(*base, f"{index}.csv", *words), "file": file(f"{index}.csv")}
        for index, words in enumerate(
            (
                ["--no-refine"],
                ["--method", "lscf"],
                ["--band", "0.2", "3.4", "--band", "3", "8"],
                ["--frequencies", "0.906", "2.64"],
                ["--refuse", "2.64", "--all"],
                ["--method", "nonsense"],
                ["--band", "3"],
                ["--exclude", "nowhere"],
            )
        )
    }


@job("command: records")
def _() -> Told:
    told: Told = {}
    for kind in ("records", "ambient", "impulse"):
        test = f"{kind}.npz"
        told[kind] = {
            "simulate": command("simulate", "chain5", "--kind", kind, "--samples", "3000", "--noise", "30", "-o", test),
            "info": command("info", test),
            "identify": command("identify", test, "--orders", "4:24:4", "-o", f"{kind}.json", "-o", f"{kind}.csv"),
            "files": [file(test), file(f"{kind}.json"), file(f"{kind}.csv")],
        }
    told["frf"] = [command("frf", "records.npz", "-o", "frf.uff"), file("frf.uff")]
    told["lrm"] = [command("frf", "records.npz", "--estimator", "lrm", "-o", "lrm.csv"), file("lrm.csv")]
    told["psd"] = command("psd", "ambient.npz", "-o", "-")
    told["realize"] = [command("realize", "records.npz", "--order", "10", "-o", "m.json"), file("m.json")]
    told["merge"] = [command("merge", "ambient.npz", "ambient.npz", "-o", "both.npz"), file("both.npz")]
    told["converted"] = [command("convert", "records.npz", f"records.{s}") for s in ("csv", "uff", "mat", "h5", "xyz")]
    told["back"] = [data(face.read(f"records.{suffix}")) for suffix in ("csv", "uff", "mat", "h5")]
    return told


@job("command: compare and certify")
def _() -> Told:
    command("simulate", "chain5", "--samples", "200", "--noise", "40", "-o", "test.npz")
    return {
        "compare": command("compare", "test.npz", "--orders", "4:16:4", "-o", "compared.json", "-o", "compared.csv"),
        "compared": [file("compared.json"), file("compared.csv")],
        "certify": command(
            "certify", "test.npz", "--orders", "4:16:4", "--replicates", "3", "-o", "c.json", "-o", "c.csv"
        ),
        "certified": [file("c.json"), file("c.csv")],
    }


@job("command: endings")
def _() -> Told:
    command("simulate", "three_masses", "--samples", "100", "-o", "test.npz")
    Path("mine.json").write_text('{"mine": 1}')
    calls: tuple[tuple[str, ...], ...] = (
        (),
        ("--help",),
        ("--version",),
        ("methods",),
        ("simulate", "list"),
        ("simulate", "nothing"),
        ("nonsense",),
        ("identify",),
        ("identify", "nowhere.uff"),
        ("identify", "test.npz", "--orders", "a:b"),
        ("identify", "test.npz", "-o", "modes.xyz"),
        ("identify", "test.npz", "-o", "mine.json", "--orders", "2:8:2"),
        ("identify", "test.npz", "-o", "nowhere/modes.json"),
        ("identify", "test.npz", "--config", "nowhere.toml"),
        ("info", "test.npz", "-v"),
        ("info", "test.npz", "--quantity", "colour"),
        ("mac", "test.npz", "test.npz"),
        ("convert", "test.npz", "test.npz"),
        ("plot", "test.npz", "-o", "test.png"),
        ("completion", "bash"),
        ("frf", "test.npz", "-o", "again.npz"),
    )
    return {" ".join(words): command(*words) for words in calls}
