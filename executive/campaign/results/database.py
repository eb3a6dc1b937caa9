"""Database of a sweep: one SQLite file with the settings, and the rows of each completed run."""

from __future__ import annotations

import contextlib
import fcntl
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from executive.campaign.results.rows import RunRecord, SweepSettings
from executive.campaign.results.tables import ITEMS, RUNS, SETTINGS, SKILLS, RowT, Table
from executive.errors import InputError

FILE_NAME = "results.sqlite"
"""Name of the database in the folder of a sweep."""
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
            advice = f"name the file {FILE_NAME} of a sweep, or its folder"
            raise InputError(f'there is no file "{path}"; {advice}')
        with self._convert_sqlite_errors():
            self._connection = sqlite3.connect(path, timeout=BUSY_TIMEOUT)
            if settings is not None:
                self._create_tables(settings)
            (version,) = self._connection.execute("PRAGMA user_version").fetchone()
        if version != SCHEMA_VERSION:
            problem = f'"{path}" is no database of a sweep, or has the schema version {version}'
            raise InputError(f"{problem}; this program reads version {SCHEMA_VERSION}; start a new sweep")
        (self.settings,) = self.read(SETTINGS)

    def lock(self) -> None:
        """Reserve the sweep for this process until the database is closed; other processes can read the file.

        Raises:
            InputError: Another process has reserved the sweep.
        """
        self._lock_descriptor = os.open(self.path.parent, os.O_RDONLY)
        try:
            fcntl.flock(self._lock_descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            advice = "wait until that process has ended; otherwise, runs would be executed twice"
            raise InputError(f'another process executes the sweep "{self.path}"; {advice}') from error

    def append(self, record: RunRecord) -> None:
        """Store the rows of a run in one transaction.

        Raises:
            InputError: The file cannot be written, or contains the run already.
        """
        with self._convert_sqlite_errors(), self._connection as connection:
            connection.execute(RUNS.insertion_sql, RUNS.encode(record.run))
            connection.executemany(ITEMS.insertion_sql, map(ITEMS.encode, record.items))
            connection.executemany(SKILLS.insertion_sql, map(SKILLS.encode, record.skills))

    def read(self, table: Table[RowT]) -> list[RowT]:
        """Return all rows of a table, sorted by the first column of the key, then by insertion."""
        with self._convert_sqlite_errors(), closing(self._connection.execute(table.selection_sql)) as cursor:
            return list(map(table.decode, cursor))

    def close(self) -> None:
        """Close the file."""
        self._connection.close()
        if self._lock_descriptor is not None:
            os.close(self._lock_descriptor)
            self._lock_descriptor = None

    def _create_tables(self, settings: SweepSettings) -> None:
        with self._connection as connection:
            for table in (SETTINGS, RUNS, ITEMS, SKILLS):
                connection.execute(table.creation_sql)
            connection.execute(SETTINGS.insertion_sql, SETTINGS.encode(settings))
            connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")

    @contextlib.contextmanager
    def _convert_sqlite_errors(self) -> Iterator[None]:
        """Convert an error of SQLite to an InputError with the path of the file."""
        try:
            yield
        except sqlite3.Error as error:
            problem = f'the results "{self.path}" cannot be read or written: {error}'
            advice = "runs that were stored before this error may still be in the file"
            raise InputError(f"{problem}; {advice}") from error


def get_database_path(path: Path) -> Path:
    """Return the path of the database: `path`, or the file in it if `path` is a folder."""
    return path / FILE_NAME if path.is_dir() else path
