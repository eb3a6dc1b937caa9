"""`executive sweep`: its summary, its exit codes and its files, with runs of which only the rows exist."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from at_terminal import invoke
from click.testing import Result

from executive.campaign.jobs import SweepJob
from executive.campaign.results import RunRecord, RunRow, SkillRow
from executive.record.result import Audit, ItemCounts


def make_record(job: SweepJob, status: str = "SUCCESS") -> RunRecord:
    failure = ("Grasp.missed", "no seal", "tree/Grasp")
    reason, message, node = ("", "", "") if status == "SUCCESS" else failure
    status, reason = ("FAULT", "environment") if status == "DISK" else (status, reason)
    run = RunRow(
        run_index=job.index, seed=job.seed, variant=job.variant, status=status, reason=reason,
        message=message, node=node, items=ItemCounts(seen=2, placed=2), audit=Audit(right=2),
        robot_time_s=10.0 + job.seed, wall_time_s=6.0,
        run_directory="" if status == "FAULT" else f"runs/{job.seed}",
    )  # fmt: skip
    counts = {"activations": 2, "failed_activations": 1, "robot_time_s": 0.5}
    return RunRecord(run, (), (SkillRow(run_index=job.index, skill="Grasp", **counts),))


@pytest.fixture
def sweep(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Result]:
    """Function that sweeps; the run of each job has the next of the statuses, and no run follows the last."""

    def sweep_with(statuses: str, *words: str) -> Result:
        def run_jobs(jobs: list[SweepJob], _run: Any, _fail: Any, _options: Any, store: Any) -> None:
            for job, status in zip(jobs, statuses.split(), strict=False):
                store(job.index, make_record(job, status), 0)

        monkeypatch.setattr("executive.campaign.sweep.run_jobs", run_jobs)
        folder = () if "--resume" in words else ("kit_fasteners", "--runs", str(tmp_path / "runs"))
        return invoke("sweep", *folder, *words)

    return sweep_with


@pytest.mark.parametrize(
    ("statuses", "code", "expected"),
    [
        ("SUCCESS FAILURE", 0, "1 of 2 runs succeeded\n"),
        ("SUCCESS", 130, "halted after 1 of 2 runs; 1 of the 1 succeeded\n"),
        ("", 130, "halted after 0 of 2 runs\n"),
    ],
)
def test_a_sweep_succeeds_if_all_runs_were_made(
    sweep: Callable[..., Result], statuses: str, code: int, expected: str
) -> None:
    shown = sweep(statuses, "--seeds", "0:2", "--json")
    assert (shown.exit_code, expected in shown.stderr) == (code, True), shown.stderr
    figures = json.loads(shown.stdout)
    assert (figures["planned_run_count"], figures["is_incomplete"]) == (2, code == 130)
    assert len(figures["runs"]) == len(statuses.split())


def test_the_summary_shows_every_variant_and_how_to_repeat_a_failure(sweep: Callable[..., Result]) -> None:
    words = ("--seeds", "3-4", "--vary", "cell.table.objects=[[1, 1], [2, 2]]")
    text = " ".join(sweep("SUCCESS SUCCESS FAULT SUCCESS", *words).stderr.split())
    for line in (
        "3 of 4 runs succeeded",
        "success rate 100.00% (34.2 to 100.0) 50.00% (9.5 to 90.5)",
        "number in the right bin 4 of 4 4 of 4",
        "Grasp, per run [s] 0.50 (2 of 4 failed) 0.50 (2 of 4 failed)",
        "with cell.table.objects=[2, 2]: 1 run: FAULT Grasp.missed at tree/Grasp: no seal seeds 3; repeat",
        "the first: executive run kit_fasteners --seed 3 --set 'cell.table.objects=[2, 2]'",
    ):
        assert line in text


def test_an_unmet_requirement_is_the_reason_of_exit_code_1(sweep: Callable[..., Result]) -> None:
    words = ("--seeds", "0:2", "--json", "--require", "success >= 0.99 and p95(robot_time_s) < 20")
    shown = sweep("SUCCESS FAILURE", *words)
    (message,) = json.loads(shown.stdout)["unmet_conditions"]
    assert (shown.exit_code, message in shown.stderr) == (1, True)
    assert sweep("SUCCESS SUCCESS", *words).exit_code == 0
    assert sweep("SUCCESS", *words).exit_code == 130, "a halt is more important"


def test_a_run_that_failed_because_of_the_disk_is_repeated(
    sweep: Callable[..., Result], tmp_path: Path
) -> None:
    assert sweep("SUCCESS DISK", "--seeds", "0:2").exit_code == 3
    (folder,) = (tmp_path / "runs").glob("*/*_sweep_kit_fasteners")
    assert sweep("SUCCESS", "--resume", str(folder)).exit_code == 0


def test_a_dry_run_lists_the_files_that_would_travel(sweep: Callable[..., Result], tmp_path: Path) -> None:
    first, *files = sweep("", "--seeds", "0:2", "--dry-run", "--cluster", "tcp://a:1").stderr.splitlines()
    assert first == f"2 runs of kit_fasteners; {len(files)} files travel"
    assert any(file.endswith("cells/kitting.yaml") for file in files) and not (tmp_path / "runs").exists()


def test_nested_values_of_vary_are_refused(sweep: Callable[..., Result]) -> None:
    assert sweep("", "--seeds", "0:2", "--vary", f"attempts={'[' * 5_000}").exit_code == 2


def test_a_resumed_sweep_reports_all_runs(sweep: Callable[..., Result], tmp_path: Path) -> None:
    assert sweep("SUCCESS FAILURE", "--seeds", "0:3").exit_code == 130
    (folder,) = (tmp_path / "runs").glob("*/*_sweep_kit_fasteners")
    shown = sweep("FAULT", "--resume", str(folder), "--junit", str(tmp_path / "junit.xml"))
    assert (shown.exit_code, "1 of 3 runs succeeded" in shown.stderr) == (0, True)
    assert len(list(ElementTree.parse(tmp_path / "junit.xml").iter("testcase"))) == 3
    refused = sweep("", "--resume", str(folder), "--junit", str(folder / "a" / "b"))
    assert (refused.exit_code, "name another file with --junit FILE" in refused.stderr) == (2, True)
