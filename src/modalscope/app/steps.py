"""Compute the stages of an analysis (data, diagrams, candidates, modes) and keep each until a choice that it depends on changes."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from modalscope.app.actions import diagrams_key
from modalscope.data import DataError, ModalModel, Note, StabilizationDiagram
from modalscope.data.analysis import Analysis
from modalscope.data.results import Result
from modalscope.doctor.examine import examine
from modalscope.identification.method_names import cell_label
from modalscope.io.analysis import analysis_to
from modalscope.judging.select import Weighed, chosen_of, weighed
from modalscope.modal.rebuilt import explained
from modalscope.plot.web.modes import modes_blob
from modalscope.plot.web.poles import channel_blob, cut_view, fit_of_bands, overview_blob, poles_blob
from modalscope.reporting.record import result_script
from modalscope.workflow.analyze import concluded
from modalscope.workflow.bands import Look, looked_at, modes_chosen
from modalscope.workflow.replay import check_same
from modalscope.workflow.sources import opened

# ---------------------------------------------------------------------------------------------------------------- head
# What is told of a result beside its modes.


def result_head(result: Result) -> dict[str, Any]:
    """Return what is told of a result beside its modes."""
    first = result.diagrams[0]
    head: dict[str, Any] = {
        "label": cell_label(first.method, first.domain),
        "orders": [first.orders[0], first.orders[-1]] if first.orders else [],
        "settings": [dict(settings.items()) for settings in result.settings],
        "notes": [note.to_dict() for note in result.notes],
        "findings": [finding._asdict() for finding in result.findings],
        "script": result_script(result),
        "columns": list(first.response.columns),
    }
    if len(result.modes) and not result.analysis.apart:
        left = fit_of_bands(result.modes, result.diagrams)
        if left is not None:
            head |= {"fit_error": left[0], "explained": explained(left[0])}
    return head


# --------------------------------------------------------------------------------------------------------------- steps

Tell = Callable[..., None]


class Stages:
    """One analysis in the process that computes it: `run` gives the result of a document, from what is kept of the one before.

    `tell`: called with (kind, payload) for all that is worth showing.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._of_data = self._of_diagrams = ""
        self.data: Any = None
        self._told: tuple[Note, ...] = ()
        self._findings: tuple[Any, ...] | None = None
        self._looks: list[Look] = []
        self._weighed: dict[int, Weighed] = {}
        self.result: Result | None = None

    def run(self, document: Analysis, kept: bytes | None, check: Callable[[], None]) -> None:
        """Compute what a document says, and tell it stage by stage.

        `kept`: diagrams that another process finished, for the same part of the document. `check`: asked between two orders and two
        stages; raises where something newer waits.
        """
        self.result = None
        self._read(document)
        check()
        self._identify(document, kept, check)
        check()
        self._tell("stage", {"stage": "selecting"})
        self._early(document)
        check()
        result = concluded(self.data, document, self._looks, self._told, self._choose, self._examined)
        self.result = result
        self._tell("blob", ("modes", modes_blob(result.modes, document.names, result_head(result))))

    def _read(self, document: Analysis) -> None:
        key = json.dumps(analysis_to(document)["files"], sort_keys=True)
        if key == self._of_data:
            return
        self._tell("stage", {"stage": "reading"})
        self._of_data, self._findings = "", None
        paths: list[Any] = [file.path for file in document.files]
        data, sources, told = opened(paths[0] if len(paths) == 1 else paths, document.reading)
        check_same(document.files, sources, data)
        self.data, self._told, self._of_data = data, told, key
        self._tell("blob", ("overview", overview_blob(data)))

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
        self._tell("blob", ("poles", poles_blob(self._diagrams)))
        self._of_diagrams = key

    @property
    def _diagrams(self) -> list[StabilizationDiagram]:
        return [look.diagram for look in self._looks]

    def _watch(self, check: Callable[[], None]) -> Callable[[Any, Any], None]:
        """Return what tells the cuts of every sweep as they come."""
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
        """Stand in for `select`: candidates are weighed once a diagram."""
        if id(diagram) not in self._weighed:
            self._weighed[id(diagram)] = weighed(diagram)
        return chosen_of(diagram, self._weighed[id(diagram)], frequencies, take, refuse)

    def _early(self, document: Analysis) -> None:
        """Tell the modes as they were chosen, where refining them is still to come."""
        if document.refine:
            found = modes_chosen(self.data, replace(document, refine=False), self._looks, self._choose)
            self._tell("blob", ("modes", modes_blob(replace(found, notes=()), document.names, {"early": True})))
            self._tell("stage", {"stage": "refining"})

    def _examined(self, data: Any) -> tuple[Any, ...]:
        if self._findings is None:
            self._findings = examine(data)
        return self._findings

    def channel(self, output: int, column: int) -> bytes:
        """Return one channel, measured and rebuilt."""
        return channel_blob(self._diagrams, self.finished().modes, output, column)

    def finished(self) -> Result:
        """Return the result; one that is not there is an error."""
        if self.result is None:
            raise DataError(
                "the result of this analysis was asked",
                "there is none: it was stopped, or could not be done",
                "Change what its message names, or say: again.",
            )
        return self.result
