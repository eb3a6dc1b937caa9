"""Results of many runs: rows per run, item and skill, and the database that stores them.

`schema.sql` describes the fields.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import re
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass
from itertools import pairwise, product
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter

from executive.cell.json_values import DECIMAL_PLACES, to_json
from executive.errors import InputError
from executive.events import ItemChanged, RunStatus
from executive.record.result import Audit, ItemCounts, Result, describe_disagreement
from executive.record.timeline import PlanningTotals, Timeline
from executive.view.terminal import format_repeat_command

FILE_NAME = "results.sqlite"
"""Name of the database in the folder of a sweep."""
SCHEMA_PATH = Path(__file__).with_name("schema.sql")
"""Statements that create the tables."""
BUSY_TIMEOUT = 60.0
"""Maximum time for which a transaction waits for another program that reads the file [s]."""
JSON_COLUMNS = ("overrides", "variations", "versions", "variant")
"""Columns with the JSON text of a mapping."""
MAX_RUN_COUNT = 50_000
"""Maximum number of runs of a sweep; all rows are in memory while a sweep is summarized."""
MAX_VARIANT_COUNT = 500
"""Maximum number of variants of a sweep; each variant is checked before the first run."""
MAX_FILE_SIZE = 500_000_000
"""Maximum size of a database that is read [byte]."""
MAX_TEXT_LENGTH = 1_000_000
"""Maximum length of a text that is read [characters]."""
MAX_NUMBER = 1e15
"""Maximum of the numbers that are read; their sums are finite and exact."""
ENVIRONMENT_REASON = "environment"
"""Reason of a run that ended because of the disk, the memory or a killed process; it is repeated."""
RowT = TypeVar("RowT")


@dataclass(frozen=True, kw_only=True)
class SweepSettings:
    """Settings of a sweep, from which its jobs are computed."""

    mission: str
    mission_name: str
    cell: str
    replacing_cell: str = ""
    overrides: Mapping[str, str]
    variations: Mapping[str, tuple[str, ...]]
    first_seed: int
    last_seed: int
    scene: Path | None = None
    saves_images: bool
    inputs_hash: str
    versions: Mapping[str, str]

    def __post_init__(self) -> None:
        """Raise InputError if the sweep has no run, or more runs or variants than can be summarized."""
        if not 0 < self.run_count <= MAX_RUN_COUNT or self.variant_count > MAX_VARIANT_COUNT:
            raise InputError(
                f"the sweep has {self.run_count} runs of {self.variant_count} variants; a sweep has 1 to "
                f"{MAX_RUN_COUNT} runs of at most {MAX_VARIANT_COUNT} variants; change the seeds or --vary"
            )

    @property
    def variant_count(self) -> int:
        """Number of combinations of the varied values."""
        return math.prod(map(len, self.variations.values()))

    @property
    def run_count(self) -> int:
        """Number of runs of the complete sweep."""
        return self.variant_count * (self.last_seed - self.first_seed + 1)

    @property
    def combinations(self) -> list[tuple[dict[str, str], int]]:
        """Variant and seed of each run, variant by variant and seed by seed."""
        return list(product(self.variants, range(self.first_seed, self.last_seed + 1)))

    @property
    def variants(self) -> list[dict[str, str]]:
        """Each combination of the varied values by name; one empty combination if no value is varied."""
        names = self.variations
        return [dict(zip(names, values, strict=True)) for values in product(*names.values())]

    @property
    def driver_options(self) -> dict[str, str]:
        """Options of the driver by name."""
        return {} if self.scene is None else {"scene": str(self.scene)}

    def make_repeat_command(self, run: RunRow) -> str:
        """Return the command line that repeats a run of the sweep."""
        overrides = {**self.overrides, **run.variant}
        options = {"cell": self.replacing_cell, **self.driver_options}
        return format_repeat_command(self.mission, run.seed, overrides, (), options)


@dataclass(frozen=True, kw_only=True)
class RunRow:
    """A run; `items`, `audit` and `planning` have a column for each of their fields."""

    run_index: int
    seed: int
    variant: Mapping[str, str] = field(default_factory=dict)
    status: RunStatus
    reason: str = ""
    message: str = ""
    node: str = ""
    items: ItemCounts = field(default_factory=ItemCounts)
    audit: Audit | None = None
    planning: PlanningTotals = field(default_factory=PlanningTotals)
    ticks: int = 0
    robot_time_s: float = 0.0
    wall_time_s: float = 0.0
    decision_hash: str = ""
    run_directory: str = ""
    crashes: int = 0

    @property
    def is_success(self) -> bool:
        """True if the run succeeded."""
        return self.status == "SUCCESS"

    @property
    def problem(self) -> str:
        """Reason for the failure, or "" if there is no problem.

        The value is `disagreement` if the run succeeded but the audit contradicts the ledger.
        """
        if self.is_success:
            return "disagreement" if describe_disagreement(self.audit, self.items) else ""
        return self.reason or self.status

    @property
    def explanation(self) -> str:
        """The message; if it is empty, a description of the disagreement of audit and ledger, or ""."""
        return self.message or describe_disagreement(self.audit, self.items)


@dataclass(frozen=True, kw_only=True)
class SkillRow:
    """All activations of one skill in a run."""

    run_index: int
    skill: str
    activations: int
    failed_activations: int
    robot_time_s: float


def describe_variant(variant: Mapping[str, str]) -> str:
    """Return the values of the varied params and keys as text, for instance `speed=1, attempts=3`."""
    return ", ".join(f"{key}={value}" for key, value in variant.items())


@dataclass(frozen=True)
class RunRecord:
    """All rows of one run.

    Attributes:
        run: Row of the run.
        items: Last change of each item, and the time during which the item was the selected target and had no
            final state [s], in the order of their detection.
        skills: Rows of the skills, in the order of their first activation.
    """

    run: RunRow
    items: tuple[tuple[ItemChanged, float], ...] = ()
    skills: tuple[SkillRow, ...] = ()


def make_record(run_index: int, variant: Mapping[str, str], result: Result, timeline: Timeline) -> RunRecord:
    """Return the rows of a run; times are rounded as in `result.json`.

    Args:
        run_index: Index of the run in the sweep.
        variant: Values of the varied params and keys of the cell, by name.
        result: Result of the run.
        timeline: Timeline of the run; it must keep its history (`has_history`).
    """
    values = {**to_json(result), "decision_hash": result.trace, "run_directory": result.run}
    run = TypeAdapter(RunRow).validate_python({**values, "run_index": run_index, "variant": variant})
    items = tuple((item, _measure_item_time(item.item, timeline)) for item in timeline.items.changes.values())
    return RunRecord(run, items, tuple(_list_skills(run_index, timeline)))


def _measure_item_time(name: str, timeline: Timeline) -> float:
    end_time = timeline.items.change_times[name]
    durations = (
        max(0.0, min(next_time, end_time) - time)
        for (time, item), (next_time, _) in pairwise([*timeline.selection_times, (timeline.clock, "")])
        if item == name
    )
    return round(sum(durations), DECIMAL_PLACES)


def _list_skills(run_index: int, timeline: Timeline) -> Iterator[SkillRow]:
    for skill in dict.fromkeys(activation.skill for activation in timeline.activations if activation.skill):
        activations = [activation for activation in timeline.activations if activation.skill == skill]
        time = sum(activation.end - activation.start for activation in activations)
        yield SkillRow(
            run_index=run_index, skill=skill, activations=len(activations),
            failed_activations=sum(activation.status == "FAILURE" for activation in activations),
            robot_time_s=round(time, DECIMAL_PLACES),
        )  # fmt: skip


class ResultsDatabase:
    """An open database; each run is stored in one transaction, so that no program reads a part of a run.

    The file has a rollback journal, because a write-ahead log would need two more files and shared memory,
    which network file systems do not have.

    Args:
        path: The file.
        settings: Settings with which the database is created and locked; None to open an existing database.

    Attributes:
        path: The file.
        settings: Settings of the sweep.

    Raises:
        InputError: The file is missing, is no database of this schema version, or cannot be written.
    """

    def __init__(self, path: Path, settings: SweepSettings | None = None) -> None:
        self.path = path
        self._resources = contextlib.ExitStack()
        if settings is None and not (path.is_file() and path.stat().st_size <= MAX_FILE_SIZE):
            raise InputError(
                f'there is no file "{path}", or it has more than {MAX_FILE_SIZE // 1_000_000} MB; '
                f"name the file {FILE_NAME} of a sweep, or its folder"
            )
        schema = SCHEMA_PATH.read_text(encoding="utf-8")
        with self._convert_errors():
            connection = sqlite3.connect(path, timeout=BUSY_TIMEOUT)
            self._connection = self._resources.enter_context(contextlib.closing(connection))
            self._connection.row_factory = sqlite3.Row
            if settings is not None:
                with self._connection as connection:
                    # Tables and settings are written in one transaction.
                    connection.executescript(f"BEGIN; {schema}")
                    self._insert("settings", encode_row(settings))
            (version,) = self._connection.execute("PRAGMA user_version").fetchone()
            (state,) = self._connection.execute("PRAGMA quick_check(1)").fetchone()
            rows = self._connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
            # Views and computed columns of a foreign file could take any time and memory.
            found = ";".join((f"PRAGMA user_version = {version}", *(sql for (sql,) in rows), ""))
            # Comments and blanks do not count.
            if len({re.sub(r"--.*|\s+", "", text) for text in (found, schema)}) > 1 or state != "ok":
                raise InputError(
                    f'"{path}" is no database of a sweep: it has schema version {version} or other tables '
                    f"than this program writes, or is damaged ({state}); start a new sweep"
                )
            (self.settings,) = self._select(SweepSettings, "settings")
        if settings is not None:
            self.lock()

    def lock(self) -> None:
        """Reserve the sweep for this process until the database is closed; other processes can read the file.

        Raises:
            InputError: Another process has reserved the sweep.
        """
        descriptor = os.open(self.path.parent, os.O_RDONLY)
        self._resources.callback(os.close, descriptor)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
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
        with self._convert_errors(), self._connection:
            self._insert("runs", encode_row(record.run))
            for item, time in record.items:
                self._insert("items", {
                    "run_index": record.run.run_index, "item": item.item, "label": item.label,
                    "state": item.state, "bin": item.bin, "failed_attempts": item.attempts,
                    "robot_time_s": time,
                })  # fmt: skip
            for skill in record.skills:
                self._insert("skills", encode_row(skill))

    def delete_environment_faults(self) -> None:
        """Delete all rows of the runs that ended because of disk, memory or a killed process."""
        query = f"SELECT run_index FROM runs WHERE status = 'FAULT' AND reason = '{ENVIRONMENT_REASON}'"
        with self._convert_errors(), self._connection as connection:
            for table in ("items", "skills", "runs"):
                connection.execute(f"DELETE FROM {table} WHERE run_index IN ({query})")

    def read_runs(self) -> list[RunRow]:
        """Return the rows of all runs, in the order of the jobs.

        Raises:
            InputError: A row is damaged, or is no run of this sweep.
        """
        runs = self._select(RunRow, "runs ORDER BY run_index")
        combinations = dict(enumerate(self.settings.combinations))
        for run in runs:
            if combinations.get(run.run_index) != (run.variant, run.seed):
                raise InputError(f'"{self.path}" is damaged: run {run.run_index} is no run of the sweep')
        return runs

    def read_skills(self) -> list[SkillRow]:
        """Return the rows of all skills, sorted by run."""
        return self._select(SkillRow, "skills ORDER BY run_index, rowid")

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def _insert(self, table: str, columns: Mapping[str, Any]) -> None:
        placeholders = ", ".join("?" * len(columns))
        statement = f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({placeholders})"
        self._connection.execute(statement, tuple(columns.values()))

    def _select(self, row_class: type[RowT], source: str) -> list[RowT]:
        # The adapter also converts the numbers of SQLite, which has no Boolean type.
        adapter = TypeAdapter(row_class)
        with self._convert_errors():
            cursor = self._connection.execute(f"SELECT * FROM {source}")
            return [adapter.validate_python(_decode_columns(row)) for row in cursor]

    @contextlib.contextmanager
    def _convert_errors(self) -> Iterator[None]:
        """Convert an error of SQLite or of a damaged value to an InputError with the path of the file."""
        try:
            yield
        except (sqlite3.Error, ValueError, TypeError, AttributeError, RecursionError, MemoryError) as error:
            problem = "; ".join(str(error).split("\n")[:3]) or type(error).__name__
            raise InputError(
                f'the results "{self.path}" cannot be read or written: {problem}; '
                "runs that were stored before this error may still be in the file"
            ) from error


def encode_row(row: SweepSettings | RunRow | SkillRow) -> dict[str, Any]:
    """Return the columns of a row, without the columns of values that are None."""
    columns = {name: value for name, value in vars(row).items() if value is not None}
    for name, value in list(columns.items()):
        if name in JSON_COLUMNS:
            columns[name] = json.dumps(value, ensure_ascii=False)
        elif isinstance(value, Path):
            columns[name] = str(value)
        elif is_dataclass(value):
            del columns[name]
            columns |= {f"{name}_{key}": number for key, number in vars(value).items()}
    return columns


def _decode_columns(row: sqlite3.Row) -> dict[str, Any]:
    """Return the values of a row by field, without the columns that are NULL.

    Raises:
        ValueError: A number is negative, too large or not finite, or a text is too long or no JSON.
    """
    values: dict[str, Any] = {}
    for column, value in dict(row).items():
        part, _, name = column.partition("_")
        if value is None:
            continue
        if isinstance(value, (int, float)) and not 0 <= value <= MAX_NUMBER:
            raise ValueError(f"{column} is {value:g}; the numbers are 0 to {MAX_NUMBER:g}")
        if not isinstance(value, (int, float)) and (len(value) > MAX_TEXT_LENGTH or "\0" in str(value)):
            raise ValueError(f"{column} is too long, or contains a null character")
        if part in ("items", "audit", "planning"):
            values.setdefault(part, {})[name] = value
        else:
            values[column] = json.loads(value) if column in JSON_COLUMNS else value
    return values
