"""`executive sweep`: its summary, its exit codes and its files, with runs of which only the rows exist."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner, Result

from executive.campaign.results.database import ResultsDatabase
from executive.campaign.results.rows import RunRecord, RunRow, SkillRow
from executive.campaign.sweep_job import SweepJob
from executive.cli.main import main
from executive.record.result import Audit, ItemCounts


def make_record(job: SweepJob, status: str = "SUCCESS") -> RunRecord:
    failure = ("Grasp.missed", "no seal", "tree/Grasp")
    reason, message, node = ("", "", "") if status == "SUCCESS" else failure
    run = RunRow(
        run_index=job.index, seed=job.seed, variant=job.variant, status=status, reason=reason,
        message=message, node=node, items=ItemCounts(seen=2, placed=2), audit=Audit(right=2),
        robot_time_s=10.0 + job.seed, wall_time_s=6.0,
        run_directory="" if status == "FAULT" else f"runs/{job.seed}",
    )  # fmt: skip
    return RunRecord(
        run,
        (),
        (
            SkillRow(
                run_index=job.index, skill="Grasp", activations=2, failed_activations=1, robot_time_s=0.5
            ),
        ),
    )


@pytest.fixture
def sweep(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Result]:
    """Function that sweeps; the run of each job has the next of the statuses, and no run follows the last."""

    def invoke(statuses: str, *words: str) -> Result:
        def run_sweep(jobs: list[SweepJob], database: ResultsDatabase, *_: object) -> None:
            for job, status in zip(jobs, statuses.split(), strict=False):
                database.append(make_record(job, status))

        monkeypatch.setattr("executive.campaign.sweep.run_sweep", run_sweep)
        folder = () if "--resume" in words else ("sort_fruit", "--runs", str(tmp_path / "runs"))
        return CliRunner().invoke(main, ("sweep", *folder, *words))

    return invoke


@pytest.mark.parametrize(
    ("statuses", "run_count", "code", "expected"),
    [
        ("SUCCESS", 1, 0, "1 of 1 runs succeeded\n"),
        ("SUCCESS FAILURE", 2, 0, "1 of 2 runs succeeded\n"),
        ("SUCCESS FAILURE", 6, 130, "halted after 2 of 6 runs; 1 of the 2 succeeded\n"),
        ("", 6, 130, "halted after 0 of 6 runs\n"),
    ],
)
def test_a_sweep_succeeds_if_all_runs_were_made(sweep, statuses, run_count, code, expected):
    shown = sweep(statuses, "--seeds", f"0:{run_count}", "--json")
    assert (shown.exit_code, expected in shown.stderr) == (code, True), shown.stderr
    figures = json.loads(shown.stdout)
    assert (figures["planned_run_count"], figures["is_incomplete"], len(figures["runs"])) == (
        run_count,
        code == 130,
        len(statuses.split()),
    )


def test_the_summary_shows_every_variant_and_how_to_repeat_a_failure(sweep):
    words = ("--seeds", "3-4", "--vary", "cell.table.objects=[[1, 1], [2, 2]]")
    shown = sweep("SUCCESS SUCCESS FAULT SUCCESS", *words)
    said = " ".join(shown.stderr.split())
    assert "3 of 4 runs succeeded" in said
    assert "success rate 100.00% (34.2 to 100.0) 50.00% (9.5 to 90.5)" in said
    assert "number in the right bin 4 of 4 4 of 4" in said
    assert "Grasp, per run [s] 0.50 (2 of 4 failed) 0.50 (2 of 4 failed)" in said
    assert (
        "with cell.table.objects=[2, 2]: 1 run: FAULT Grasp.missed at tree/Grasp: no seal seeds 3; repeat"
        in said
    )
    assert "the first: executive run sort_fruit --seed 3 --set 'cell.table.objects=[2, 2]'" in said


def test_an_unmet_requirement_is_the_reason_of_exit_code_1(sweep):
    words = ("--seeds", "0:2", "--json", "--require", "success >= 0.99 and p95(robot_time_s) < 20")
    shown = sweep("SUCCESS FAILURE", *words)
    message = "success>=0.99 is not met: the value is 0.5"
    assert (shown.exit_code, shown.stderr.splitlines()[-1]) == (1, message)
    assert json.loads(shown.stdout)["unmet_conditions"] == [message]
    assert sweep("SUCCESS SUCCESS", *words).exit_code == 0
    assert sweep("SUCCESS", *words).exit_code == 130, "a halt is more important"


def test_a_resumed_sweep_writes_its_report_for_all_runs(sweep, tmp_path):
    assert sweep("SUCCESS FAILURE", "--seeds", "0:3").exit_code == 130
    (folder,) = (tmp_path / "runs").glob("*/*_sweep_sort_fruit")
    shown = sweep("FAULT", "--resume", str(folder), "--junit", str(tmp_path / "junit.xml"))
    assert (shown.exit_code, "1 of 3 runs succeeded" in shown.stderr) == (0, True)
    names = [case.get("name") for case in ElementTree.parse(tmp_path / "junit.xml").iter("testcase")]
    assert names == ["seed 0", "seed 1", "seed 2"]
    refused = sweep("", "--resume", str(folder), "--junit", str(folder / "a" / "b"))
    assert (refused.exit_code, refused.stderr.splitlines()[-1]) == (
        2,
        f'cannot write the report "{folder}/a/b": no such file or directory; '
        "name another file with --junit FILE",
    )


def test_a_folder_that_cannot_be_made_is_one_message(sweep, tmp_path):
    (tmp_path / "file").touch()
    shown = sweep("", "--seeds", "0-9", "--runs", str(tmp_path / "file" / "runs"))
    assert (shown.exit_code, shown.stderr) == (
        2,
        f'cannot make a run directory below "{tmp_path}/file/runs": not a directory; '
        "name another folder with --runs DIR\n",
    )
