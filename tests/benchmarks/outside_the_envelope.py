"""Runs in scenes outside of what the cell files declare: wrong bins, and wrong bins without a report."""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import click
import yaml

from executive.campaign.pool import JobOptions, run_jobs
from executive.cell.config import CellConfig
from executive.cells.sim.scene_file import load_scene
from executive.cli.options import runs_option, workers_option
from executive.cli.progress import print_halt, show_progress
from executive.mission.load import load_mission
from executive.plugins import load_skills
from tests.benchmarks.ground_truth import FAULT, HUNG, AuditedRun, run_audited
from tests.benchmarks.report import Figures, limit_option, run_command, write_json
from tests.benchmarks.scenes_outside import DECLARED, GROUPS, MISSIONS, Case, list_cases

SEEDS_PER_CASE = 20
"""Distance between the first seeds of two cases, and the largest number of runs of a case."""
HALTED = "HALTED"
"""Status of a run that somebody halted; it is not counted."""
NAMES = tuple(dict.fromkeys(case.name for case in list_cases() if case.group != DECLARED))
"""Names of all scenes."""


@dataclass(frozen=True)
class Job:
    """A run to do.

    Attributes:
        case: Mission and scene.
        seed: Seed of the run.
        scene: Scene file; None: as declared.
        runs: Folder of the run directories.
        wall_time_limit: Wall time after which it is killed [s].
    """

    case: Case
    seed: int
    scene: Path | None
    runs: Path
    wall_time_limit: float


@dataclass(frozen=True)
class Done:
    """A run of a case."""

    case: Case
    run: AuditedRun

    @property
    def time_per_object(self) -> float | None:
        """Robot time per object of the cell's classes [s]; None without a result or without an object."""
        return self.run.robot_time_s / len(self.run.known) if self.run.known else None


def measure(
    groups: tuple[str, ...],
    scenes: tuple[str, ...],
    missions: tuple[str, ...],
    runs_per_scene: int,
    declared_runs: int,
    first_seed: int,
    wall_time_limit: float,
    workers: int,
    runs_folder: Path,
    out: Path,
) -> Figures:
    """Run missions in scenes outside of what the cell files declare, with unchanged cell files.

    A problem is an object in a wrong bin that the executive does not report: the status is SUCCESS, or no
    item that stands for the object is rejected, lost or placed with a doubt.
    """
    cases = [
        case
        for case in list_cases()
        if case.mission in (missions or MISSIONS)
        and (case.group == DECLARED or (case.group in (groups or GROUPS) and case.name in (scenes or NAMES)))
    ]
    with tempfile.TemporaryDirectory() as folder:
        jobs = []
        for case in cases:
            scene = write_scene(case, Path(folder))
            first = first_seed + SEEDS_PER_CASE * case.number
            count = declared_runs if case.group == DECLARED else runs_per_scene
            jobs += [
                Job(case, seed, scene, runs_folder, wall_time_limit) for seed in range(first, first + count)
            ]
        with show_progress("outside the envelope") as progress:
            results = run_jobs(jobs, run_job, _describe_broken, JobOptions(workers, progress, print_halt))
    done = [result for result in results if result is not None and result.run.status != HALTED]
    figures = {"asked": len(jobs), "runs": len(done), "first_seed": first_seed, **summarize(done)}
    listed = [{**asdict(one), **_derived(one)} for one in done]
    scenes_by_name = {case.name: case.scene for case in cases}
    write_json(out, {**figures, "scenes": scenes_by_name, "all_runs": listed})
    return figures


def write_scene(case: Case, folder: Path) -> Path | None:
    """Write and check the scene file of a case; return it, or None if nothing is changed.

    Raises:
        MissionError: The scene does not fit the cell.
    """
    if not case.scene:
        return None
    path = folder / f"{case.number:03d}.yaml"
    path.write_text(yaml.safe_dump({"scene": case.name, **case.scene}), encoding="utf-8")
    load_scene(path, _load_cell_of(case.mission))
    return path


@cache
def _load_cell_of(mission: str) -> CellConfig:
    """Return the cell file of a mission."""
    return load_mission(mission, load_skills()).cell_config


def run_job(job: Job) -> Done:
    """Do one run."""
    run = run_audited(job.case.mission, job.seed, job.runs, job.scene, wall_time_limit=job.wall_time_limit)
    return Done(job.case, run)


def _describe_broken(job: Job, error: BaseException) -> Done:
    """Return the result of a job whose process ended."""
    message = f"{type(error).__name__}: {error}"
    return Done(job.case, AuditedRun.without_result(job.case.mission, job.seed, FAULT, message))


def summarize(done: Sequence[Done]) -> Figures:
    """Return a row per group and in total, the objects in wrong bins, and the problems."""
    usual = {
        mission: _median(
            [one.time_per_object for one in done if (one.case.group, one.run.mission) == (DECLARED, mission)]
        )
        for mission in MISSIONS
    }
    present = [group for group in (DECLARED, *GROUPS) if any(one.case.group == group for one in done)]
    rows = [_row(group, [one for one in done if one.case.group == group], usual) for group in present]
    outside = [one for one in done if one.case.group != DECLARED]
    unreported = [one for one in done if one.run.unreported]
    broken = [
        f"{one.case.name}, {one.run.mission}, seed {one.run.seed}: {one.run.status} {one.run.message}"
        for one in done
        if one.run.status in (FAULT, HUNG)
    ]
    return {
        "groups": [*rows, _row("total outside", outside, usual)],
        "wrong bins": [_describe(one) for one in done if one.run.in_wrong_bin],
        "broken": broken,
        # A campaign whose runs broke has shown nothing.
        "problems": [*(f"not reported: {_describe(one)}" for one in unreported), *broken],
    }


def _row(group: str, done: Sequence[Done], usual: dict[str, float | None]) -> Figures:
    """Return the figures of a group; `usual` is the median robot time per object by mission [s]."""
    runs = [one.run for one in done]
    objects = sum(len(run.known) for run in runs)
    ratios = []
    for one in done:
        time, declared = one.time_per_object, usual[one.run.mission]
        ratios.append(time / declared if time is not None and declared else None)
    shares = {
        f"{status} %": 100 * sum(run.status == status for run in runs) / max(len(runs), 1)
        for status in ("SUCCESS", "INCOMPLETE", "FAILURE")
    }
    return {
        "group": group,
        "runs": len(runs),
        "objects": objects,
        "right %": 100 * sum(run.right for run in runs) / max(objects, 1),
        "wrong bin": sum(len(run.in_wrong_bin) for run in runs),
        "unreported": sum(len(run.unreported) for run in runs),
        **shares,
        "FAULT": sum(run.status == FAULT for run in runs),
        "HUNG": sum(run.status == HUNG for run in runs),
        "s per object": _median([one.time_per_object for one in done]),
        "times declared": _median(ratios),
        "cpu s": _median([run.cpu_time_s for run in runs]),
    }


def _derived(one: Done) -> Figures:
    """Return the counts of a run that follow from its objects."""
    run = one.run
    return {
        "known_objects": len(run.known),
        "right": run.right,
        "in_wrong_bin": len(run.in_wrong_bin),
        "unreported": len(run.unreported),
        "time_per_object_s": one.time_per_object,
    }


def _describe(one: Done) -> str:
    """Return a sentence about the objects in wrong bins of a run."""
    objects = "; ".join(
        f"{thing.label} {'fell' if thing.fell_in_wrong_bin else 'put'} into {thing.bin} as "
        f"{', '.join(thing.items) or 'no item'}"
        + "".join(f" ({report.state}{report.reason and ': ' + report.reason})" for report in thing.reports)
        for thing in one.run.in_wrong_bin
    )
    run = one.run
    return f"{one.case.name}, {run.mission}, seed {run.seed}, {run.status}: {objects}; {run.run}"


def _median(values: Sequence[float | None]) -> float | None:
    """Return the median of the finite values; None if there is none."""
    finite = [value for value in values if value is not None and math.isfinite(value)]
    return statistics.median(finite) if finite else None


if __name__ == "__main__":
    run_command(
        measure,
        click.option(
            "--group", "groups", type=click.Choice(GROUPS), multiple=True,
            help="Group of scenes; repeatable; without it, all.",
        ),
        click.option(
            "--scene",
            "scenes",
            type=click.Choice(NAMES),
            metavar="NAME",
            multiple=True,
            help="Scene by its name; repeatable; without it, all of the groups.",
        ),
        click.option(
            "--mission", "missions", type=click.Choice(MISSIONS), multiple=True,
            help="Mission; repeatable; without it, both.",
        ),
        click.option(
            "--runs-per-scene", type=click.IntRange(0, SEEDS_PER_CASE), default=4, show_default=True,
            help="Number of runs of each scene; 4 make 300 runs.",
        ),
        click.option(
            "--declared-runs", type=click.IntRange(0, SEEDS_PER_CASE), default=10, show_default=True,
            help="Number of runs of each mission without a scene.",
        ),
        click.option(
            "--first-seed", type=click.IntRange(min=0), default=300000, show_default=True,
            help="Seed of the first run; each scene has seeds of its own.",
        ),
        limit_option,
        workers_option,
        runs_option,
        click.option(
            "--out", type=click.Path(path_type=Path, dir_okay=False), default="outside_the_envelope.json",
            show_default=True, help="JSON file of all runs.",
        ),
    )  # fmt: skip
