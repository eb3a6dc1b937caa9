"""Runs in scenes outside of what the cell files declare: wrong bins, and wrong bins without a report.

In the runs of the group `misnaming server`, the second of two detectors calls every duck a cube.
"""

from __future__ import annotations

import re
import statistics
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path

import yaml

from executive.behaviours import load_skills
from executive.cell.config import CellConfig, DetectorConfig
from executive.cell.frame import Detection, Frame
from executive.drivers.sim.scene import load_scene
from executive.mission.load import load_mission
from executive.perception.detectors.detector_registry import (
    DetectorContext,
    DetectorKind,
    make_installed_kind,
)
from executive.processes import WorkerPool
from tests.benchmarks.ground_truth import FAULT, HUNG, WALL_TIME_LIMIT, AuditedRun, run_audited
from tests.benchmarks.report import Figures, run_command, show_progress, write_json

SCENES = yaml.safe_load(Path(__file__).with_name("scenes.yaml").read_text())
"""Content of `scenes.yaml`."""
OVERHEAD = "sort_overhead"
MISSIONS = (OVERHEAD, "sort_wrist")
"""The missions of the campaign."""
DECLARED = "declared"
"""Group of the runs without a scene, with which the others are compared."""
MISNAMING = "misnaming server"
"""Group of the runs with a detector that calls ducks cubes."""
SEEDS_PER_CASE = 20
"""Distance between the first seeds of two cases, and the largest number of runs of a case."""


@dataclass(frozen=True)
class Case:
    """A mission in a scene.

    Attributes:
        group: Kind of change.
        name: Name of the scene.
        mission: Shipped name of the mission.
        scene: Content of the scene file; empty: the cell as it is declared.
        number: Position among all cases, from which its seeds follow.
    """

    group: str
    name: str
    mission: str
    scene: Mapping[str, object]
    number: int


def list_cases() -> list[Case]:
    """Return all cases: for each mission that without a scene, then those of every group."""
    cases = [Case(DECLARED, "as declared", mission, {}, number) for number, mission in enumerate(MISSIONS)]
    for key, mission in (("both_missions", OVERHEAD), ("overhead", OVERHEAD), ("both_missions", MISSIONS[1])):
        for group, scenes in SCENES[key].items():
            for name, scene in scenes.items():
                cases.append(Case(group, name, mission, scene, len(cases)))
    return [*cases, Case(MISNAMING, "ducks are cubes", "two_detectors", {}, len(cases))]


@dataclass(frozen=True)
class MisnamingDetector:
    """Finds what another detector finds, but calls ducks cubes; a kind of detector."""

    other: DetectorKind

    def detect(self, frame: Frame, view: str) -> list[Detection]:
        """Return the detections of the other detector, in which ducks are cubes."""
        found = self.other.detect(frame, view)
        return [replace(one, label="cube") if one.label == "duck" else one for one in found]


def make_misnaming(config: DetectorConfig, context: DetectorContext) -> DetectorKind:
    """Return the detector of a section of a cell file; the one called `second` misnames ducks."""
    made = make_installed_kind(config, context)
    return MisnamingDetector(made) if context.name == "second" else made


@dataclass(frozen=True)
class Done:
    """A run of a case."""

    case: Case
    run: AuditedRun

    @property
    def time_per_object(self) -> float | None:
        """Robot time per object of the cell's classes [s]; None without a result or without an object."""
        return self.run.robot_time / len(self.run.known) if self.run.known else None


def measure(
    runs_folder: Path,
    out: Path = Path("outside_the_envelope.json"),
    only: str = "",
    runs_per_scene: int = 4,
    declared_runs: int = 10,
    first_seed: int = 300000,
    wall_time_limit: float = WALL_TIME_LIMIT,
    workers: int = 2,
) -> Figures:
    """Run missions in scenes outside of what the cell files declare, with unchanged cell files.

    `--only` is a regular expression that `MISSION: GROUP: SCENE` contains. A problem is an object in a wrong
    bin that the executive does not report: the status is SUCCESS, or no item that stands for the object is
    rejected, lost or placed with a doubt.
    """
    done = []
    with tempfile.TemporaryDirectory() as folder, WorkerPool(workers) as pool:
        jobs = []
        for case in list_cases():
            if case.group == DECLARED or re.search(only, f"{case.mission}: {case.group}: {case.name}"):
                scene = write_scene(case, Path(folder))
                first = first_seed + SEEDS_PER_CASE * case.number
                make_detector = make_misnaming if case.group == MISNAMING else make_installed_kind
                run = partial(run_audited, make_detector=make_detector, wall_time_limit=wall_time_limit)
                count = declared_runs if case.group == DECLARED else runs_per_scene
                for seed in range(first, first + min(count, SEEDS_PER_CASE)):
                    jobs.append((case, pool.submit(run, case.mission, seed, runs_folder, scene)))
        for case, job in show_progress(jobs, "outside the envelope"):
            done.append(Done(case, job.result()))
    figures = {"runs": len(done), "first_seed": first_seed, **summarize(done)}
    write_json(out, {**figures, "all_runs": [asdict(one) for one in done]})
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
    return load_mission(mission, load_skills()).cell_config


def summarize(done: Sequence[Done]) -> Figures:
    """Return a row per group and in total, the objects in wrong bins, and the problems."""
    declared = [one for one in done if one.case.group == DECLARED]
    outside = [one for one in done if one.case.group not in (DECLARED, MISNAMING)]
    usual_times = {
        mission: _median([one.time_per_object for one in declared if one.run.mission == mission])
        for mission in MISSIONS
    }
    groups = {
        group: [one for one in done if one.case.group == group]
        for group in (DECLARED, *SCENES["both_missions"], MISNAMING)
    }
    groups["total outside"] = outside
    broken = [
        f"{one.case.name}, {one.run.mission}, seed {one.run.seed}: {one.run.status} {one.run.message}"
        for one in done
        if one.run.status in (FAULT, HUNG)
    ]
    return {
        "groups": [_make_row(group, runs, usual_times) for group, runs in groups.items() if runs],
        "wrong bins": [_describe(one) for one in done if one.run.in_wrong_bin],
        # A campaign whose runs broke has shown nothing.
        "problems": [*(f"not reported: {_describe(one)}" for one in done if one.run.unreported), *broken],
    }


def _make_row(group: str, done: Sequence[Done], usual_times: Mapping[str, float | None]) -> Figures:
    """Return the figures of a group; `usual_times` is the median robot time per object by mission [s]."""
    runs = [one.run for one in done]
    object_count = sum(len(run.known) for run in runs)
    ratios = [
        one.time_per_object / usual_time
        for one in done
        if one.time_per_object is not None and (usual_time := usual_times.get(one.run.mission))
    ]
    statuses = ("SUCCESS", "INCOMPLETE", "FAILURE", FAULT, HUNG)
    return {
        "group": group,
        "runs": len(runs),
        "objects": object_count,
        "right %": 100 * sum(run.right for run in runs) / max(object_count, 1),
        "wrong bin": sum(len(run.in_wrong_bin) for run in runs),
        "unreported": sum(len(run.unreported) for run in runs),
        **{status: sum(run.status == status for run in runs) for status in statuses},
        "s per object": _median([one.time_per_object for one in done]),
        "times declared": _median(ratios),
    }


def _describe(one: Done) -> str:
    """Return a sentence about the objects in wrong bins of a run."""
    objects = []
    for thing in one.run.in_wrong_bin:
        reports = ", ".join(f"{report.state} {report.reason}".strip() for report in thing.reports)
        objects.append(f"{thing.label} in {thing.bin} as {', '.join(thing.items) or 'no item'} ({reports})")
    run = one.run
    return f"{one.case.name}, {run.mission}, seed {run.seed}, {run.status}: {'; '.join(objects)}; {run.run}"


def _median(values: Sequence[float | None]) -> float | None:
    """Return the median of the values that are not None; None if there is none."""
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None


if __name__ == "__main__":
    run_command(measure)
