"""Runs with two detectors, one of which calls every object of a class by the name of another class."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import click

from executive.campaign.pool import JobOptions, run_jobs
from executive.cell.config import CellConfig
from executive.cell.detection import Answer
from executive.cell.frame import Frame
from executive.cell.protocols import Clock, Request
from executive.cli.options import runs_option, workers_option
from executive.cli.progress import print_halt, show_progress
from executive.perception.detectors.requests import ClosableDetector
from executive.perception.envelope import build_rated_detectors
from tests.benchmarks.ground_truth import FAULT, AuditedRun, FoundObject, run_audited
from tests.benchmarks.report import Figures, limit_option, run_command, write_json

MISSION = "two_detectors"
"""Mission that fuses the looks of two detectors."""
SERVER = "second"
"""Name in its cell of the detector that stands for the server."""
STATES = ("rejected", "lost")
"""States of items that are counted apart for the objects that are in no bin."""


@dataclass(frozen=True, eq=False)
class MisclassifyingDetector:
    """Answers as another detector, with one class renamed to another; implements `Detector`.

    Attributes:
        other: The other detector.
        true_class: Class whose objects it misnames.
        given_class: Class that it names instead.
    """

    other: ClosableDetector
    true_class: str
    given_class: str

    def request(self, frame: Frame, view: str) -> MisclassifyingRequest:
        """Ask the other detector about `frame`."""
        return MisclassifyingRequest(self.other.request(frame, view), self.true_class, self.given_class)

    def close(self) -> None:
        """Close the other detector."""
        self.other.close()


@dataclass(frozen=True, eq=False)
class MisclassifyingRequest:
    """A request to the other detector; implements `executive.cell.protocols.Request`."""

    other: Request
    true_class: str
    given_class: str

    @property
    def ready(self) -> bool:
        """True once the other detector's answer is due."""
        return self.other.ready

    def result(self) -> Answer:
        """Return the answer with its classes renamed.

        Raises:
            Unavailable: The other detector gave no usable answer.
        """
        answer = self.other.result()
        found = tuple(
            replace(one, label=self.given_class) if one.label == self.true_class else one
            for one in answer.confident
        )
        return replace(answer, confident=found)


@dataclass(frozen=True)
class Server:
    """The detector that misnames objects: its name in the cell, their true class, and the class it names."""

    name: str
    true_class: str
    given_class: str


def build_with_misclassifying(
    config: CellConfig,
    *,
    clock: Clock,
    base: Path,
    seed: int,
    folders: Sequence[Path],
    server: Server,
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell file, one of which misnames objects."""
    built = build_rated_detectors(config, clock=clock, base=base, seed=seed, folders=folders)
    misnaming = MisclassifyingDetector(built[server.name], server.true_class, server.given_class)
    return {**built, server.name: misnaming}


@dataclass(frozen=True)
class Job:
    """A run to do: mission, seed, misclassifying detector, folder of the record, wall time limit [s]."""

    mission: str
    seed: int
    server: Server
    runs: Path
    wall_time_limit: float


def measure(
    mission: str,
    server: str,
    true_class: str,
    given_class: str,
    seeds: int,
    first_seed: int,
    wall_time_limit: float,
    workers: int,
    runs_folder: Path,
    out: Path,
) -> Figures:
    """Sort with two detectors, one of which gives every object of a class the name of another class.

    A problem is an object in a wrong bin, or an object of another class that is not in its bin.
    """
    misnaming = Server(server, true_class, given_class)
    jobs = [
        Job(mission, seed, misnaming, runs_folder, wall_time_limit)
        for seed in range(first_seed, first_seed + seeds)
    ]
    with show_progress("misclassifying server") as progress:
        results = run_jobs(jobs, run_job, _describe_broken, JobOptions(workers, progress, print_halt))
    done = [run for run in results if run is not None and run.status != "HALTED"]
    figures = {
        "mission": mission,
        "first_seed": first_seed,
        "asked": len(jobs),
        "misnamed": f"{true_class} as {given_class}",
    }
    figures |= summarize(done, true_class)
    write_json(out, {**figures, "all_runs": [asdict(run) for run in done]})
    return figures


def run_job(job: Job) -> AuditedRun:
    """Do one run."""
    detectors = partial(build_with_misclassifying, server=job.server)
    return run_audited(
        job.mission, job.seed, job.runs, detectors=detectors, wall_time_limit=job.wall_time_limit
    )


def _describe_broken(job: Job, error: BaseException) -> AuditedRun:
    """Return the result of a job whose process ended."""
    message = f"{type(error).__name__}: {error}"
    return AuditedRun.without_result(job.mission, job.seed, FAULT, message)


def summarize(runs: Sequence[AuditedRun], true_class: str) -> Figures:
    """Return a row per class, a row for the times, and the problems."""
    objects = [(run, one) for run in runs for one in run.objects]
    labels = sorted({one.label for _, one in objects})
    times = [run.robot_time_s for run in runs if run.objects]
    return {
        "runs": len(runs),
        "status": {run.status: sum(other.status == run.status for other in runs) for run in runs},
        "robot_time_median_s": statistics.median(times) if times else None,
        "robot_time_most_s": max(times, default=None),
        "wall_time_median_s": statistics.median(run.wall_time_s for run in runs) if runs else None,
        "cpu_time_median_s": statistics.median(run.cpu_time_s for run in runs) if runs else None,
        "classes": [_row(label, [one for _, one in objects if one.label == label]) for label in labels],
        "problems": [
            *(
                f"seed {run.seed}: {one.label} in {one.bin}, {run.run}"
                for run, one in objects
                if one.is_in_wrong_bin
            ),
            *(
                f"seed {run.seed}: {one.label} is {one.place}, its items are {_reports(one)}, {run.run}"
                for run, one in objects
                if one.label != true_class and one.place != "right" and not one.is_in_wrong_bin
            ),
            *(f"seed {run.seed}: {run.status} {run.message}" for run in runs if not run.objects),
        ],
    }


def _row(label: str, objects: Sequence[FoundObject]) -> Figures:
    """Return the counts of the objects of a class."""
    outside = [one for one in objects if one.place != "right" and not one.is_in_wrong_bin]
    return {
        "class": label,
        "objects": len(objects),
        "placed right": sum(one.place == "right" for one in objects),
        "wrong bin": sum(one.is_in_wrong_bin for one in objects),
        **{
            state: sum(any(report.state == state for report in one.reports) for one in outside)
            for state in STATES
        },
        "not reported": sum(not any(report.state in STATES for report in one.reports) for one in outside),
    }


def _reports(one: FoundObject) -> str:
    """Return the states of the items of an object."""
    return ", ".join(f"{report.state} {report.reason}".strip() for report in one.reports) or "none"


if __name__ == "__main__":
    run_command(
        measure,
        click.option("--mission", default=MISSION, show_default=True, help="Mission to run."),
        click.option("--server", default=SERVER, show_default=True, help="The detector that misnames."),
        click.option("--true-class", default="duck", show_default=True, help="Class that it misnames."),
        click.option("--given-class", default="cube", show_default=True, help="Class that it names instead."),
        click.option(
            "--seeds", type=click.IntRange(min=1), default=20, show_default=True, help="Number of runs."
        ),
        click.option(
            "--first-seed", type=click.IntRange(min=0), default=310000, show_default=True, help="First seed."
        ),
        limit_option,
        workers_option,
        runs_option,
        click.option(
            "--out", type=click.Path(path_type=Path, dir_okay=False), default="misclassifying_server.json",
            show_default=True, help="JSON file of all runs.",
        ),
    )  # fmt: skip
