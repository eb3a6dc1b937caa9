"""Database of a sweep: one SQLite file with the settings, and the rows of each completed run."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from executive.campaign.results.rows import RunRecord, RunRow, SkillRow, SweepSettings
from executive.errors import InputError
from executive.record.result import Audit, ItemCounts
from executive.record.timeline import PlanningTotals

FILE_NAME = "results.sqlite"
"""Name of the database in the folder of a sweep."""
SCHEMA_PATH = Path(__file__).with_name("schema.sql")
"""Statements that create the tables."""
SCHEMA_VERSION = 1
"""Version of the tables, stored as `user_version` of the file."""
BUSY_TIMEOUT = 60.0
"""Maximum time for which a transaction waits for another program that reads the file [s]."""


class ResultsDatabase:
    """An open database; each run is stored in one transaction, so that no program reads a part of a run.

    The file has a rollback journal, because a write-ahead log would need two more files and shared memory,
    which network file systems do not have.

    Args:
        path: The file.
        settings: Settings with which the database is created; None to open an existing database.

    Attributes:
        path: The file.
        settings: Settings of the sweep.

    Raises:
        InputError: The file is missing, is no database of this schema version, or cannot be written.
    """

    def __init__(self, path: Path, settings: SweepSettings | None = None) -> None:
        self.path = path
        self._lock_descriptor: int | None = None
        if settings is None and not path.is_file():
            raise InputError(
                f'there is no file "{path}"; name the file {FILE_NAME} of a sweep, or its folder'
            )
        with self._convert_sqlite_errors():
            self._connection = sqlite3.connect(path, timeout=BUSY_TIMEOUT)
            self._connection.row_factory = sqlite3.Row
            if settings is not None:
                with self._connection as connection:
                    # Tables and settings are written in one transaction.
                    connection.executescript(f"BEGIN; {SCHEMA_PATH.read_text(encoding='utf-8')}")
                    self._insert("settings", [_encode_settings(settings)])
            (version,) = self._connection.execute("PRAGMA user_version").fetchone()
        if version != SCHEMA_VERSION:
            raise InputError(
                f'"{path}" is no database of a sweep, or has the schema version {version}; '
                f"this program reads version {SCHEMA_VERSION}; start a new sweep"
            )
        (self.settings,) = map(_decode_settings, self._select("settings"))

    def lock(self) -> None:
        """Reserve the sweep for this process until the database is closed; other processes can read the file.

        Raises:
            InputError: Another process has reserved the sweep.
        """
        self._lock_descriptor = os.open(self.path.parent, os.O_RDONLY)
        try:
            fcntl.flock(self._lock_descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(
                f'another process executes the sweep "{self.path}"; '
                "wait until that process has ended; otherwise, runs would be executed twice"
            ) from error

    def append(self, record: RunRecord) -> None:
        """Store the rows of a run in one transaction.

        Raises:
            InputError: The file cannot be written, or contains the run already.
        """
        with self._convert_sqlite_errors(), self._connection:
            self._insert("runs", [encode_run(record.run)])
            self._insert("items", map(vars, record.items))
            self._insert("skills", map(vars, record.skills))

    def read_runs(self) -> list[RunRow]:
        """Return the rows of all runs, in the order of the jobs."""
        return list(map(_decode_run, self._select("runs ORDER BY run_index")))

    def read_skills(self) -> list[SkillRow]:
        """Return the rows of all skills, sorted by run."""
        return [SkillRow(**row) for row in self._select("skills ORDER BY run_index, rowid")]

    def close(self) -> None:
        """Close the file."""
        self._connection.close()
        if self._lock_descriptor is not None:
            os.close(self._lock_descriptor)
            self._lock_descriptor = None

    def _insert(self, table: str, rows: Iterable[Mapping[str, Any]]) -> None:
        for row in rows:
            placeholders = ", ".join("?" * len(row))
            statement = f"INSERT INTO {table} ({', '.join(row)}) VALUES ({placeholders})"
            self._connection.execute(statement, tuple(row.values()))

    def _select(self, source: str) -> list[dict[str, Any]]:
        with self._convert_sqlite_errors():
            return [dict(row) for row in self._connection.execute(f"SELECT * FROM {source}")]

    @contextlib.contextmanager
    def _convert_sqlite_errors(self) -> Iterator[None]:
        """Convert an error of SQLite to an InputError with the path of the file."""
        try:
            yield
        except sqlite3.Error as error:
            raise InputError(
                f'the results "{self.path}" cannot be read or written: {error}; '
                "runs that were stored before this error may still be in the file"
            ) from error


def get_database_path(path: Path) -> Path:
    """Return the path of the database: `path`, or the file in it if `path` is a folder."""
    return path / FILE_NAME if path.is_dir() else path


def encode_run(run: RunRow) -> dict[str, Any]:
    """Return the columns of a run; those of the audit are missing if there was no audit."""
    columns = {**vars(run), "variant": _to_json_text(run.variant)}
    for prefix in ("items", "audit", "planning"):
        part = columns.pop(prefix)
        if part is not None:
            columns |= {f"{prefix}_{name}": value for name, value in vars(part).items()}
    return columns


def _decode_run(columns: dict[str, Any]) -> RunRow:
    parts: dict[str, dict[str, Any]] = {"items": {}, "audit": {}, "planning": {}}
    for column in list(columns):
        prefix, _, name = column.partition("_")
        if prefix in parts:
            parts[prefix][name] = columns.pop(column)
    has_audit = parts["audit"]["agrees"] is not None
    # SQLite has no Boolean type.
    audit = Audit(**{**parts["audit"], "agrees": bool(parts["audit"]["agrees"])}) if has_audit else None
    columns["variant"] = json.loads(columns["variant"])
    return RunRow(
        **columns,
        items=ItemCounts(**parts["items"]),
        audit=audit,
        planning=PlanningTotals(**parts["planning"]),
    )


def _encode_settings(settings: SweepSettings) -> dict[str, Any]:
    columns = {**vars(settings), "scene": settings.scene and str(settings.scene)}
    for name in ("overrides", "variations", "versions"):
        columns[name] = _to_json_text(columns[name])
    return columns


def _decode_settings(columns: dict[str, Any]) -> SweepSettings:
    for name in ("overrides", "variations", "versions"):
        columns[name] = json.loads(columns[name])
    columns["variations"] = {name: tuple(values) for name, values in columns["variations"].items()}
    columns["scene"] = columns["scene"] and Path(columns["scene"])
    columns["saves_images"] = bool(columns["saves_images"])
    return SweepSettings(**columns)


def _to_json_text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)
