"""The database of a sweep: its tables, its transactions, and its errors."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from executive.campaign.results.database import ResultsDatabase, get_database_path
from executive.campaign.results.rows import ItemRow, RunRecord, RunRow, SkillRow, SweepSettings
from executive.campaign.results.tables import ITEMS, RUNS, SKILLS
from executive.errors import InputError
from executive.record.result import Audit, ItemCounts
from executive.record.timeline.timeline import PlanningTotals

SETTINGS = SweepSettings(
    mission="sort.yaml", mission_name="sort", cell="cells/fruit.yaml", overrides={"attempts": "3"},
    variations={"speed": ("1", "2")}, first_seed=0, last_seed=9, scene=None, saves_images=False,
    inputs_hash="abc", versions={"python": "3.11"},
)  # fmt: skip
RUN = RunRow(
    run_index=3, seed=3, variant={"speed": "1"}, status="FAILURE", reason="Grasp.missed",
    message="no “seal”", node="tree/Grasp", items=ItemCounts(seen=2, placed=1, lost=1),
    audit=Audit(agrees=False, right=1), planning=PlanningTotals(4, 2, 0.1), ticks=70, robot_time_s=0.1 + 0.2,
    wall_time_s=1.5, decision_hash="f00", run_directory="runs/x", crashes=1,
)  # fmt: skip
ITEM = ItemRow(
    run_index=3, item="cube-1", label="cube", state="lost", bin="", failed_attempts=2, robot_time_s=1 / 3
)
SKILL = SkillRow(run_index=3, skill="Grasp", activations=3, failed_activations=2, robot_time_s=2 / 3)
RECORD = RunRecord(RUN, (ITEM,), (SKILL,))


def test_all_rows_are_read_as_they_were_stored(tmp_path: Path) -> None:
    path = tmp_path / "results.sqlite"
    plain = RunRow(run_index=0, seed=0, status="SUCCESS", reason="", message="", node="")
    with closing(ResultsDatabase(path, SETTINGS)) as database:
        database.append(RECORD)
        database.append(RunRecord(plain))
    with closing(ResultsDatabase(get_database_path(tmp_path))) as database:
        assert database.settings == SETTINGS
        assert database.read(RUNS) == [plain, RUN]
        assert (database.read(ITEMS), database.read(SKILLS)) == ([ITEM], [SKILL])
    assert [path.name for path in tmp_path.iterdir()] == ["results.sqlite"], "one file contains everything"


def test_the_schema_describes_every_table_and_column(tmp_path: Path) -> None:
    ResultsDatabase(tmp_path / "a", SETTINGS).close()
    with closing(sqlite3.connect(tmp_path / "a")) as connection:
        (schema,) = connection.execute("SELECT sql FROM sqlite_master WHERE name = 'runs'").fetchone()
        names = [row[1] for row in connection.execute("PRAGMA table_info(runs)")]
    assert schema.startswith("CREATE TABLE runs ( -- A run. ")
    assert "  robot_time_s REAL, -- Duration on the run clock (simulated time in simulation" in schema
    assert "  audit_agrees INTEGER, -- Count of objects by ground-truth location, and whether" in schema
    assert {"run_index", "items_placed", "audit_right", "planning_waited_s", "crashes"} <= set(names)


def test_a_run_is_stored_completely_or_not_at_all(tmp_path: Path) -> None:
    with closing(ResultsDatabase(tmp_path / "a", SETTINGS)) as database:
        with pytest.raises(
            InputError, match=r"cannot be read or written: UNIQUE.* skills\.run_index, skills\.skill"
        ):
            database.append(replace(RECORD, skills=(SKILL, SKILL)))
        assert (database.read(RUNS), database.read(ITEMS)) == ([], [])
        database.append(RECORD)
        with pytest.raises(
            InputError, match=r"UNIQUE constraint failed: runs\.run_index; runs that were stored"
        ):
            database.append(RECORD)


def test_a_killed_process_leaves_every_stored_run(tmp_path: Path) -> None:
    script = f"""
import os, signal
from pathlib import Path
from tests.campaign.results.test_database import RECORD, SETTINGS, ResultsDatabase
ResultsDatabase(Path({str(tmp_path / "a")!r}), SETTINGS).append(RECORD)
os.kill(os.getpid(), signal.SIGKILL)
"""
    root = Path(__file__).parents[3]
    ended = subprocess.run([sys.executable, "-c", script], cwd=root, env={**os.environ, "PYTHONPATH": "."})
    assert ended.returncode == -signal.SIGKILL
    with closing(ResultsDatabase(tmp_path / "a")) as database:
        assert database.read(RUNS) == [RUN]


def test_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("no database, but a text of some length" * 9)
    sqlite3.connect(tmp_path / "empty").close()
    (tmp_path / "empty").touch()
    for name, message in [
        ("missing", r'there is no file ".*missing"; name the file results.sqlite of a sweep, or its folder'),
        ("text", r'the results ".*text" cannot be read or written: file is not a database'),
        (
            "empty",
            r'".*empty" is no database of a sweep, or has the schema version 0; this program reads version 1',
        ),
    ]:
        with pytest.raises(InputError, match=message):
            ResultsDatabase(tmp_path / name)


def test_two_processes_do_not_execute_the_same_sweep(tmp_path: Path) -> None:
    with closing(ResultsDatabase(tmp_path / "a", SETTINGS)) as first:
        first.lock()
        with closing(ResultsDatabase(tmp_path / "a")) as second:
            assert second.read(RUNS) == [], "it can be read meanwhile"
            with pytest.raises(InputError, match=r'another process executes the sweep ".*/a"; wait until'):
                second.lock()
    with closing(ResultsDatabase(tmp_path / "a")) as third:
        third.lock()
