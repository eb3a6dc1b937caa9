"""Damaged records of a run: each is read, replayed and resumed, or refused with a message.

One run of a mission is recorded; all damaged records are copies of it. A copy is damaged at random; or its
journal is cut off, while the world went on; or the run is killed, and the last blocks of its logs are
removed. The database of a sweep is damaged in the same way. Each command runs in a forked child.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import sqlite3
from collections import Counter
from contextlib import closing, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from executive.campaign.jobs import JobOptions, MissionUnderTest
from executive.campaign.results import FILE_NAME
from executive.campaign.sweep import create_comparison, make_settings, run_sweep
from executive.cli.main import main
from executive.drivers.world_log import FILE_HEADER
from executive.errors import InputError
from executive.events import NodeEnded, TimedEvent
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import replay_and_compare, resume_run
from executive.record.result import Result
from executive.record.run_directory import LATEST_LINK, RunDirectory, find_run
from executive.run.assembly import RunOptions
from executive.run.replay import InputLog
from tests.benchmarks.forks import ForkRunner
from tests.benchmarks.hostile_input import find_problems, run_in_child, summarize
from tests.benchmarks.kills import RESUME_TIMEOUT, run_and_kill
from tests.benchmarks.report import Figures, SilentView, describe, run_command, show_progress

MIN_AGREEMENT = 0.9
"""Smallest share of resumed runs in which ledger and audit have to agree."""
MAX_LOST_BLOCKS = 2
"""Largest number of blocks that are removed from the end of a log."""
BLOCK = 4096
"""Size of a block of a disk [bytes]."""
ODD_VALUES = (
    None, True, -1, 0, 7, 10**12, -0.5, 1e308, math.inf, "", "x", "\x1b[31m", "x" * 500, [], [1], ["x"], {},
    {"a": 1},
)  # fmt: skip
"""Values that replace a value of an event."""
SQL_VALUES = (
    "NULL", "-1", "9e999", "1e308", str(2**63 - 1), "''", "x'ff00fe'", "CAST(x'ff' AS TEXT)", "char(0)",
    "char(27) || '[31m'", "hex(zeroblob(30000000))", "replace(hex(zeroblob(9999)), '0', '[')", "'[]'",
)  # fmt: skip
"""Values, as SQL, that replace a value of a database."""
SQL_STATEMENTS = (
    "DROP TABLE {0}", "DELETE FROM settings", "DELETE FROM {0} WHERE rowid = 2", "PRAGMA user_version = 2",
    "ALTER TABLE {0} DROP COLUMN {1}", "ALTER TABLE {0} ADD COLUMN x", "UPDATE {0} SET rowid = rowid + 2",
    "DROP TABLE {0}; CREATE VIEW {0} AS WITH RECURSIVE x(i) AS (VALUES(1) UNION ALL SELECT i + 1 FROM x) "
    "SELECT i AS {1} FROM x", "INSERT INTO settings (mission, mission_name) VALUES ('x', 'y')",
)  # fmt: skip
"""Statements that damage a database; the arguments are a table and a column."""
OTHER_FILES = ("tree.json", "cell.yaml", "mission.yaml", "params.yaml", "result.json", "world.log", "frames")
"""Files of a run directory besides its journal."""


def damage_run(rng: Random, path: Path) -> str:
    """Damage the journal of a run or, in one case of five, another file; return the damage in words."""
    file = path / (rng.choice(OTHER_FILES) if rng.random() < 0.2 else "journal.jsonl")
    if file.is_dir():
        file = rng.choice([file, *sorted(file.iterdir())])
    kind = rng.choice(("file", "bytes", "end"))
    if file.name == "journal.jsonl":
        kind = rng.choice(("value", "value", "value", "number", "number", "key", "line", "bytes", "end"))
    if kind == "file" or not file.is_file():
        shutil.rmtree(file, ignore_errors=True)
        file.unlink(missing_ok=True)
        return f"no {file.name}"
    content = file.read_bytes()
    if kind == "bytes":
        content = _damage_bytes(rng, content)
    elif kind == "end":
        content = content[: rng.randrange(len(content) + 1)] + rng.choice((b"", bytes(BLOCK)))
    else:
        content = _damage_event(rng, content, kind)
    # A picture is a link to the file of another copy of the run.
    file.unlink()
    file.write_bytes(content)
    return f"{kind} in {file.name}"


def damage_database(rng: Random, file: Path) -> str:
    """Damage a value, the tables or the bytes of the database of a sweep; return the damage in words."""
    kind = rng.choice(("value", "value", "statement", "bytes", "end"))
    if kind in ("bytes", "end"):
        content = file.read_bytes()
        cut = content[: rng.randrange(len(content))]
        file.write_bytes(cut if kind == "end" else _damage_bytes(rng, content))
        return kind
    with closing(sqlite3.connect(file)) as connection, connection:
        table = rng.choice(("settings", "settings", "runs", "runs", "items", "skills"))
        _, column, *_ = rng.choice(connection.execute(f"PRAGMA table_info({table})").fetchall())
        statement = f"UPDATE {table} SET {column} = {rng.choice(SQL_VALUES)} WHERE rowid = 1"
        if kind == "statement":
            statement = rng.choice(SQL_STATEMENTS).format(table, column)
        with suppress(sqlite3.Error):  # For instance, no column of a key can be dropped.
            connection.executescript(statement)
    return statement


def _damage_event(rng: Random, content: bytes, kind: str) -> bytes:
    """Return a journal with another line, key, value or number in one event."""
    lines = content.splitlines(keepends=True)
    number = rng.randrange(len(lines))
    line = lines[number]
    if kind == "line":
        lines[number] = rng.choice(
            (b"", line * 2, rng.choice(lines), b"\n", b"null\n", b"[" * 9999, line[:-9] + b"\n")
        )
        return b"".join(lines)
    event = json.loads(line)
    if kind == "key":
        key = rng.choice(list(event))
        event[rng.choice((key + "s", "x", key.upper()))] = event.pop(key)
    else:
        places = [
            (holder, key)
            for holder, key in _list_places(event)
            if kind == "value" or type(holder[key]) in (int, float)
        ]
        holder, key = rng.choice(places)
        holder[key] = rng.choice([value for value in ODD_VALUES if kind == "value" or type(value) is int])
    lines[number] = json.dumps(event).encode() + b"\n"
    return b"".join(lines)


def _list_places(value: Any) -> list[tuple[Any, Any]]:
    """Return the holder and the key of each value inside of `value`, at any depth."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    return [(value, key) for key in keys] + [place for key in keys for place in _list_places(value[key])]


def _damage_bytes(rng: Random, content: bytes) -> bytes:
    """Return content with some other bytes, with a part missing or repeated, or with a block of zeros."""
    start = rng.randrange(max(len(content), 1))
    part = content[start : start + rng.choice((1, 1, 20, BLOCK))]
    changed = rng.choice((rng.randbytes(len(part)), b"", part * 2, bytes(len(part))))
    return content[:start] + changed + content[start + len(part) :]


@dataclass
class Snapshots(SilentView):
    """View that keeps the log of the world and the length of the journal at the end of each skill.

    Attributes:
        runs: Folder of the run directory.
        worlds: Length of the log of a simulated world, or the whole log of a fake one, which is overwritten.
        lengths: Length of the journal [bytes].
    """

    runs: Path
    worlds: list[int | bytes] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)

    def __call__(self, timed: TimedEvent) -> None:
        if isinstance(timed.event, NodeEnded) and timed.event.skill:
            directory = RunDirectory(find_run(LATEST_LINK, self.runs))
            world = directory.world_log
            self.worlds.append(world.stat().st_size if _is_command_log(world) else world.read_bytes())
            self.lengths.append(directory.journal.stat().st_size)


def measure(
    subject: MissionUnderTest,
    runs_folder: Path,
    reports: int = 1000,
    others: int = 200,
    truncations: int = 300,
    kills: int = 100,
    databases: int = 130,
    first_case: int = 0,
) -> Figures:
    """Damage records of a run of MISSION and databases of a comparison, and read, replay and resume them."""
    runs_folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".damaged-", dir=runs_folder) as folder:
        base = Path(folder).resolve()  # The children have another working directory.
        snapshots, problem = ForkRunner(RESUME_TIMEOUT).call(lambda: _record_whole(subject, base / "whole"))
        if snapshots is None:
            raise InputError(f"the run cannot be recorded: {problem}")
        whole = find_run(LATEST_LINK, base / "whole")
        rows = []
        problems = []
        sides = _record_comparison(subject, base / "comparison") if databases else whole
        commands = {
            "report": (["report"], whole, reports), "replay": (["replay"], whole, others),
            "resume": (["run", "--quiet", "--resume"], whole, others),
            "sweep": (["sweep", "--resume"], sides / "b", databases // 2),
            "compare": (["compare", "--resume"], sides, databases - databases // 2),
        }  # fmt: skip
        for name, (words, source, count) in commands.items():
            results = []
            for seed in show_progress(range(first_case, first_case + count), name):
                path = _copy_run(source, base / "copy")
                database = next(path.rglob(FILE_NAME), None)
                damage = (
                    damage_database(Random(seed), database) if database else damage_run(Random(seed), path)
                )
                with TemporaryDirectory() as logs:
                    act = partial(main, [*words, str(path)])
                    results.append(run_in_child(act, base, Path(logs)))
                problems += [f"{name} {seed}, {damage}: {one}" for one in find_problems(words, results[-1])]
                shutil.rmtree(path)
            rows.append({"command": name, **summarize(results)})
        groups = {
            "truncated journal": [
                _resume_truncated(subject, whole, base, snapshots, case)
                for case in show_progress(range(truncations), "cut")
            ],
            "killed": [_resume_killed(subject, base, case) for case in show_progress(range(kills), "killed")],
        }
    for name, done in groups.items():
        problems += [f"{name} {one['case']}: {problem}" for one in done for problem in one["problems"]]
        agreed = sum(one["agrees"] for one in done)
        if agreed < MIN_AGREEMENT * len(done):
            problems.append(f"{name}: ledger and audit agree in {agreed} of {len(done)} runs")
    return {
        **describe(subject),
        "damaged": rows,
        "resumed": [{"record": name, **_count(done)} for name, done in groups.items()],
        "problems": problems,
    }


def _record_whole(subject: MissionUnderTest, runs: Path) -> Snapshots:
    """Run the mission to its end, and return the snapshots of its record."""
    snapshots = Snapshots(runs)
    options = RunOptions(subject.seed, subject.requests, make_cell=subject.make_cell)
    record_run(subject.loaded, options, runs, RecordOptions([snapshots]))
    return snapshots


def _record_comparison(subject: MissionUnderTest, runs: Path) -> Path:
    """Compare the mission with itself, and return the folder of the comparison."""
    mission = str(subject.loaded.path)
    settings = make_settings(mission, range(2), subject.loaded.overrides, {}, None, saves_images=False)
    databases = create_comparison([settings] * 2, runs)
    for database in databases:
        with closing(database):
            run_sweep(database, JobOptions())
    return databases[0].path.parents[1]


def _copy_run(source: Path, target: Path) -> Path:
    """Copy a run directory, its pictures as links, and return the copy."""
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("frames"))
    if (source / "frames").is_dir():
        shutil.copytree(source / "frames", target / "frames", copy_function=os.link)
    return target


def _resume_truncated(
    subject: MissionUnderTest, whole: Path, base: Path, snapshots: Snapshots, case: int
) -> Figures:
    """Cut the journal off before a snapshot of the world, and resume the run."""
    rng = Random(case)
    number = rng.randrange(len(snapshots.lengths))
    path = _copy_run(whole, base / f"cut-{case}")
    (path / "result.json").unlink()
    world = path / "world.log"
    kept = snapshots.worlds[number]
    world.write_bytes(world.read_bytes()[:kept] if isinstance(kept, int) else kept)
    length = rng.randrange(snapshots.lengths[number])
    os.truncate(path / "journal.jsonl", length)
    return _resume(subject, path, f"{case}, journal cut at {length}, world at snapshot {number}")


def _resume_killed(subject: MissionUnderTest, base: Path, case: int) -> Figures:
    """Kill a run, remove the last blocks of its journal and of a log of its world, and resume it."""
    rng = Random(case)
    runs = base / f"killed-{case}"
    duration = 2.0
    while not run_and_kill(subject, subject.seed + case, runs, rng.uniform(0.0, duration)):
        duration *= 0.9
    path = find_run(LATEST_LINK, runs)
    for file in (path / "journal.jsonl", path / "world.log"):
        if file.name == "journal.jsonl" or _is_command_log(file):
            kept = (file.stat().st_size - 1) // BLOCK * BLOCK - BLOCK * rng.randrange(MAX_LOST_BLOCKS)
            # The header of the log of a world is on the disk before the run begins.
            os.truncate(file, max(kept, 0 if file.name == "journal.jsonl" else 40))
    return _resume(subject, path, str(case))


def _is_command_log(file: Path) -> bool:
    """Return True if the log of a world contains commands, and not the state of a fake world."""
    return file.read_bytes().startswith(FILE_HEADER)


def _resume(subject: MissionUnderTest, path: Path, case: str) -> Figures:
    """Resume a run in a child; return whether ledger and audit agree, its status and its problems."""

    def resume() -> Figures:
        options = RunOptions(subject.seed, make_cell=subject.make_cell)
        try:
            result = resume_run(path, subject.loaded.skills, options, RecordOptions(saves_pictures=False))
        except InputError as error:
            reasons = ("was interrupted before its start", "lacks later commands")
            is_expected = any(reason in str(error) for reason in reasons)
            return {"agrees": True, "status": "refused", "problems": [] if is_expected else [str(error)]}
        problems = find_wrong_claims(result)
        after = InputLog(read_journal(path / "journal.jsonl"))
        if difference := replay_and_compare(subject.loaded, after, result.seed).difference:
            problems.append(f"the replay differs: {difference}")
        return {"agrees": not result.disagreement, "status": result.status, "problems": problems}

    figures, problem = ForkRunner(RESUME_TIMEOUT).call(resume)
    return {"case": case, **(figures or {"agrees": False, "status": "none", "problems": [problem]})}


def find_wrong_claims(result: Result) -> list[str]:
    """Return what is wrong with the result of a resumed run.

    Ledger and audit may disagree only if the run is incomplete, names items, and claims no placement that
    the audit did not find.
    """
    ending = f"it ended with {result.status} {result.reason}: {result.message}"
    if result.status == "FAULT":
        return [ending]
    if not result.disagreement or result.audit is None:
        return []
    is_named = result.status == "INCOMPLETE" and "-" in result.message
    if is_named and result.items.placed <= result.audit.right:
        return []
    return [f"{ending}; the ledger says {result.items}, the audit {result.audit}"]


def _count(done: list[Figures]) -> Figures:
    statuses = Counter(one["status"] for one in done)
    return {
        "runs": len(done),
        "agree": sum(one["agrees"] for one in done),
        "problems": sum(bool(one["problems"]) for one in done),
        "statuses": ", ".join(f"{count} x {status}" for status, count in statuses.most_common()),
    }


if __name__ == "__main__":
    run_command(measure)
