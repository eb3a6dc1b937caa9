"""A mission killed or halted at random moments and resumed, with a changed world or an unchanged one.

Each run takes place in a forked child that gets SIGKILL, or SIGINT as from Ctrl-C, after a random time,
possibly in the middle of a control step or while a journal line or a picture is written. Another child
resumes the run from the disk. This process never builds a cell, because a fork would copy the locks of the
threads of its detector.
"""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from executive.campaign.jobs import MissionUnderTest
from executive.errors import ExecutiveError
from executive.events import ItemChanged, NodeEnded, NodeStarted, TimedEvent
from executive.geometry import Array
from executive.record.journal import find_run_end, read_journal
from executive.record.recorded_run import RecordOptions
from executive.record.replayed_run import replay_and_compare, resume_run
from executive.record.result import Result
from executive.record.run_directory import LATEST_LINK, find_run, read_mission_of_run
from executive.run.assembly import RunOptions
from executive.run.replay import InputLog
from executive.testing.oracle import WorldAccess
from tests.benchmarks.forks import ForkRunner
from tests.benchmarks.report import Figures, describe, record_subject, run_command, show_progress
from tests.meanwhile import meanwhile

RESUME_TIMEOUT = 300.0
"""Time that a child may take to resume a run [s]."""
SHIFTS = 0.06 * np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
"""Candidate displacements of a moved object; one that leads to a free position is chosen at random [m]."""
CHANGES = ("moved", "removed", "dropped")
"""Changes of the world: an object on the table is moved or taken away, or the tool lets go."""


def measure(
    subject: MissionUnderTest, runs_folder: Path, kills: int = 20, changed: int | None = None, halted: int = 0
) -> Figures:
    """Kill MISSION at random moments and resume it each time; runs with a problem stay in `runs/kills`.

    The first `halted` runs are halted instead of killed.
    """
    random, runs = np.random.default_rng(subject.seed), runs_folder / "kills"
    changed = kills // 4 if changed is None else changed
    began = time.monotonic()
    os.waitpid(begin_run(subject, subject.seed, runs / "whole"), 0)
    duration = time.monotonic() - began
    done: list[Figures] = []
    for number in show_progress(range(kills), "killed"):
        is_changed = number * changed // kills < (number + 1) * changed // kills
        change = str(random.choice(CHANGES)) if is_changed else ""
        folder = runs / str(number)
        cause, seed = signal.SIGINT if number < halted else signal.SIGKILL, subject.seed + number
        while not run_and_kill(subject, seed, folder, float(random.uniform(0.0, duration)), cause):
            pass
        done.append(resume_killed_run(subject, subject.seed + number, folder, change))
        if not done[-1]["problems"]:
            shutil.rmtree(folder)
    return {
        **describe(subject),
        "kills": len(done),
        "changed": sum(bool(kill["change"]) for kill in done),
        "failed": sum(bool(kill["problems"]) for kill in done),
        "interrupted": [skill for kill in done for skill in kill["running"] or ("no skill",)],
        "ended": [kill["status"] for kill in done],
        "problems": [
            f"{kill['run']}, killed at {kill['clock_s']:.2f} s, {kill['change'] or 'unchanged'}: {problem}"
            for kill in done
            for problem in kill["problems"]
        ],
    }


def begin_run(subject: MissionUnderTest, seed: int, runs: Path) -> int:
    """Begin a recorded run in a child and return its process id."""
    child = os.fork()
    if child == 0:
        try:
            record_subject(subject, seed, runs)
        finally:
            os._exit(0)
    return child


def run_and_kill(
    subject: MissionUnderTest, seed: int, runs: Path, delay: float, cause: int = signal.SIGKILL
) -> bool:
    """Begin a run, send it the signal `cause` after `delay` [s]; return True if the run can be resumed."""
    child = begin_run(subject, seed, runs)
    time.sleep(delay)
    os.kill(child, cause)
    os.waitpid(child, 0)
    try:
        entries = list(read_journal(find_run(LATEST_LINK, runs) / "journal.jsonl"))
    except ExecutiveError:
        return False
    end = find_run_end(entries)
    return InputLog(entries).start_event is not None and (end is None or end.status == "HALTED")


def resume_killed_run(subject: MissionUnderTest, seed: int, runs: Path, change: str) -> Figures:
    """Change the world if asked to, resume a killed run, and return its figures and problems."""
    path = find_run(LATEST_LINK, runs)
    past = InputLog(read_journal(path / "journal.jsonl"))
    nodes = (timed.event for timed in past.events if isinstance(timed.event, NodeStarted | NodeEnded))
    last = {event.node: event for event in nodes if event.skill}
    kill: Figures = {
        "run": str(path),
        "clock_s": max(timed.clock for timed in past.events),
        "running": [event.skill for event in last.values() if isinstance(event, NodeStarted)],
        "change": change,
        "status": "none",
    }

    def resume() -> Figures:
        done = change_world(subject, seed, path, past, change) if change else ""
        options = RunOptions(seed, make_cell=subject.make_cell)
        result = resume_run(path, subject.loaded.skills, options, RecordOptions(saves_pictures=False))
        after = InputLog(read_journal(path / "journal.jsonl"))
        problems = [*check_result(result, change_made=done), *find_handled_twice(after.events)]
        difference = replay_and_compare(subject.loaded, after, seed).difference
        if difference:
            problems.append(f"the replay differs: {difference}")
        ending = f"{result.status} {result.reason}".strip()
        return {**kill, "change": done, "status": ending, "problems": problems}

    figures, problem = ForkRunner(RESUME_TIMEOUT).call(resume)
    return figures or {**kill, "problems": [problem]}


def change_world(subject: MissionUnderTest, seed: int, path: Path, past: InputLog, change: str) -> str:
    """Change the world of a killed run; return what was changed, or "" if nothing could be."""
    random = np.random.default_rng(seed)
    config = subject.loaded.cell_config
    distance = 2 * max(kind.radius for kind in config.objects.values())
    bounds = np.array([config.table.x, config.table.y]).T
    done: list[str] = []

    def act(world: WorldAccess) -> None:
        held = world.held_object
        others = [thing for thing in world.objects if held is None or thing.body != held.body]
        on_table = [thing for thing in others if is_within(thing.position[:2], bounds)]
        if change == "dropped" and held is not None:
            world.release(held)
            done.append(f"dropped {held.label}")
        elif on_table:
            thing = on_table[int(random.integers(len(on_table)))]
            places = [other.position[:2] for other in others if other.body != thing.body]
            shifts = [
                shift
                for shift in SHIFTS
                if is_within(place := thing.position[:2] + shift, bounds)
                and all(np.linalg.norm(other - place) > distance for other in places)
            ]
            if change == "removed" or not shifts:
                world.remove(thing)
                done.append(f"removed {thing.label}")
            else:
                world.move(thing, tuple(random.choice(shifts)))
                done.append(f"moved {thing.label}")

    assert past.start_event is not None
    loaded = read_mission_of_run(path, past.start_event, subject.loaded.skills)
    meanwhile(path / "world.log", loaded, seed, act, subject.make_cell)
    return "".join(done)


def is_within(position: Array, bounds: Array) -> bool:
    """Return True if a position `(2,)` [m] is within the lowest and the highest corner in `bounds`."""
    return bool(np.all((position >= bounds[0]) & (position <= bounds[1])))


def check_result(result: Result, *, change_made: str) -> list[str]:
    """Return what is wrong with the end of a resumed run; only a removed or dropped object may be lost."""
    problems = []
    if result.disagreement:
        problems.append(f"the ledger says {result.items}; the audit {result.audit}")
    may_lose = change_made.startswith(("removed", "dropped"))
    if result.status != "SUCCESS" and not (may_lose and result.reason == "lost"):
        problems.append(f"it ended with {result.status} {result.reason}: {result.message}")
    if result.held_item:
        problems.append(f"the tool holds {result.held_item} at the end")
    return problems


def find_handled_twice(events: Sequence[TimedEvent]) -> list[str]:
    """Return a sentence for every item that was handled again after it had been placed."""
    problems, last = [], dict[str, str]()
    for timed in events:
        if isinstance(change := timed.event, ItemChanged):
            if last.get(change.item) == "placed" != change.state:
                problems.append(f"{change.item} was {change.state} after it had been placed")
            last[change.item] = change.state
    return problems


if __name__ == "__main__":
    run_command(measure)
