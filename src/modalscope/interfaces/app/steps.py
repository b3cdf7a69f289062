"""Compute the stages of an analysis (data, diagrams, candidates, modes); each is cached until a choice that it depends on changes."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.analysis.workflow.analyze import concluded
from modalscope.analysis.workflow.bands import Look, looked_at, modes_chosen
from modalscope.analysis.workflow.replay import check_same
from modalscope.analysis.workflow.sources import opened
from modalscope.data import DataError, ModalModel, Note, StabilizationDiagram
from modalscope.data.analysis import Analysis
from modalscope.data.results import Result
from modalscope.identification.method_names import cell_label
from modalscope.interfaces.app.actions import diagrams_key
from modalscope.interfaces.app.reading import watched
from modalscope.interfaces.plot.picture import Picture
from modalscope.interfaces.plot.web.fits import fit_of_result
from modalscope.interfaces.plot.web.modes import modes_blob
from modalscope.interfaces.plot.web.poles import cut_view, overview_blob, poles_blob, spectra_of
from modalscope.interfaces.plot.web.verdict import grouped, notes_that_matter, verdict_of
from modalscope.interfaces.reporting.record import result_script
from modalscope.io.analysis import analysis_to
from modalscope.selection.judging.select import Weighed, chosen_of, weighed
from modalscope.signals.doctor.examine import examine
from modalscope.signals.preprocess.singular_spectra import Decomposition


def result_head(result: Result) -> dict[str, Any]:
    """Return the description of a result: method, settings, notes, findings, script and verdict."""
    first, (texts, computing) = result.diagrams[0], notes_that_matter(result.notes)
    head: dict[str, Any] = {
        "label": cell_label(first.method, first.domain),
        "notes": texts,
        "computing": computing,
        "findings": [finding._asdict() for finding in grouped(result.findings)],
        "script": result_script(result),
        "columns": list(first.response.columns),
        "plans": len(result.diagrams) == 1 and first.response.separable and not first.response.ambient,
    }
    if (fit := fit_of_result(result)) is not None:
        head |= {"fit": fit[0], "fits": np.broadcast_to(fit[1], first.response.values.shape[1:])}
    verdict = verdict_of(result.modes, first.response, fit)
    return head | {"taken": verdict.taken, "unexplained": verdict.unexplained, "warnings": verdict.warnings}


class Stages:
    """The stages of one analysis in its worker process: `run` computes the result of a document from the cached stages.

    `tell`: called with (kind, payload) for every message to the page.
    """

    def __init__(self, tell: Callable[..., None]) -> None:
        self._tell = tell
        self._of_data = self._of_diagrams = ""
        self.data: Any = None
        self._spectra: Decomposition | None = None
        self._notes: tuple[Note, ...] = ()
        self._findings: tuple[Any, ...] | None = None
        self._looks: list[Look] = []
        self._weighed: dict[int, Weighed] = {}
        self.result: Result | None = None
        self.pictures: dict[str, Picture] = {}

    def run(self, document: Analysis, kept: bytes | None, check: Callable[[], None]) -> None:
        """Compute the result of a document, and report it stage by stage.

        `kept`: diagrams of another process for the same fields of the document. `check`: called between two orders and two stages; raises
        if a newer job waits.
        """
        self.result = None
        self._read(document)
        check()
        self._identify(document, kept, check)
        check()
        self._tell("stage", {"stage": "selecting"})
        self._early(document)
        check()
        result = concluded(self.data, document, self._looks, self._notes, self._choose, self._examined)
        modes = modes_blob(result.modes, document.names, result_head(result), result.diagrams[0].response)
        self._tell("blob", ("modes", modes))
        self.result = result

    def _read(self, document: Analysis) -> None:
        key = json.dumps([analysis_to(document)["files"], document.route == "auto"], sort_keys=True)
        if key == self._of_data:
            return
        self._tell("stage", {"stage": "reading"})
        self._of_data, self._findings = "", None
        paths: list[Any] = [file.path for file in document.files]
        with watched(paths, lambda done, of: self._tell("stage", {"stage": "reading", "done": done, "total": of})):
            source = paths[0] if len(paths) == 1 else paths
            data, sources, notes = opened(source, document.reading, decays=document.route == "auto")
        check_same(document.files, sources, data)
        self._tell("stage", {"stage": "examining"})
        self.data, self._notes, self._of_data = data, notes, key
        self._spectra = spectra_of(data)
        self._tell("blob", ("overview", overview_blob(data, self._spectra, grouped(self._examined(data)))))

    def _identify(self, document: Analysis, kept: bytes | None, check: Callable[[], None]) -> None:
        key = diagrams_key(document)
        if key == self._of_diagrams:
            return
        self._of_diagrams = ""
        self._weighed = {}
        if kept is None:
            self._tell("stage", {"stage": "factoring"})
            self._looks = looked_at(self.data, document, watch=self._watch(check), choose=self._choose)
            self._tell("keep", (key, pickle.dumps(self._looks)))
        else:
            self._looks = pickle.loads(kept)  # made by a process of this server
        self._tell("blob", ("poles", poles_blob([look.diagram for look in self._looks], self._spectra)))
        self._of_diagrams = key

    def _watch(self, check: Callable[[], None]) -> Callable[[Any, Any], None]:
        """Return a function that reports the cuts of every sweep."""
        last: dict[str, Any] = {"sweep": None, "cut": None}

        def watch(sweep: Any, cut: Any) -> None:
            again = last["sweep"] is not sweep
            before = None if again else last["cut"]
            view = cut_view(sweep, cut, before)
            self._tell("cut", {**view, "again": again and last["sweep"] is not None})
            last.update(sweep=sweep, cut=cut)
            check()

        return watch

    def _choose(
        self, diagram: StabilizationDiagram, frequencies: Any = None, take: Any = (), refuse: Any = ()
    ) -> ModalModel:
        """Select modes as `select` does, with the candidates of each diagram weighed once."""
        if id(diagram) not in self._weighed:
            self._weighed[id(diagram)] = weighed(diagram)
        return chosen_of(diagram, self._weighed[id(diagram)], frequencies, take, refuse)

    def _early(self, document: Analysis) -> None:
        """Report the selected modes before they are refined."""
        if document.refine:
            modes = modes_chosen(self.data, replace(document, refine=False), self._looks, self._choose)
            response = self._looks[0].diagram.response
            early = modes_blob(replace(modes, notes=()), document.names, {"early": True}, response, preliminary=True)
            self._tell("blob", ("modes", early))
            self._tell("stage", {"stage": "refining"})

    def _examined(self, data: Any) -> tuple[Any, ...]:
        if self._findings is None:
            self._findings = examine(data)
        return self._findings

    def finished(self) -> Result:
        """Return the result, or raise if there is none."""
        if self.result is None:
            reason = "the analysis was stopped or failed"
            raise DataError("this needs the result of the analysis", reason, "Follow its message, or press again.")
        return self.result
