"""Run the process that computes one document: receive commands and questions through a pipe, and send results back."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED, ZipFile

from modalscope.analysis.workflow.realize import realize
from modalscope.data import DataError, ModalModel
from modalscope.data.analysis import Analysis, named_near
from modalscope.interfaces.app.steps import Stages
from modalscope.interfaces.plot.picture import Picture
from modalscope.interfaces.plot.web.blob import picture_blob
from modalscope.interfaces.plot.web.fits import channel_blob
from modalscope.io import write
from modalscope.io.analysis import analysis_from
from modalscope.numerics.errors import AT_TERMINAL

if TYPE_CHECKING:
    from modalscope.analysis.comparing import Comparison
    from modalscope.data.results import Result

Progress = Callable[[int, int], None]


def channel(stages: Stages, progress: Progress, output: int | None = None, column: int | None = None) -> bytes:
    """Return one channel, measured and rebuilt, as a blob; without an output and a column the sum of all."""
    result = stages.finished()
    return channel_blob(result.diagrams, result.modes, output, column)


def export(stages: Stages, progress: Progress, suffix: str, target: str, mode: int = 0) -> Path:
    """Write the result in one of the page's formats, as the command line does, to the file `target`; `mode`: the one of a film."""
    result, path = named_in(stages.finished()), Path(target)
    if suffix in (".html", ".docx", ".pptx"):
        from modalscope.interfaces.reporting import report

        return report(result, path)
    if suffix == ".gif":
        from modalscope.interfaces.plot import animate
        from modalscope.interfaces.plot.web.modes import over_points

        return animate(over_points(result.modes, result.diagrams[0].response), mode, path)
    if suffix == ".zip":
        return _pictures(result, path)
    if suffix in (".model.mat", ".model.json"):
        write(path, realize(stages.data, **_choices(result.analysis)))
        return path
    write(path, result.analysis if suffix == ".analysis.json" else result)
    return path


def named_in(result: Result) -> Result:
    """Return a result whose modes have the names of its document with their reasons, as files keep them."""
    named = [{**m.reason, "name": named_near(result.analysis.names, m.frequency)} for m in result.modes]
    return replace(result, modes=replace(result.modes, reasons=tuple(named))) if result.analysis.names else result


def _choices(document: Analysis) -> dict[str, Any]:
    """Return the choices of a document for what is identified in one band: over all of its bands."""
    bands = document.bands
    band = (min(low for low, _ in bands), max(high for _, high in bands)) if bands else None
    route = None if document.route == "auto" else document.route
    chosen = {"route": route, "reciprocal": document.reciprocal, "exclude": document.exclude or None}
    return {**chosen, "band": band, "method": document.method, "domain": document.domain}


def _pictures(result: Result, path: Path) -> Path:
    """Write the pictures of a result as an archive of SVG files."""
    from modalscope.interfaces.plot.gallery import pictures_of
    from modalscope.interfaces.plot.web.svg import alone, svg

    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, picture in pictures_of(result.modes, result.diagrams).items():
            archive.writestr(f"{path.stem}_{name}.svg", alone(svg(picture, picture.size[0])))
    return path


def against(stages: Stages, progress: Progress, path: str) -> dict[str, Any]:
    """Return the MAC of the modes with those of a file, rows ours, and the frequencies of the file."""
    from modalscope.data.indicators import mac
    from modalscope.io import read

    modes, other = stages.finished().modes, read(path)
    if not isinstance(other, ModalModel):
        fault = f"{Path(path).name} holds {type(other).__name__}"
        raise DataError("the MAC with another file:", fault, "Give a file of modes: .json, .csv, .uff, .npz.")
    other = other.select(outputs=modes.output_dofs)
    return {"mac": mac(modes.shapes, other.shapes), "frequencies": other.frequencies, "name": Path(path).name}


def planned(stages: Stages, progress: Progress, ask: str) -> list[str]:
    """Return what to measure next, a line each."""
    from modalscope.analysis.planning.next_measurement import next_measurement

    return str(next_measurement(stages.finished(), ask=ask)).split("\n")


def compared(stages: Stages, progress: Progress, methods: list[str] | None = None) -> dict[str, Any]:
    """Return the comparison of all methods: verdict, consensus modes, and pictures of the differences."""
    from modalscope.analysis.comparing import compare

    found = stages.finished()
    chosen = {k: v for k, v in _choices(found.analysis).items() if k in ("route", "exclude", "band")}
    choices = {"orders": found.analysis.orders, "analysis": found, **chosen}
    comparison = compare(stages.data, methods or "all", progress=progress, **choices)
    stages.pictures |= (pictures := compared_pictures(comparison))
    return compared_view(comparison) | {"pictures": list(pictures)}


def compared_pictures(comparison: Comparison) -> dict[str, Picture]:
    """Return the pictures of a comparison by name, as far as there is something to draw."""
    from modalscope.interfaces.plot.methods import deviations_picture, map_picture

    pictures = {"map": map_picture(comparison)} if len(comparison.kinship.names) > 1 else {}
    return pictures | ({"deviations": deviations_picture(comparison)} if comparison.groups else {})


def measured(stages: Stages, progress: Progress) -> list[str]:
    """Make the pictures of the data, and return their names."""
    from modalscope.interfaces.plot.measured import measured_pictures

    if stages.data is None:
        raise DataError("the pictures of the data:", "the data are not read", "Wait until they are read.")
    stages.pictures |= (pictures := measured_pictures(stages.data))
    return list(pictures)


def picture(stages: Stages, progress: Progress, name: str) -> bytes:
    """Return one of the pictures that were made, as a blob."""
    if name not in stages.pictures:
        raise DataError(f"the picture {name[:40]!r}:", "there is none", "Open its window again.")
    return picture_blob(stages.pictures[name])


def compared_view(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as the page shows it."""
    from modalscope.analysis.comparing import CAUSES
    from modalscope.interfaces.reporting.comparison import consensus_table

    counts = [None if r.modes is None else len(r.modes) for r in comparison.results]
    methods = [
        {"label": r.label, "modes": count, "fit": r.fit_error, "failure": r.failure or ""}
        for r, count in zip(comparison.results, counts, strict=True)
    ]
    causes = {cause.name: CAUSES[cause.name] for d in comparison.disagreements for cause in d.causes}
    verdict = f"{comparison.headline}\n{comparison.verdict}"
    return {"verdict": verdict, "rows": consensus_table(comparison), "methods": methods, "causes": causes}


#: The questions of the page by name.
_NAMED = (channel, against, export, measured, planned, picture)
TASKS: dict[str, Callable[..., Any]] = {"compare": compared} | {task.__name__: task for task in _NAMED}

#: Those that are answered between two orders, before there are modes.
_OF_DATA = ("measured", "picture")


class _Newer(Exception):
    """A newer command replaces the present job."""


class _Worker:
    """Run one command after the other; check between two orders whether a newer one waits."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._waiting = pipe, deque[tuple[Any, ...]]()
        self._job = 0
        self._stages = Stages(self.tell)

    def tell(self, kind: str, payload: Any) -> None:
        """Send a message about the present job."""
        self._pipe.send((kind, self._job, payload))

    def serve(self) -> None:
        """Work until the pipe is closed."""
        while True:
            if not self._waiting:
                self._waiting.append(self._pipe.recv())
            self._collect()
            jobs = [command for command in self._waiting if command[0] in ("work", "cancel")]
            if jobs:  # only the latest document counts; questions are answered on it
                self._waiting = deque(command for command in self._waiting if command[0] == "ask")
                self._work(jobs[-1])
            else:
                self._answer(*self._waiting.popleft()[1:])

    def _collect(self) -> None:
        while self._pipe.poll():
            self._waiting.append(self._pipe.recv())

    def _check(self, kinds: tuple[str, ...] = ("work", "cancel")) -> None:
        """Raise if a command of these kinds waits; answer what the data alone answer."""
        self._collect()
        if any(command[0] in kinds for command in self._waiting):
            raise _Newer
        for command in [command for command in self._waiting if command[0] == "ask" and command[2] in _OF_DATA]:
            self._waiting.remove(command)
            self._answer(*command[1:])

    def _work(self, command: tuple[Any, ...]) -> None:
        kind, self._job, *rest = command
        if kind == "cancel":
            self.tell("stopped", None)
            return
        entries, kept = rest
        try:
            self._stages.run(analysis_from(entries), kept, self._check)
        except _Newer:
            self.tell("stopped", None)
        except Exception as error:  # noqa: BLE001 - a job ends with any error; the page shows it
            self.tell("failed", error_parts(error))
        else:
            self.tell("done", None)

    def _answer(self, number: int, what: str, given: dict[str, Any]) -> None:
        def progress(done: int, total: int) -> None:
            self.tell("asked", {"what": what, "done": done, "total": total})
            self._check(("cancel",))

        try:
            answer = TASKS[what](self._stages, progress, **given)
        except Exception as error:  # noqa: BLE001 - as above
            self._pipe.send(("answer", number, (False, error_parts(error))))
        else:
            self._pipe.send(("answer", number, (True, str(answer) if isinstance(answer, Path) else answer)))


def error_parts(error: BaseException) -> dict[str, str]:
    """Return the three parts of an error: what was asked, what there is, what to change.

    Examples
    --------
    >>> error_parts(MemoryError())["change"]
    'Use fewer orders, channels, lines or samples.'
    """
    if isinstance(error, DataError):
        return {"asked": error.asked, "found": error.found, "change": error.change, "text": error.args[0]}
    asked, change = "the computation:", "Try other settings, and report the fault."
    if isinstance(error, _Newer):
        found, change = "it was stopped", "Ask again if needed."
    elif isinstance(error, MemoryError):
        found, change = "this machine is out of memory", "Use fewer orders, channels, lines or samples."
    elif isinstance(error, OSError):
        asked = "a file was read or written"
        found, change = f"the system refuses: {(error.strerror or str(error)).lower()}", "Check that the file exists."
    else:
        found = f"the program has a fault ({type(error).__name__}: {str(error)[:200]})"
    return {"asked": asked, "found": found, "change": change}


def main(pipe: Connection) -> None:
    """Serve a pipe until it is closed; the server handles interrupts from the terminal."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    AT_TERMINAL.set(True)
    try:
        _Worker(pipe).serve()
    except (EOFError, OSError):  # the server has ended
        return
