"""One right call of every public callable, and values that are wrong nearly everywhere: `tests.test_every_argument` puts them together."""

from __future__ import annotations

import inspect
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope import preprocess, systems
from modalscope.analysis.monitoring.entries import Entry
from modalscope.identification.options import AllOptions
from modalscope.signals.doctor import Finding
from tests.test_docstrings import CALLABLES

pd = pytest.importorskip("pandas")

__all__ = ["WRONG", "calls", "judge"]

CHAIN = systems.chain5()
LINES = np.linspace(0.2, 8, 60)
FOLDER = Path(tempfile.mkdtemp(prefix="modalscope-arguments-"))

#: Folders that must not be there yet.
NUMBERS = count()


class InMemory:
    """Responses of which some outputs can be read."""

    together, identity = 2, "in memory"

    def __init__(self, values: Any) -> None:
        self.values, self.shape = values, values.shape

    def read(self, start: int, stop: int) -> Any:
        return self.values[:, start:stop]


@cache
def right() -> dict[str, Any]:
    """Return one small thing of every kind, by the names that arguments have for it."""
    lines = CHAIN.frequency_response(LINES, quantity="acceleration", noise=0.01, seed=0)
    samples = CHAIN.impulse_response(60, noise=0.01, seed=0)
    records = CHAIN.simulate(samples=600, sampling_rate=20.0)
    ambient = CHAIN.simulate(inputs="ambient", samples=600, sampling_rate=20.0)
    result = ms.analyze(lines, orders=range(2, 13, 2), method="alternate")
    ms.write(FOLDER / "data.npz", lines)
    ms.write(FOLDER / "stored.h5", ambient)
    return {
        "lines": lines,
        "samples": samples,
        "records": records,
        "stored": ms.read(FOLDER / "stored.h5", stored=True),
        "kept": ms.StoredResponse(blocks=InMemory(samples.values), sampling_rate=samples.sampling_rate),
        "ambient": ambient,
        "displacements": CHAIN.simulate(samples=600, sampling_rate=20.0, quantity="displacement"),
        "correlation": ms.estimate_correlation(ambient),
        "result": result,
        "certificate": ms.certify(result, replicates=2),
        "diagram": result.diagram,
        "modes": result.modes,
        "model": CHAIN.state_space(dt=0.05),
        "found": ms.identify(samples, method="era", order=10),
        "comparison": ms.compare(samples, ["era/time", "least_squares/time"], orders=range(4, 13, 4)),
        "geometry": ms.Geometry(nodes=[1, 2], coordinates=[[0, 0, 0], [1, 0, 0]], lines=[[1, 2]]),
        "dwell": ms.tuned_dwell(lines),
        "motion": ms.equations_of_motion(ms.systems.three_masses().state_space()),
        "many": ms.Records(runs=(records, records)),
        "setups": ms.Setups(parts=(ambient.select(outputs=[0, 1]), ambient.select(outputs=[0, 2]))),
        "decomposition": preprocess.decomposition(ambient),
        **months(),
    }


def months() -> dict[str, Any]:
    """Return a short history, its tracks, what moves them, and a chart."""
    hours, draw = np.arange(240), np.random.default_rng(0)
    f = np.array([1.0, 2.0]) * (1 + 1e-3 * draw.standard_normal((240, 2)))
    history = ms.monitoring.History(
        times=3600.0 * hours, record=np.repeat(hours, 2), frequencies=f.ravel(), covariates={"air": np.sin(hours / 9)}
    )
    tracks = ms.monitoring.track(history)
    chart = ms.monitoring.alarms(tracks)
    return {"history": history, "tracks": tracks, "chart": chart, "explained": chart.explained}


#: An alarm.
ALARM = ms.monitoring.Alarm(
    time=1.7e9,
    change=1.7e9,
    interval=(1.7e9, 1.7001e9),
    statistic=1.1,
    shifts={"1: 1 Hz": -0.1},
    shifts_std={"1: 1 Hz": 0.01},
)


@cache
def stored_months() -> Any:
    """Return a store of modes."""
    store = ms.monitoring.Store(FOLDER / "a.modes")
    store.add_modes(right()["history"])
    (FOLDER / "records").mkdir(exist_ok=True)
    (FOLDER / "weather.csv").write_text("time,air\n2026-06-01,1\n2026-06-02,2\n")
    return store


def written_history() -> Path:
    """Return a NetCDF file of modes."""
    path = FOLDER / "modes.nc"
    with pytest.importorskip("h5py").File(path, "w") as file:
        file["time"], file["frequencies"] = [0, 1], [[1.0, 2.0], [1.1, 2.1]]
        file["time"].attrs["units"] = "hours since 2026-06-01"
    return path


#: How well modes explain two inputs that were left out in turn.
VALIDATION = ms.Validation(
    parts=("1", "2"),
    fit_errors=np.full(2, 0.03),
    fit_errors_with=np.full(2, 0.02),
    frequencies_std=np.full(3, 0.01),
    damping_ratios_std=np.full(3, 1e-4),
    correlation=0.0,
    uneven=1.0,
    white=True,
)

#: The thing whose method is called, or that is taken apart to be made again, by its class.
OWNERS = {
    "likelihood.Noise": lambda t: ms.likelihood.Noise(response=t["lines"], modes=t["modes"]),
    "Analysis": lambda t: t["result"].analysis,
    "Certificate": lambda t: t["certificate"],
    "Comparison": lambda t: t["comparison"],
    "DataError": lambda t: ms.DataError("a", "b", "c"),
    "Dwell": lambda t: t["dwell"],
    "EquationsOfMotion": lambda t: t["motion"],
    "FrequencyResponse": lambda t: t["lines"],
    "Geometry": lambda t: t["geometry"],
    "Identification": lambda t: t["found"],
    "ImpulseResponse": lambda t: t["samples"],
    "ModalModel": lambda t: t["modes"],
    "NextMeasurement": lambda t: ms.next_measurement(t["result"]),
    "Placement": lambda t: ms.place(t["modes"], sensors=2),
    "Note": lambda t: ms.Note("a", {"b": 1.0}, "c"),
    "Sameness": lambda t: ms.same_mode(t["modes"][0], t["modes"][1]),
    "Records": lambda t: t["many"],
    "Result": lambda t: t["result"],
    "Setups": lambda t: t["setups"],
    "Signals": lambda t: t["records"],
    "StabilizationDiagram": lambda t: t["diagram"],
    "StateSpace": lambda t: t["model"],
    "StoredSignals": lambda t: t["stored"],
    "StoredResponse": lambda t: t["kept"],
    "FullField": lambda t: ms.FullField(FOLDER, 1, 1, 0.0, np.zeros(1)),
    "StateSpace.predict": lambda t: replace(t["model"], gain=np.zeros((len(t["model"].A), len(t["model"].C)))),
    "StateSpace.to_discrete": lambda t: CHAIN.state_space(),
    "Validation": lambda t: VALIDATION,
    "monitoring.Alarm": lambda t: ALARM,
    "monitoring.Alarms": lambda t: t["chart"],
    "monitoring.Explained": lambda t: t["explained"],
    "monitoring.History": lambda t: t["history"],
    "monitoring.Store": lambda t: stored_months(),
    "monitoring.Tracks": lambda t: t["tracks"],
    "preprocess.Decomposition": lambda t: t["decomposition"],
    "preprocess.Finding": lambda t: Finding(kind="a", channels=("b",), reason="c", change="d"),
    "systems.Structure": lambda t: CHAIN,
}


def frame() -> Any:
    """Return a table of pandas with times and one channel."""
    return pd.DataFrame({"a [g]": [0.0, 1.0, 0.0]}, index=pd.Index([0.0, 0.1, 0.2], name="time [s]"))


#: What the required arguments of functions and methods are, by name of the callable.
GIVEN: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "analyze": lambda t: {"data": t["lines"], "method": "alternate", "orders": (2, 4, 6)},
    "compare": lambda t: {"data": t["samples"], "methods": ["era/time"], "orders": (2, 4)},
    "equations_of_motion": lambda t: {"model": systems.three_masses().state_space()},
    "estimate_correlation": lambda t: {"signals": t["ambient"]},
    "estimate_frf": lambda t: {"signals": t["records"]},
    "estimate_markov": lambda t: {"signals": t["records"], "observer_order": 10},
    "first_order_form": lambda t: {"model": ms.StateSpace(A=-np.eye(2), B=np.eye(2), C=np.eye(2))},
    "fit_residues": lambda t: {"response": t["lines"], "modes": t["modes"]},
    "from_frame": lambda _: {"frame": frame()},
    "Signals.from_frame": lambda _: {"frame": frame()},
    "full_field": lambda t: {
        "modes": ms.identify(t["kept"], method="era", order=4).modes,
        "data": t["kept"],
        "path": FOLDER / f"shapes{next(NUMBERS)}.zarr",
    },
    "identify": lambda t: {"data": t["samples"], "method": "era", "order": 4},
    "identify of lines": lambda t: {"data": t["lines"], "method": "alternate", "order": 4},
    "comac": lambda t: {"shapes_a": t["modes"].shapes, "shapes_b": t["modes"].shapes},
    "pair_modes": lambda t: {"a": t["modes"], "b": t["modes"]},
    "same_mode": lambda t: {"a": t["modes"][0], "b": t["modes"][1]},
    "merge": lambda t: {"parts": [t["lines"]]},
    "merge_modes": lambda t: {"results": [t["modes"], t["modes"]]},
    "scale_by_mass": lambda t: {"modes": t["modes"], "changed": t["modes"][:3], "masses": {"1:+X": 0.1}},
    "merge_bands": lambda t: {"results": [t["modes"]], "bands": [(0.2, 8.0)]},
    "mac": lambda t: {"shapes_a": t["modes"].shapes},
    "mac_std": lambda t: {"modes_a": replace(t["modes"], shapes_std=0.01 * np.abs(t["modes"].shapes))},
    "ods": lambda t: {"data": t["lines"], "frequency": 1.0},
    "read": lambda t: {"path": FOLDER / "data.npz"},
    "datasets.load": lambda t: {"name": "beam_hammer"},
    "likelihood.Noise.whiten": lambda t: {"values": t["lines"].values},
    **{
        f"likelihood.Noise.{name}": lambda t: {"modes": t["modes"]} for name in ("log_likelihood", "rise", "covariance")
    },
    "realize": lambda t: {"data": t["samples"], "order": 4},
    "replay": lambda t: {"document": t["result"].analysis, "data": t["lines"]},
    "report": lambda t: {"thing": t["found"], "path": FOLDER / "page.html"},
    "select": lambda t: {"diagram": t["diagram"]},
    "stabilize": lambda t: {"data": t["samples"], "method": "era", "orders": (2, 4)},
    "stabilize of lines": lambda t: {"data": t["lines"], "method": "alternate", "orders": (2, 4)},
    "prepare": lambda t: {"data": t["samples"], "method": "era"},
    "factor": lambda t: {"problem": ms.prepare(t["samples"], method="era"), "largest": 4},
    "sweep": lambda t: {"data": t["samples"], "method": "era", "orders": (2, 4)},
    "tuned_dwell": lambda t: {"response": t["lines"]},
    "place": lambda t: {"modes": t["modes"], "sensors": 2},
    "next_measurement": lambda t: {"result": t["result"]},
    "write": lambda t: {"path": FOLDER / "out.npz", "thing": t["modes"]},
    "Result.save": lambda _: {"path": FOLDER / "saved.npz"},
    "indicators.cluster_mpc": lambda t: {"shapes": t["modes"].shapes},
    "indicators.clusters": lambda t: {"poles": t["modes"].poles},
    "indicators.cmif": lambda t: {"values": t["lines"].values},
    "indicators.decay_step": lambda t: {"evolution": np.ones((3, 1))},
    "indicators.mac": lambda t: {"shapes_a": t["modes"].shapes},
    "indicators.mmif": lambda t: {"response": t["lines"]},
    "indicators.modal_singular_values": lambda t: {
        "shapes": np.ones((2, 1)),
        "participation": np.ones((1, 2)),
        "z": np.array([0.5]),
        "samples": 20,
    },
    "indicators.mpc": lambda t: {"shapes": t["modes"].shapes},
    "indicators.mpd": lambda t: {"shapes": t["modes"].shapes},
    "indicators.prominence": lambda t: {
        "curves": ms.indicators.cmif(t["lines"].values),
        "frequencies": LINES,
        "frequency": 1.0,
        "damping_ratio": 0.01,
    },
    "plot.animate": lambda t: {"modes": t["modes"], "index": 0, "path": FOLDER / "a.gif", "seconds": 0.1},
    "plot.certificate": lambda t: {"found": t["certificate"]},
    "plot.complexity": lambda t: {"modes": t["modes"], "index": 0},
    "plot.places": lambda t: {
        "found": ms.place(t["modes"], sensors=1),
        "geometry": ms.Geometry(
            nodes=[label.split(":")[0] for label in t["modes"].output_dofs],
            coordinates=np.eye(len(t["modes"].output_dofs), 3),
        ),
    },
    "plot.deviations": lambda t: {"comparison": t["comparison"]},
    "plot.fit_errors": lambda t: {"diagram": t["diagram"]},
    "plot.indicator": lambda t: {"response": t["lines"]},
    "plot.spectra": lambda t: {"found": t["decomposition"]},
    "plot.mac": lambda t: {"a": t["modes"]},
    "plot.method_map": lambda t: {"kin": t["comparison"]},
    "plot.response": lambda t: {"data": t["lines"]},
    "plot.shape": lambda t: {"modes": t["modes"], "index": 0},
    "plot.singular_values": lambda t: {"source": t["diagram"]},
    "plot.stabilization": lambda t: {"diagram": t["diagram"]},
    "preprocess.Finding.beside": lambda t: {"bands": [(0.2, 8.0)]},
    "preprocess.correlation_blocks": lambda t: {"signals": t["ambient"], "references": None, "lags": 20, "blocks": 4},
    "preprocess.decimate": lambda t: {"signals": t["records"], "factor": 2},
    "preprocess.decomposition": lambda t: {"signals": t["ambient"]},
    "preprocess.detrend": lambda t: {"signals": t["records"]},
    "preprocess.differentiate": lambda t: {"signals": t["displacements"], "times": 1},
    "preprocess.estimate_correlation": lambda t: {"signals": t["ambient"]},
    "preprocess.estimate_frf": lambda t: {"signals": t["records"]},
    "preprocess.estimate_markov": lambda t: {"signals": t["records"], "observer_order": 10},
    "preprocess.examine": lambda t: {"data": t["lines"]},
    "preprocess.exponential_decay": lambda t: {"end": 0.01, "duration": 1.0},
    "preprocess.filter_band": lambda t: {"signals": t["records"], "lowest": 1.0, "highest": 5.0},
    "preprocess.half_spectra": lambda t: {"correlation": t["correlation"]},
    "preprocess.remove_harmonics": lambda t: {"signals": t["ambient"]},
    "preprocess.integrate": lambda t: {"signals": t["records"], "times": 1, "lowest": 0.5},
    "preprocess.merge": lambda t: {"parts": [t["lines"]]},
    "preprocess.merge_setups": lambda t: {"parts": [t["correlation"], t["correlation"]]},
    "systems.add_noise": lambda t: {"data": t["lines"], "fraction": 0.1},
    "StabilizationDiagram.deviations_at": lambda t: {"index": np.array([0])},
    "StabilizationDiagram.poles_at": lambda t: {"order": int(t["diagram"].orders[-1])},
    "systems.build": lambda t: {"name": "chain5"},
    **{f"datasets.{verb}": lambda t: {"name": "palisaden"} for verb in ("describe", "folder", "load", "reference")},
    "systems.chain": lambda t: {"masses": [1.0, 1.0], "stiffnesses": [9.0, 9.0]},
    "systems.clamped_beam": lambda t: {"elements": 4},
    "systems.iasc_asce": lambda t: {},
    "systems.modal_damping": lambda t: {"M": np.eye(2), "K": np.eye(2) * 9, "ratios": 0.01},
    "systems.spring_chain": lambda t: {"n": 3},
    "systems.three_masses_record": lambda t: {},
    "FrequencyResponse.as_quantity": lambda t: {"wanted": "velocity"},
    "FrequencyResponse.at_lines": lambda t: {"lines": np.arange(20)},
    "FrequencyResponse.band": lambda t: {"lowest": 1.0, "highest": 5.0},
    "Geometry": lambda t: {"nodes": [1, 2], "coordinates": [[0, 0, 0], [1, 0, 0]], "lines": [[1, 2]]},
    "Geometry.displaced": lambda t: {"labels": ["1:+X"], "shape": [1.0]},
    "Geometry.motion_of": lambda t: {"label": "1:+X"},
    "ModalModel.frequency_response": lambda t: {"frequencies": LINES},
    "ModalModel.impulse_response": lambda t: {"samples": 20, "sampling_rate": 20.0},
    "ModalModel.interval": lambda t: {},
    "ModalModel.known_participation": lambda t: {"asked": "that"},
    "ModalModel.normalized": lambda t: {},
    "ModalModel.noted": lambda t: {"notes": ["that"]},
    "ModalModel.take": lambda t: {"modes": [0]},
    "Note.from_dict": lambda t: {"entries": {"text": "a"}},
    "Records.inputs_of": lambda t: {"run": 0},
    "StoredResponse.part": lambda t: {"start": 0, "stop": 2},
    "StoredSignals.chunk": lambda t: {"start": 0, "stop": 20},
    "StoredSignals.part": lambda t: {"start": 0, "stop": 20},
    "StateSpace.frequency_response": lambda t: {"frequencies": LINES},
    "StateSpace.impulse_response": lambda t: {"samples": 20},
    "StateSpace.markov_parameters": lambda t: {"samples": 20},
    "StateSpace.simulate": lambda t: {"inputs": np.ones((20, len(t["model"].B.T)))},
    "StateSpace.to_continuous": lambda t: {},
    "StateSpace.to_discrete": lambda t: {"dt": 0.05},
    "StateSpace.transfer": lambda t: {"points": np.array([0.5 + 0.5j])},
    "StateSpace.transformed": lambda t: {"T": np.eye(len(t["model"].A))},
    "Comparison.label": lambda t: {"name": t["comparison"].results[0].name},
    "preprocess.Decomposition.peaks": lambda t: {"count": 2},
    "systems.Structure.free_decay": lambda t: {"samples": 20, "displacement": np.ones(len(CHAIN.dofs))},
    "systems.Structure.frequency_response": lambda t: {"frequencies": LINES},
    "systems.Structure.impulse_response": lambda t: {"samples": 20},
    "systems.Structure.modes": lambda t: {},
    "systems.Structure.simulate": lambda t: {"samples": 50, "sampling_rate": 20.0},
    "systems.Structure.state_space": lambda t: {},
    "StateSpace.predict": lambda t: {"signals": t["records"]},
    "monitoring.alarms": lambda t: {"tracks": t["tracks"]},
    "monitoring.collect": lambda t: {"folder": FOLDER / "records", "store": stored_months()},
    "monitoring.explain": lambda t: {"tracks": t["tracks"]},
    "monitoring.read_covariates": lambda t: {"path": FOLDER / "weather.csv"},
    "monitoring.read_history": lambda t: {"path": written_history()},
    "monitoring.track": lambda t: {"history": t["history"]},
    "monitoring.Store.add": lambda t: {"files": t["samples"], "time": next(NUMBERS), "method": "era", "orders": (2, 4)},
    "monitoring.Store.add_covariates": lambda t: {"name": "air", "times": [0.0, 1.0], "values": [1.0, 2.0]},
    "monitoring.Store.add_modes": lambda t: {"modes": t["modes"], "time": 0.0},
    "monitoring.Store.tell": lambda t: {"alarm": ALARM},
    "monitoring.Store.put": lambda t: {"entry": Entry(sha256=str(next(NUMBERS)), name="a", time=0.0)},
    "monitoring.Store.alarms": lambda t: {},
    "monitoring.Store.tracks": lambda t: {},
    "monitoring.Store.unknown": lambda t: {"paths": [FOLDER / "weather.csv"]},
    "monitoring.Tracks.explained": lambda t: {},
    "monitoring.Tracks.of": lambda t: {"values": t["history"].frequencies},
    "monitoring.Tracks.pick": lambda t: {"which": np.ones(2, bool)},
    "plot.against": lambda t: {"found": t["explained"]},
    "plot.control_chart": lambda t: {"found": t["chart"]},
    "plot.tracks": lambda t: {"found": t["tracks"]},
    "plot.intervals": lambda t: {"modes": t["modes"]},
    "preprocess.local_models": lambda t: {"signals": t["records"]},
    "refine": lambda t: {"data": t["lines"], "modes": t["modes"]},
    "certify": lambda t: {"result": t["result"], "replicates": 2},
    "validate": lambda t: {"data": t["lines"], "modes": t["modes"], "leaving": "outputs"},
}

#: Methods of what the classes of responses share with their modules; those are for the library itself.
INNER = re.compile(
    r"\.(around|basis|chain|derivatives|doubts|driven|energy|functions|in_band|in_plane|named_terms|of_inputs|of_modes|processed|rebuilt_by|reported_band|"
    r"residual_of|shortest_participation|values_of|with_model|spectrum|whole_basis)$"
)

#: What the library makes; users read it.
MADE = (
    "Certificate",
    "Comparison",
    "Dwell",
    "EquationsOfMotion",
    "Identification",
    "Result",
    "Validation",
    "monitoring.Alarm",
    "monitoring.Alarms",
    "monitoring.Collected",
    "monitoring.Explained",
    "monitoring.Store",  # any name is a file that it makes
    "monitoring.Tracks",
    "preprocess.Decomposition",
    "preprocess.Finding",
    "preprocess.LocalEstimate",
    "preprocess.Observer",
    "widget",  # a browser's: it needs the front end, which may not be built
)


class Nothing:
    """An object of no use."""


#: None of these means anything in most places; where one does, the call may be done.
WRONG: dict[str, Callable[[], Any]] = {
    "text": lambda: "x",
    "empty text": lambda: "",
    "NUL": lambda: "a\0b",
    "bytes": lambda: b"x",
    "object": Nothing,
    "class": lambda: Nothing,
    "function": lambda: repr,
    "True": lambda: True,
    "NaN": lambda: float("nan"),
    "infinite": lambda: float("inf"),
    "complex": lambda: 1j,
    "negative": lambda: -5,
    "zero": lambda: 0,
    "half": lambda: 2.5,
    "numpy half": lambda: np.float64(-0.5),
    "countless": lambda: 10**12,
    "huge": lambda: 10**30,
    "huger": lambda: 10**400,
    "tiny": lambda: 1e-300,
    "large": lambda: 1e300,
    "empty list": list,
    "empty array": lambda: np.zeros(0),
    "ragged": lambda: [[1, 2], [3]],
    "texts": lambda: np.array(["a"]),
    "list of None": lambda: [None],
    "three": lambda: (1, 2, 3),
    "cube of NaN": lambda: np.full((2, 2, 2), np.nan),
    "objects": lambda: np.array([1, None], dtype=object),
    "mapping": lambda: {"a": 1},
    "set": lambda: {1, "a"},
    "iterator": lambda: iter([1, 2]),
    "slice": lambda: slice(None),
    "path": lambda: Path("x"),
    "diagram": lambda: right()["diagram"],
    "response": lambda: right()["lines"],
    "modes": lambda: right()["modes"],
    "None": lambda: None,
}


def calls() -> Iterator[tuple[str, Callable[..., Any], dict[str, Any], str]]:
    """Give (name, callable, right arguments, argument to be wrong) for every argument of every public callable."""
    things = right()
    for name in dict.fromkeys((*CALLABLES, *GIVEN)):
        plain = name.partition(" of ")[0]
        thing = CALLABLES.get(plain)
        if thing is None or INNER.search(name) or name in MADE or name == "DataError":
            continue
        owner, _, method = plain.rpartition(".")
        of = plain if plain in OWNERS else owner
        holder = OWNERS[of](things) if of in OWNERS and not inspect.isclass(thing) else None
        call = thing if holder is None else getattr(holder, method)
        if inspect.isclass(thing) and is_dataclass(thing) and name not in GIVEN:
            held = OWNERS[name](things)
            given = {f.name: getattr(held, f.name) for f in fields(thing) if f.init}
        else:
            given = GIVEN.get(name, lambda _: {})(things)
        names = [
            p.name
            for p in inspect.signature(call).parameters.values()
            if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
        ]
        if any(p.kind is p.VAR_KEYWORD for p in inspect.signature(call).parameters.values()) and plain in (
            "identify",
            "stabilize",
        ):
            names += [option for option in AllOptions.__annotations__ if option not in names]
        for argument in names:
            yield name, call, given, argument


def judge(call: Callable[..., Any], given: dict[str, Any], argument: str, wrong: Any) -> str:
    """Return what is wrong with the answer to a wrong argument: nothing where it is one, or names the argument in plain words."""
    if argument in ("progress", "partial", "watch") and callable(wrong):
        return ""  # a function of the caller's: what it raises is the caller's
    try:
        found = call(**{**given, argument: wrong})
        if inspect.isgenerator(found):
            list(found)
    except (ms.DataError, TypeError) as error:
        told = str(error)
        if isinstance(error, ms.DataError):
            return "" if told else "says nothing"
        return "" if argument in told else f"TypeError: {told}"
    except Exception as error:  # noqa: BLE001 - every other kind is what is looked for
        return f"{type(error).__name__}: {str(error)[:120]}"
    return ""
