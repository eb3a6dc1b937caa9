"""Runs with two detectors, one of which calls every object of a class by the name of another class."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from executive.cell.detection import Answer
from executive.cell.frame import Frame
from executive.perception.detectors.requests import ChangedRequest, ClosableDetector
from executive.perception.envelope import build_rated_detectors
from executive.processes import WorkerPool
from tests.benchmarks.ground_truth import WALL_TIME_LIMIT, AuditedRun, FoundObject, run_audited
from tests.benchmarks.report import Figures, run_command, show_progress, write_json

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

    def request(self, frame: Frame, view: str) -> ChangedRequest:
        """Ask the other detector about `frame`."""
        return ChangedRequest(self.other.request(frame, view), self._rename)

    def close(self) -> None:
        """Close the other detector."""
        self.other.close()

    def _rename(self, answer: Answer) -> Answer:
        found = tuple(
            replace(one, label=self.given_class) if one.label == self.true_class else one
            for one in answer.confident
        )
        return replace(answer, confident=found)


def build_with_misclassifying(
    *arguments: Any, server: str, true_class: str, given_class: str, **options: Any
) -> dict[str, ClosableDetector]:
    """Return the detectors of a cell file, of which `server` misnames objects."""
    built = build_rated_detectors(*arguments, **options)
    return {**built, server: MisclassifyingDetector(built[server], true_class, given_class)}


def measure(
    runs_folder: Path,
    out: Path = Path("misclassifying_server.json"),
    mission: str = "two_detectors",
    server: str = "second",
    true_class: str = "duck",
    given_class: str = "cube",
    seeds: int = 20,
    first_seed: int = 310000,
    wall_time_limit: float = WALL_TIME_LIMIT,
    workers: int = 2,
) -> Figures:
    """Sort with two detectors, one of which gives every object of a class the name of another class.

    A problem is an object in a wrong bin, or an object of another class that is not in its bin.
    """
    detectors = partial(
        build_with_misclassifying, server=server, true_class=true_class, given_class=given_class
    )
    run = partial(
        run_audited, mission, runs=runs_folder, detectors=detectors, wall_time_limit=wall_time_limit
    )
    with WorkerPool(workers) as pool:
        jobs = [pool.submit(run, seed) for seed in range(first_seed, first_seed + seeds)]
        runs = [job.result() for job in show_progress(jobs, "misclassifying server")]
    figures = {"mission": mission, "first_seed": first_seed, "misnamed": f"{true_class} as {given_class}"}
    figures |= summarize(runs, true_class)
    write_json(out, {**figures, "all_runs": [asdict(run) for run in runs]})
    return figures


def summarize(runs: Sequence[AuditedRun], true_class: str) -> Figures:
    """Return the statuses, a row per class, and the problems."""
    objects = [(run, one) for run in runs for one in run.objects]
    labels = sorted({one.label for _, one in objects})
    problems = [f"seed {run.seed}: {run.status} {run.message}" for run in runs if not run.objects]
    for run, one in objects:
        if one.is_in_wrong_bin or (one.label != true_class and one.place != "right"):
            states = ", ".join(f"{report.state} {report.reason}".strip() for report in one.reports)
            problems.append(f"seed {run.seed}: {one.label}: {one.place} {one.bin} ({states}), {run.run}")
    return {
        "runs": len(runs),
        "status": Counter(run.status for run in runs),
        "classes": [_make_row(label, [one for _, one in objects if one.label == label]) for label in labels],
        "problems": problems,
    }


def _make_row(label: str, objects: Sequence[FoundObject]) -> Figures:
    """Return the counts of the objects of a class."""
    outside = [one for one in objects if one.place != "right" and not one.is_in_wrong_bin]
    states = [{report.state for report in one.reports} for one in outside]
    return {
        "class": label,
        "objects": len(objects),
        "placed right": sum(one.place == "right" for one in objects),
        "wrong bin": sum(one.is_in_wrong_bin for one in objects),
        **{state: sum(state in found for found in states) for state in STATES},
        "not reported": sum(found.isdisjoint(STATES) for found in states),
    }


if __name__ == "__main__":
    run_command(measure)
