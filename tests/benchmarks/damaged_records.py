"""Damaged records of a run: each is read, replayed, resumed and shown in a video, or refused with a message.

One run of a mission is recorded; all damaged records are copies of it. A copy is damaged at random; or its
journal is cut off, while the world went on; or the run is killed, and the last blocks of its logs are
removed. Each command runs in a forked child.
"""

from __future__ import annotations

import random
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from executive.campaign.mission_under_test import MissionUnderTest
from executive.cells.sim.command_log import is_command_log
from executive.cli.options import runs_option
from executive.errors import ExecutiveError, InputError
from executive.events import NodeEnded, RunResumed, TimedEvent
from executive.record.journal import read_journal
from executive.record.recorded_run import RecordOptions, record_run
from executive.record.replayed_run import replay_and_compare, replay_run
from executive.record.result import Result
from executive.record.resume import resume_run
from executive.record.run_directory import LATEST_LINK, RunDirectory, find_run
from executive.replay.input_log import InputLog
from executive.run.assembly import RunOptions
from executive.view.report.page import write_report
from executive.view.video import write_video
from tests.benchmarks.damage import BLOCK, copy_run, damage_run
from tests.benchmarks.forks import ForkRunner
from tests.benchmarks.hostile_input import CommandResult, find_problems, run_in_child
from tests.benchmarks.kills import run_and_kill
from tests.benchmarks.report import Figures, describe, run_mission_command, show_progress

RESUME_TIMEOUT = 300.0
"""Time that a child may take to resume a run [s]."""
MIN_AGREEMENT = 0.9
"""Smallest share of resumed runs in which ledger and audit have to agree."""
MAX_LOST_BLOCKS = 2
"""Largest number of blocks that are removed from the end of a log."""


class Reached(BaseException):
    """Ends a command at its first live control step, or at its first picture."""


class StopAtFirstTick:
    """View that ends a resumed run as soon as its cell has taken over."""

    def open(self, run: object) -> None:
        """Do nothing."""

    def __call__(self, timed: TimedEvent) -> None:
        if isinstance(timed.event, RunResumed):
            raise Reached

    def close(self) -> None:
        """Do nothing."""

    def show_message(self, message: str) -> None:
        """Do nothing."""


@dataclass
class Snapshots(StopAtFirstTick):
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
            self.worlds.append(world.stat().st_size if is_command_log(world) else world.read_bytes())
            self.lengths.append(directory.journal.stat().st_size)

    def restore(self, number: int, path: Path) -> None:
        """Make the log of the world in a copy of the run directory what it was at a snapshot."""
        world, kept = path / "world.log", self.worlds[number]
        world.write_bytes(world.read_bytes()[:kept] if isinstance(kept, int) else kept)


def measure(
    subject: MissionUnderTest,
    runs_folder: Path,
    reports: int,
    others: int,
    videos: int,
    truncations: int,
    kills: int,
) -> Figures:
    """Damage records of a run of MISSION, and read, replay, resume and show them in videos."""
    runs_folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".damaged-", dir=runs_folder) as folder:
        base = Path(folder).resolve()  # The children have another working directory.
        snapshots, problem = ForkRunner(RESUME_TIMEOUT).call(lambda: _record_whole(subject, base / "whole"))
        if snapshots is None:
            raise InputError(f"the run cannot be recorded: {problem}")
        whole = find_run(LATEST_LINK, base / "whole")
        commands = {
            "report": (reports, _report),
            "replay": (others, lambda path: _replay(subject, path)),
            "resume": (others, lambda path: _resume_to_first_tick(subject, path)),
            "video": (videos, _write_video),
        }
        rows, problems = [], []
        for name, (number, command) in commands.items():
            results = []
            for seed in show_progress(range(number), name):
                result, damage = _run_on_damaged(command, whole, base, seed)
                results.append(result)
                problems += [f"{name} {seed}, {damage}: {found}" for found in find_problems([name], result)]
            rows.append({"command": name, **_summarize(results)})
        cut = [
            _resume_truncated(subject, whole, base, snapshots, n)
            for n in show_progress(range(truncations), "cut")
        ]
        killed = [_resume_killed(subject, base, n, snapshots) for n in show_progress(range(kills), "killed")]
    groups = {"truncated journal": cut, "killed": killed}
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


def _run_on_damaged(
    command: Callable[[Path], None], whole: Path, base: Path, seed: int
) -> tuple[CommandResult, str]:
    """Run a command on a damaged copy of a run; return its result and the damage."""
    path = copy_run(whole, base / "copy")
    damage = damage_run(seed, path)

    def act() -> None:
        try:
            command(path)
        except ExecutiveError as error:
            raise SystemExit(_tell(error.exit_code, str(error))) from error
        except Reached:
            pass
        except Exception as error:
            raise SystemExit(_tell(3, f"internal error: {type(error).__name__}: {error}")) from error
        raise SystemExit(0)

    with TemporaryDirectory() as logs:
        result = run_in_child(act, base, Path(logs))
    shutil.rmtree(path)
    return result, damage


def _tell(code: int, message: str) -> int:
    """Print a message and return the exit code."""
    print(message, flush=True)
    return code


def _report(path: Path) -> None:
    read_journal(path / "journal.jsonl")
    write_report(path)


def _replay(subject: MissionUnderTest, path: Path) -> None:
    if difference := replay_run(path, read_journal(path / "journal.jsonl"), subject.loaded.skills).difference:
        raise SystemExit(_tell(1, difference))


def _resume_to_first_tick(subject: MissionUnderTest, path: Path) -> None:
    options = RunOptions(subject.seed, make_cell=subject.make_cell)
    resume_run(path, subject.loaded.skills, options, RecordOptions([StopAtFirstTick()], saves_pictures=False))


def _write_video(path: Path) -> None:
    write_video(path, path / "run.gif")


def _resume_truncated(
    subject: MissionUnderTest, whole: Path, base: Path, snapshots: Snapshots, case: int
) -> Figures:
    """Cut the journal off before a snapshot of the world, and resume the run."""
    rng = random.Random(case)
    number = rng.randrange(len(snapshots.lengths))
    path = copy_run(whole, base / f"cut-{case}")
    (path / "result.json").unlink()
    snapshots.restore(number, path)
    length = rng.randrange(snapshots.lengths[number])
    _truncate(path / "journal.jsonl", length)
    return _resume(subject, path, f"{case}, journal cut at {length}, world at snapshot {number}")


def _resume_killed(subject: MissionUnderTest, base: Path, case: int, snapshots: Snapshots) -> Figures:
    """Kill a run, remove the last blocks of its journal and of a log of its world, and resume it."""
    rng, runs = random.Random(case), base / f"killed-{case}"
    duration = 2.0
    while not run_and_kill(subject, subject.seed + case, runs, rng.uniform(0.0, duration)):
        duration *= 0.9
    path = find_run(LATEST_LINK, runs)
    lost = []
    for file in ("journal.jsonl", "world.log"):
        if file == "journal.jsonl" or is_command_log(path / file):
            size = (path / file).stat().st_size
            kept = max(size - 1, 0) // BLOCK * BLOCK - BLOCK * rng.randrange(MAX_LOST_BLOCKS)
            # The header of the log of a world is on the disk before the run begins.
            _truncate(path / file, max(kept, 0 if file == "journal.jsonl" else 40))
            lost.append(f"{file} cut at {kept} of {size}")
    return _resume(subject, path, f"{case}, {', '.join(lost)}")


def _truncate(file: Path, length: int) -> None:
    file.write_bytes(file.read_bytes()[:length])


def _resume(subject: MissionUnderTest, path: Path, case: str) -> Figures:
    """Resume a run in a child; return whether ledger and audit agree, its status and its problems."""

    def resume() -> Figures:
        options = RunOptions(subject.seed, make_cell=subject.make_cell)
        try:
            result = resume_run(path, subject.loaded.skills, options, RecordOptions(saves_pictures=False))
        except InputError as error:
            has_begun = "was interrupted before its start" not in str(error)
            return {"agrees": True, "status": "refused", "problems": [str(error)] if has_begun else []}
        after = InputLog(read_journal(path / "journal.jsonl"))
        problems = find_wrong_claims(result)
        if difference := replay_and_compare(subject.loaded, after, result.seed).difference:
            problems.append(f"the replay differs: {difference}")
        return {
            "agrees": not result.disagreement,
            "status": result.status,
            "problems": problems,
        }

    figures, problem = ForkRunner(RESUME_TIMEOUT).call(resume)
    if not (figures and figures["problems"]) and not problem:
        shutil.rmtree(path)
    return {"case": case, **(figures or {"agrees": False, "status": "none", "problems": [problem]})}


def find_wrong_claims(result: Result) -> list[str]:
    """Return what is wrong with the result of a resumed run.

    Ledger and audit may disagree only if the run is incomplete, names items, and claims no placement that
    the audit did not find.
    """
    ending = f"{result.status} {result.reason}: {result.message}"
    if result.status == "FAULT":
        return [f"it ended with {ending}"]
    if not result.disagreement or result.audit is None:
        return []
    is_named = result.status == "INCOMPLETE" and "-" in result.message
    if is_named and result.items.placed <= result.audit.right:
        return []
    return [f"it ended with {ending}; the ledger says {result.items}, the audit {result.audit}"]


def _summarize(results: list[CommandResult]) -> Figures:
    codes = Counter(result.exit_code for result in results)
    return {
        "records": len(results),
        "exit codes": ", ".join(f"{number} x {code}" for code, number in sorted(codes.items())),
        "max_cpu_time_s": max((result.cpu_time for result in results), default=0.0),
    }


def _count(done: list[Figures]) -> Figures:
    statuses = Counter(one["status"] for one in done)
    return {
        "runs": len(done),
        "agree": sum(one["agrees"] for one in done),
        "problems": sum(bool(one["problems"]) for one in done),
        "statuses": ", ".join(f"{number} x {status}" for status, number in statuses.most_common()),
    }


if __name__ == "__main__":
    number = click.IntRange(min=0)
    run_mission_command(
        measure,
        click.option(
            "--reports", type=number, default=1000, show_default=True, help="Damaged records for `report`."
        ),
        click.option(
            "--others", type=number, default=200, show_default=True, help="Those for `replay` and `--resume`."
        ),
        click.option(
            "--videos", type=number, default=50, show_default=True, help="Those for `replay --video`."
        ),
        click.option(
            "--truncations", type=number, default=300, show_default=True, help="Truncated journals."
        ),
        click.option(
            "--kills", type=number, default=100, show_default=True, help="Killed runs with lost blocks."
        ),
        runs_option,
    )
