"""Keep the modes of months of records in one SQLite file: a record is stored whole or not at all, once, and never run."""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.analysis.monitoring.change import Alarm, alarms
from modalscope.analysis.monitoring.collecting import SETTLED, Task, identified, settled
from modalscope.analysis.monitoring.entries import CHOICES, Entry, entry_of
from modalscope.analysis.monitoring.history import PER_MODE, History, as_seconds, as_times, assembled, rows_of
from modalscope.analysis.monitoring.tracking import track
from modalscope.analysis.monitoring.tracks import Tracks
from modalscope.analysis.workflow.sources import are_paths, source_of_data, source_of_file
from modalscope.data import ModalModel
from modalscope.data.analysis import VERSION
from modalscope.io.arrays import plain
from modalscope.numerics.arguments import COUNT, POSITIVE, named
from modalscope.numerics.checks import RealArray, check_kind, check_path, check_shape, real_array
from modalscope.numerics.errors import DataError

#: What the head of the file says of the program that made it ("mods"), and the number of the layout.
_APPLICATION, _SCHEMA = 0x6D6F6473, 1

#: `seen` spares a folder from being hashed at every look; records are known by `sha256` alone.
_TABLES = {
    "record": "CREATE TABLE record (id INTEGER PRIMARY KEY, sha256 TEXT NOT NULL UNIQUE, name TEXT NOT NULL, time INTEGER NOT NULL,"
    " refused TEXT, dofs TEXT NOT NULL, covariates TEXT NOT NULL, findings TEXT NOT NULL, settings TEXT NOT NULL,"
    " provenance TEXT NOT NULL)",
    "mode": "CREATE TABLE mode (record INTEGER NOT NULL REFERENCES record, position INTEGER NOT NULL, frequency REAL NOT NULL,"
    " damping_ratio REAL, frequency_std REAL, damping_ratio_std REAL, shape BLOB NOT NULL, shape_std BLOB, gain REAL,"
    " PRIMARY KEY (record, position)) WITHOUT ROWID",
    "covariate": "CREATE TABLE covariate (name TEXT NOT NULL, time INTEGER NOT NULL, value REAL NOT NULL, PRIMARY KEY (name, time))"
    " WITHOUT ROWID",
    "seen": "CREATE TABLE seen (path TEXT PRIMARY KEY, size INTEGER NOT NULL, changed INTEGER NOT NULL, sha256 TEXT NOT NULL)"
    " WITHOUT ROWID",
}

#: The columns of a record, the last of which ends in the checksum of all of them with its modes, and what else `seen` has by name.
_HEAD = ("sha256", "name", "time", "refused", "dofs", "covariates", "findings", "settings", "provenance")
_SEAL, _ALARM = ', "checksum": "', "/alarm/"

#: The columns of a mode.
_MODE = "frequency, damping_ratio, frequency_std, damping_ratio_std, shape, shape_std, gain"

#: Seconds that a reader or a writer waits for another one.
_PATIENCE = 30.0


class Store:
    """The modes of many records, in one SQLite file that survives being killed and has many readers.

    Every record is one transaction, and is known by the SHA-256 of its content: what is added twice is stored once. What the file
    holds are numbers and texts; nothing in it is run.

    Parameters
    ----------
    path : path
        The file; it is made where there is none.

    Raises
    ------
    DataError
        A file of another program or of a later version, a damaged one, a folder that is not there.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> from modalscope.systems import chain5
    >>> store = Store(Path(mkdtemp()) / "chain.modes")
    >>> store.add_modes("2026-06-01T00:00", chain5().modes())
    True
    >>> store.add_modes("2026-06-01T00:00", chain5().modes())
    False
    >>> store.history().frequencies.round(3)
    array([0.906, 2.645, 4.169, 5.356, 6.108])
    >>> store.close()
    """

    def __init__(self, path: str | Path) -> None:
        self.path = check_path(path)
        new = not self.path.exists() or self.path.stat().st_size == 0
        if not self.path.parent.is_dir():
            raise DataError(f"the store {self.path}:", "its folder is not there", "Make the folder first.")
        beside = [self.path.with_name(self.path.name + end) for end in ("-wal", "-journal", "-shm")]
        for path in (self.path, *beside):  # SQLite waits at a pipe
            if (path.is_symlink() and path != self.path) or (path.exists() and not path.is_file()):
                raise DataError(f"the store {self.path.name}:", f"{path.name} is no file", "Take it away.")
        with self._plainly():
            self._file = sqlite3.connect(self.path, timeout=_PATIENCE, isolation_level=None)
            try:
                self._open(new)
            except BaseException:
                self._file.close()
                raise

    def _open(self, new: bool) -> None:
        """Make the tables, or check that they are those of this program."""
        run = self._file.execute
        run("PRAGMA trusted_schema = OFF")
        run("PRAGMA synchronous = FULL")
        if new:
            run("BEGIN IMMEDIATE")
            if not run("SELECT count(*) FROM sqlite_master").fetchone()[0]:  # else another process made them meanwhile
                for table in _TABLES.values():
                    run(table)
                run(f"PRAGMA application_id = {_APPLICATION}")
                run(f"PRAGMA user_version = {_SCHEMA}")
            run("COMMIT")
        made, version = (run(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))
        # triggers and views would run
        odd = [name for (name,) in run("SELECT name FROM sqlite_master WHERE type IN ('trigger', 'view')")]
        fault = ""
        if (made, version) != (_APPLICATION, _SCHEMA):
            fault = f"it is of another program or version (layout {version}; this program knows {_SCHEMA})"
        elif odd:
            fault = f"it holds what no store does: {', '.join(odd)}"
        elif not new and run("PRAGMA integrity_check(1)").fetchone()[0] != "ok":
            fault = "it is damaged"
        if fault:
            remedy = "Name a store of this version, or make it anew from its records."
            raise DataError(f"the store {self.path.name}:", fault, remedy)

    @contextmanager
    def _plainly(self) -> Iterator[None]:
        """Turn what SQLite and JSON say of a damaged file into a `DataError`."""
        asked = f"the store {self.path.name}:"
        try:
            yield
        except sqlite3.ProgrammingError:
            raise DataError(asked, "it is closed", "Open it again: Store(path).") from None
        except sqlite3.OperationalError as error:
            remedy = "Check rights and space of its folder, and whether another program holds it."
            raise DataError(asked, f"the system refuses ({error})", remedy) from None
        except DataError:
            raise
        except (sqlite3.Error, ValueError, TypeError, OverflowError) as error:
            raise DataError(asked, f"it is no store, or damaged ({error})", "Make it anew from its records.") from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __len__(self) -> int:
        """Return the number of records, without those that could not be used."""
        with self._plainly():
            return int(self._file.execute("SELECT count(*) FROM record WHERE refused IS NULL").fetchone()[0])

    def unknown(self, paths: Iterable[Path]) -> list[Task]:
        """Return the files whose content is neither stored nor refused, each content once, as tasks.

        Parameters
        ----------
        paths : iterable of path
        """
        found: dict[str, Task] = {}
        for path in paths:
            state = path.stat()
            seen = (str(path), state.st_size, state.st_mtime_ns)
            with self._plainly():
                row = self._file.execute("SELECT size, changed, sha256 FROM seen WHERE path = ?", seen[:1]).fetchone()
            # what lies in a folder changes without its date
            same = row is not None and row[:2] == seen[1:] and path.is_file()
            sha = row[2] if same else source_of_file(path, {}).sha256
            if self._holds(sha) and same:
                continue
            if self._holds(sha):
                with self._transaction():
                    self._see(seen, sha)
            else:
                found.setdefault(sha, Task(path, sha, path.name, seen=seen, replaces=row is not None and row[2] != sha))
        return list(found.values())

    def _holds(self, sha: str) -> bool:
        """Whether a record of this content is stored, or was refused."""
        with self._plainly():
            return self._file.execute("SELECT 1 FROM record WHERE sha256 = ?", (sha,)).fetchone() is not None

    def _see(self, seen: tuple[str, int, int], sha: str) -> None:
        """Keep what a file holds; the record of what it held before is forgotten, if no other file holds that."""
        run = self._file.execute
        old = run("SELECT sha256 FROM seen WHERE path = ? AND sha256 <> ?", (seen[0], sha)).fetchone()
        run("INSERT OR REPLACE INTO seen VALUES (?, ?, ?, ?)", (*seen, sha))
        if old is not None and run("SELECT 1 FROM seen WHERE sha256 = ?", old).fetchone() is None:
            run("DELETE FROM mode WHERE record IN (SELECT id FROM record WHERE sha256 = ?)", old)
            run("DELETE FROM record WHERE sha256 = ?", old)

    def tell(self, alarm: Alarm, hours: float = 48.0) -> bool:
        """Return whether an alarm is to be told: none within so many hours of it was, and from now on it is.

        Parameters
        ----------
        alarm : Alarm
        hours : float
        """
        when, reach = round(1000 * alarm.time), round(3.6e6 * hours)
        near, told = (_ALARM + "%", when - reach, when + reach), (f"{_ALARM}{when}", 0, when, "")
        with self._transaction():
            if self._file.execute("SELECT 1 FROM seen WHERE path LIKE ? AND changed BETWEEN ? AND ?", near).fetchone():
                return False
            self._file.execute("INSERT INTO seen VALUES (?, ?, ?, ?)", told)
            return True

    @named(CHOICES, workers=COUNT, name=str, covariates=Mapping)
    def add(
        self,
        files: Any,
        workers: int = 1,
        times: Any = None,
        covariates: Mapping[str, ArrayLike] | None = None,
        *,
        time: Any = None,
        name: str = "",
        **options: Any,
    ) -> int:
        """Identify records and store their modes, or the reason why one cannot be used; return how many were new.

        What is stored already is left as it is; a file that changed replaces its earlier record.

        Parameters
        ----------
        files : path, sequence of path, or data
            One file, many, or a folder, of which all files are taken that are not being written; or the data of one record, as `analyze`
            takes them.
        workers : int
            Processes that identify; within `working(client)` the workers of its scheduler do.
        times : datetime64, ISO texts or seconds since 1970 (UTC), one per file, optional
            When the records began; by default what the names of the files say, else when they were last changed.
        covariates : mapping of name to number or array, one per file, optional
            What else was measured then.
        time : optional
            As `times`, of one record.
        name : str, optional
            What one record is called; by default its file.
        **options
            As of `analyze`.

        Raises
        ------
        DataError
            A file that is not there, data that are no file without a time, other numbers of times or covariates than of files.
        """
        given, times = dict(covariates or {}), time if times is None else times
        if isinstance(files, Iterator):
            files = list(files)
        several = isinstance(files, list | tuple)
        if not (several and not files) and not are_paths(files):
            return int(self._add_data(files, times, name, given, options))
        paths = [check_path(path) for path in (files if several else [files])]
        if not several and paths[0].is_dir() and paths[0].suffix.lower() != ".zarr":
            paths = settled(paths[0], SETTLED)[0]
        for path in paths:
            if not path.exists():
                raise DataError(f"{str(path)!r}:", "there is no such file", "Check the name.")
        when = None if times is None else np.atleast_1d(as_times("times", times)).astype(float) / 1000
        if when is not None:
            check_shape("times", when, "one per file", (len(paths),))
        columns = {key: real_array(key, np.atleast_1d(x), "(files,)", 1, finite=False) for key, x in given.items()}
        for key, column in columns.items():
            check_shape(key, column, "one value per file", (len(paths),))
        place = {path: k for k, path in enumerate(paths)}
        tasks = [
            task._replace(
                name=name or task.name,
                time=None if when is None else float(when[place[task.path]]),
                covariates={key: float(x[place[task.path]]) for key, x in columns.items()},
            )
            for task in self.unknown(paths)
        ]
        return sum(self.put(entry) for entry in identified(tasks, workers, options))

    def _add_data(
        self, data: Any, time: Any, name: str, covariates: Mapping[str, Any], options: Mapping[str, Any]
    ) -> bool:
        """Identify data that are no file, and store their modes."""
        if time is None:
            raise DataError("a record is stored with its time", "this time is not known", "Give time.")
        seconds = as_seconds("time", time)
        sha = sha256(f"{source_of_data(data).sha256} {seconds}".encode()).hexdigest()
        if self._holds(sha):
            return False
        more = {key: float(x) for key, x in covariates.items()}
        about = {"time": "given"}
        return self.put(
            entry_of(data, sha=sha, name=name, time=seconds, covariates=more, origin=about, options=options)
        )

    @named(name=str, covariates=Mapping)
    def add_modes(
        self,
        modes: ModalModel | History,
        time: Any = None,
        *,
        name: str = "",
        covariates: Mapping[str, float] | None = None,
    ) -> bool:
        """Store modes that were identified elsewhere; return whether any record of them was new.

        Parameters
        ----------
        modes : ModalModel or History
            Of one record, or of many.
        time : datetime64, ISO text or seconds since 1970 (UTC), optional
            Of the one record; `add_modes(time, modes)` is the same.
        name : str, optional
        covariates : mapping of name to number, optional
            Of the one record.

        Raises
        ------
        DataError
            Modes of one record without a time.
        """
        if isinstance(time, ModalModel):
            modes, time = time, modes
        check_kind("modes", modes, (ModalModel, History))
        about = {"modalscope": VERSION, "identified": "elsewhere"}
        if isinstance(modes, History):
            with self._transaction():
                return sum(self._insert(entry) for entry in _entries(modes, about)) > 0
        if time is None:
            raise DataError("modes are stored with the time of their record", "this time is not known", "Give time.")
        rows, seconds = rows_of(modes), as_seconds("time", time)
        sha = _digest(rows, seconds, name)
        more = dict(covariates or {})
        return self.put(Entry(sha256=sha, name=name, time=seconds, modes=rows, covariates=more, provenance=about))

    @named(name=str)
    def add_covariates(self, name: str, times: Any, values: ArrayLike) -> None:
        """Store what was measured beside the records, at times of its own; records get it by interpolation.

        Parameters
        ----------
        name : str
            Such as "temperature".
        times : array of datetime64, ISO texts or seconds since 1970 (UTC), (k,)
        values : array, (k,)
            NaN where it is not known.

        Raises
        ------
        DataError
            Another number of values than of times.
        """
        when = np.atleast_1d(as_times("times", times)).astype(np.int64).tolist()
        column = real_array(name, np.atleast_1d(values), "(times,)", 1, finite=False)
        if column.size != len(when):
            raise DataError(f"{name} needs {len(when)} values", f"it has {column.size}", "Give one for each time.")
        rows = [(name, t, float(x)) for t, x in zip(when, column, strict=True) if x == x]
        with self._transaction():
            self._file.executemany("INSERT OR REPLACE INTO covariate VALUES (?, ?, ?)", rows)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._plainly():
            self._file.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                self._file.execute("ROLLBACK")
                raise
            self._file.execute("COMMIT")

    def put(self, entry: Entry) -> bool:
        """Store an entry, whole or not at all; return whether its content was new.

        Parameters
        ----------
        entry : Entry
        """
        check_kind("entry", entry, Entry)
        with self._transaction():
            return self._insert(entry)

    def _insert(self, entry: Entry) -> bool:
        modes = entry.modes or {"output_dofs": ()}
        rows = [] if entry.modes is None else list(_mode_rows(entry.modes))
        texts = (list(modes["output_dofs"]), entry.covariates, list(entry.findings), entry.settings, entry.provenance)
        row: list[Any] = [entry.sha256, entry.name, round(1000 * entry.time), entry.refused, *map(_text, texts)]
        row[-1] = f'{row[-1][:-1]}{_SEAL if entry.provenance else _SEAL[2:]}{_checksum(row, *rows)}"}}'
        if entry.seen is not None:
            self._see(entry.seen, entry.sha256)
        insert = "INSERT OR IGNORE INTO record VALUES (NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
        done = self._file.execute(insert, row)
        if not done.rowcount:
            return False
        self._file.executemany(
            "INSERT INTO mode VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            [(done.lastrowid, k, *values) for k, values in enumerate(rows)],
        )
        return True

    def _records(self) -> tuple[list[dict[str, Any]], list[list[Any]]]:
        """Return all records by time, and the rows of their modes.

        Raises `DataError`: one is not as it was written; those of 0.2.0 do not tell.
        """
        heads, found = list[dict[str, Any]](), list[list[Any]]()
        modes: dict[int, list[Any]] = {}
        for number, *values in self._file.execute(f"SELECT record, {_MODE} FROM mode ORDER BY record, position"):
            modes.setdefault(number, []).append(values)
        for number, *row in self._file.execute(f"SELECT id, {', '.join(_HEAD)} FROM record ORDER BY time, id"):
            rows = modes.get(number, [])
            body, mark, seal = str(row[-1]).rpartition(_SEAL[2:])
            if mark and seal != f'{_checksum([*row[:-1], body.removesuffix(", ") + "}"], *rows)}"}}':
                fault = f"the record {row[1]!r} is damaged: it is not as it was written"
                raise DataError(f"the store {self.path.name}:", fault, "Make it anew from its records.")
            heads.append(dict(zip(_HEAD, row, strict=True)))
            found.append(rows)
        return heads, found

    def forget_refused(self) -> int:
        """Forget the records that could not be used, so that the next look tries them again; return how many there were."""
        with self._transaction():
            return self._file.execute("DELETE FROM record WHERE refused IS NOT NULL").rowcount

    def about(self) -> list[dict[str, Any]]:
        """Return name, findings, settings and provenance of every record, those that could not be used too, by time."""
        parts = ("findings", "settings", "provenance")
        with self._plainly():
            told = [
                {**{k: r[k] for k in ("name", "refused")}, **{k: json.loads(r[k]) for k in parts}}
                for r in self._records()[0]
            ]
        for each in told:
            each["provenance"].pop("checksum", None)
        return told

    def history(self) -> History:
        """Return the modes of all records by time.

        Raises
        ------
        DataError
            A damaged file.
        """
        with self._plainly():
            self._file.execute("BEGIN")  # all tables as they are now, whoever writes
            try:
                pairs = [(head, rows) for head, rows in zip(*self._records(), strict=True) if head["refused"] is None]
                weather = self._file.execute("SELECT name, time, value FROM covariate ORDER BY name, time").fetchall()
            finally:
                self._file.execute("ROLLBACK")
            rows = [_rows([row[:5] for row in each], json.loads(head["dofs"])) for head, each in pairs]
            own = [json.loads(head["covariates"]) for head, _ in pairs]
        times = np.array([head["time"] for head, _ in pairs], "datetime64[ms]")
        names = [head["name"] for head, _ in pairs]
        return assembled(rows, times, names, covariates=_covariates(own, weather, times.astype(np.int64)))

    @property
    def records(self) -> np.recarray[Any, Any]:
        """All records by time, a record array (`pandas.DataFrame(store.records)` is a table).

        `time` in seconds since 1970 (UTC), `file`, `state`: "used" or "refused", `reason`: why it could not be used.
        """
        with self._plainly():
            rows = [
                (r["time"] / 1000, r["name"], "used" if r["refused"] is None else "refused", r["refused"] or "")
                for r in self._records()[0]
            ]
        kinds = [("time", float), ("file", object), ("state", object), ("reason", object)]
        return np.array(rows, kinds).view(np.recarray)

    def tracks(self) -> Tracks:
        """Return the modes of all records joined into tracks; see `track`."""
        return track(self.history())

    @named(covariates=Mapping, false_per_year=POSITIVE)
    def alarms(
        self,
        false_per_year: float = 1.0,
        reference: Any = None,
        covariates: Mapping[str, ArrayLike] | None = None,
        **options: Any,
    ) -> list[Alarm]:
        """Return the changes that weather does not explain; see `alarms`, which also gives the chart.

        Parameters
        ----------
        false_per_year : float
            Alarms a year without any change.
        reference : (first, last) times or array of bool, optional
            Records of the sound structure; by default the first half of the time.
        covariates : mapping of name to array, optional
            Values at the times of the records, in their order: of those that were used, or of all; by default those of the store.
        **options
            `deviations`, `chart`, `memory`, `seed`.
        """
        tracks, used = self.tracks(), self.records.state == "used"
        if covariates is not None:
            covariates = {name: np.asarray(x)[used] if np.size(x) == used.size else x for name, x in covariates.items()}
        return list(
            alarms(tracks, false_per_year=false_per_year, reference=reference, covariates=covariates, **options).alarms
        )

    def to_pandas(self) -> Any:
        """Return a DataFrame, one row per mode; see `History.to_pandas`."""
        return self.history().to_pandas()


def _text(value: Any) -> str:
    """Return a value as JSON; numbers that are none become null."""
    return json.dumps(plain(value), default=str, allow_nan=False)


def _checksum(*rows: Sequence[Any]) -> str:
    """Return the SHA-256 of rows of a table, which SQLite does not keep."""
    digest = sha256()
    for row in rows:
        for value in row:
            data = value if isinstance(value, bytes) else repr(value).encode(errors="backslashreplace")
            digest.update(b"%d:" % len(data) + data)
    return digest.hexdigest()


def _number(value: Any) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def _mode_rows(modes: Mapping[str, Any]) -> Iterator[tuple[Any, ...]]:
    """Give frequency, damping ratio, deviations, shape with its deviations, and gain of each mode."""
    std, gain = modes.get("shapes_std"), modes.get("gain")
    for k in range(len(modes["frequencies"])):
        yield (
            *(_number(modes[name][k]) for name in PER_MODE),
            np.asarray(modes["shapes"][k], "<c16").tobytes(),
            None if std is None else np.asarray(std[k], "<f8").tobytes(),
            None if gain is None else _number(gain[k]),
        )


def _rows(stored: Sequence[Sequence[Any]], dofs: Any) -> dict[str, Any]:
    """Return the modes of one record by field."""
    columns = zip(*(numbers for *numbers, _ in stored), strict=True) if stored else [()] * len(PER_MODE)
    values = {name: np.array(column, float) for name, column in zip(PER_MODE, columns, strict=True)}
    shapes = np.frombuffer(b"".join(blob for *_, blob in stored), "<c16").reshape(len(stored), len(dofs))
    return {**values, "shapes": shapes, "output_dofs": tuple(map(str, dofs))}


def _entries(history: History, about: Mapping[str, Any]) -> Iterator[Entry]:
    """Give the records of a history one by one."""
    starts = np.searchsorted(history.record, np.arange(len(history) + 1))
    for k, (start, stop) in enumerate(pairwise(starts)):
        here = slice(start, stop)
        measured = np.isfinite(history.shapes[here]).any(axis=0) | (stop == start)
        rows: dict[str, Any] = {name: getattr(history, name)[here] for name in PER_MODE}
        rows["shapes"] = history.shapes[here][:, measured]
        rows["output_dofs"] = tuple(d for d, kept in zip(history.output_dofs, measured.tolist(), strict=True) if kept)
        more = {name: float(x[k]) for name, x in history.covariates.items() if np.isfinite(x[k])}
        seconds, name = float(history.seconds[k]), history.names[k]
        sha = _digest(rows, seconds, name)
        yield Entry(sha256=sha, name=name, time=seconds, modes=rows, covariates=more, provenance=about)


def _digest(rows: Mapping[str, Any], seconds: float, name: str) -> str:
    """Return the SHA-256 of modes with their time and name."""
    found = sha256(f"{seconds} {name} {rows['output_dofs']}".encode())
    for field_name in (*PER_MODE, "shapes"):
        found.update(np.ascontiguousarray(rows[field_name]).tobytes())
    return found.hexdigest()


def _covariates(own: Sequence[Any], weather: Sequence[tuple[str, int, float]], times: Any) -> dict[str, RealArray]:
    """Return covariates of all records: their own, else those of the weather's table at their times."""
    found: dict[str, RealArray] = {}
    series: dict[str, list[tuple[int, float]]] = {}
    for name, when, value in weather:
        series.setdefault(str(name), []).append((when, value))
    for name, pairs in series.items():
        found[name] = at_times(times, *np.array(pairs, float).T)
    for k, values in enumerate(own):
        for name, value in dict(values).items():
            column = found.setdefault(str(name), np.full(len(own), np.nan))
            column[k] = np.nan if value is None else float(value)
    return found


def at_times(times: Any, known: RealArray, values: RealArray) -> RealArray:
    """Return values at other times, linear between their neighbours; NaN in gaps of more than four of their usual steps.

    Examples
    --------
    >>> at_times(np.array([0.5, 8.0, 12.0]), np.array([0.0, 1.0, 2.0, 3.0, 12.0]), np.array([0.0, 1.0, 2.0, 3.0, 4.0]))
    array([0.5, nan, 4. ])
    """
    when = np.asarray(times, float)
    order = np.argsort(known, kind="stable")
    known, values = known[order], values[order]
    found = np.interp(when, known, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(known, when), 1, max(known.size - 1, 1))
    if known.size > 1:
        wide = known[after] - known[after - 1] > 4 * np.median(np.diff(known))
        found[wide & ~np.isin(when, known)] = np.nan
    return np.asarray(found)
