"""Write the sections of a report on a period: tracks, what moves them, the control chart, and records that could not be used."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from modalscope.analysis.monitoring.change import Alarms, alarms
from modalscope.analysis.monitoring.history import as_times
from modalscope.analysis.monitoring.store import Store
from modalscope.analysis.monitoring.tracks import Explained, Tracks
from modalscope.data import DataError
from modalscope.data.shown import counted
from modalscope.interfaces.plot.tracks import against_picture, chart_picture, tracks_picture
from modalscope.interfaces.reporting.html import Section, figure, listing, paragraph, table
from modalscope.interfaces.reporting.track_view import track_view

#: Covariates that are drawn, and refused records that are listed, at most.
_MAX_COVARIATES, _MAX_REFUSED = 6, 500

#: Pixels of a picture.
_WIDE = (900, 500)


def months_sections(store: Store, *, reference: Any = None, false_per_year: float = 1.0) -> Iterator[Section]:
    """Yield the sections on the records of a store in the order of reading, each drawn when it is asked for.

    `reference`, `false_per_year`: as of `alarms`. Where there are too few records for a chart, its section says so.
    """
    tracks = store.tracks()
    try:
        chart: Alarms | DataError = alarms(tracks, reference=reference, false_per_year=false_per_year)
    except DataError as error:
        chart = error
    yield _summary(store, tracks, chart)
    yield _tracks(store, tracks)
    if isinstance(chart, Alarms):
        yield _moved(chart.explained)
    yield _chart(chart)
    yield _refused(store)


def _summary(store: Store, tracks: Tracks, chart: Alarms | DataError) -> Section:
    records = store.records
    first, last = (_minute(float(time)) for time in tracks.times[[0, -1]])
    told = f"{len(chart)} at {chart.false_per_year:g} false ones a year" if isinstance(chart, Alarms) else "no chart"
    rows = {
        "period": f"{first} to {last} (UTC)",
        "records": f"{len(tracks.times)} used, {np.count_nonzero(records.state == 'refused')} could not be used",
        "modes": f"{tracks.history.frequencies.size}, in {counted(len(tracks), 'track')}",
        "alarms": told,
    }
    found = chart.alarms if isinstance(chart, Alarms) else ()
    return Section("summary", "Summary", listing(rows.items()) + "".join(paragraph(str(alarm)) for alarm in found))


def _tracks(store: Store, tracks: Tracks) -> Section:
    head, *rows = tracks.rows()
    still = figure(tracks_picture(tracks), "Frequencies of all tracks over time", *_WIDE)
    records = store.records
    alive = track_view(tracks, records.time[records.state == "refused"])
    drawn = f"<noscript>{still}</noscript>{alive}"
    return Section("tracks", "Tracks", drawn + table(head, rows, words=(0,)) + "".join(map(paragraph, tracks.notes)))


def _moved(found: Explained) -> Section:
    head, *rows = found.rows()
    names = [name for name in found.regressors[1:] if " below " not in name][:_MAX_COVARIATES]
    pictures = [figure(against_picture(found, name), f"Frequencies against {name}", *_WIDE) for name in names]
    told = table(head, rows, words=(0,)) + "".join(map(paragraph, found.notes))
    return Section("moved", "What moves them", "".join(pictures) + told)


def _chart(chart: Alarms | DataError) -> Section:
    if isinstance(chart, DataError):
        return Section("chart", "Control chart", paragraph(str(chart)))
    picture = chart_picture(chart)
    drawn = figure(picture, picture.words, *picture.size)
    own = [note for note in chart.notes if note not in chart.explained.notes]
    return Section("chart", "Control chart", drawn + "".join(map(paragraph, own)))


def _refused(store: Store) -> Section:
    refused = store.records[store.records.state == "refused"]
    if not refused.size:
        return Section("refused", "Records that could not be used", paragraph("None."))
    rows = [(_minute(r.time), r.file, r.reason) for r in refused[:_MAX_REFUSED]]
    more = f"{refused.size - _MAX_REFUSED} more are not listed." if refused.size > _MAX_REFUSED else ""
    body = table(("time (UTC)", "file", "reason"), rows, words=(0, 1, 2)) + (paragraph(more) if more else "")
    return Section("refused", "Records that could not be used", body)


def _minute(seconds: float) -> str:
    return str(as_times("time", seconds).astype("datetime64[m]")).replace("T", " ")
