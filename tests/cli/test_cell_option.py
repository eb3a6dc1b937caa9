"""`--cell CELL` of the commands that take a mission."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from at_terminal import invoke

from executive.record.journal import find_run_start, read_journal


@pytest.fixture
def wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A mission of a moment, in the working directory, and the cell `stand/mine.yaml` below it."""
    monkeypatch.chdir(tmp_path)
    Path("stand").mkdir()
    table = "{x: [0.42, 0.64], y: [-0.22, 0.22], objects: [1, 1]}"
    Path("stand/mine.yaml").write_text(f"base: kitting.yaml\ncell: mine\ntable: {table}\n")
    head = "mission: wait\ncell: cells/overhead.yaml\nroutes: {bolt: tray_1}\n"
    Path("wait.yaml").write_text(head + "tree: {Wait: {seconds: 0.1}}\n")
    return tmp_path


def test_a_run_on_another_cell_is_recorded_and_repeated_with_it(wait: Path) -> None:
    done = invoke("run", "wait.yaml", "--cell", "stand/mine.yaml")
    assert done.exit_code == 0, done.output
    run = Path("runs/latest")
    start = find_run_start(read_journal(run / "journal.jsonl"), run, "")
    assert (start.cell, start.base) == ("stand/mine.yaml", str(wait / "stand"))
    assert "cell: mine\n" in (run / "cell.yaml").read_text()
    repeat = "executive run wait.yaml --seed 0 --cell stand/mine.yaml"
    assert repeat in done.stderr
    assert repeat in (run / "report.html").read_text()


def test_a_run_on_another_cell_is_replayed_and_resumed_on_it(wait: Path) -> None:
    assert invoke("run", "wait.yaml", "--cell", "stand/mine.yaml", "--quiet").exit_code == 0
    assert invoke("replay", "latest").exit_code == 0
    Path("runs/latest/result.json").unlink()
    resumed = invoke("run", "--resume", "latest")
    assert resumed.exit_code == 0, resumed.output
    assert "--cell stand/mine.yaml" in resumed.stderr


def test_findings_have_the_position_in_the_other_cell(wait: Path) -> None:
    Path("stand/mine.yaml").write_text("base: kitting.yaml\ncell: mine\ntable: {gap: wide}\n")
    checked = invoke("check", "wait.yaml", "--cell", "stand/mine.yaml", "--json")
    (finding,) = json.loads(checked.stdout)[0]["findings"]
    assert (checked.exit_code, finding["path"], finding["line"]) == (2, "stand/mine.yaml", 3)


@pytest.mark.parametrize(("cell", "exit_code"), [("kitting", 0), ("overhead", 2)])
def test_routes_are_checked_against_the_other_cell(wait: Path, cell: str, exit_code: int) -> None:
    assert invoke("check", "wait.yaml", "--cell", cell).exit_code == exit_code
    assert invoke("tree", "wait.yaml", "--cell", cell).exit_code == exit_code


@pytest.mark.parametrize(
    "command", ["run", "check", "tree", "faults", "sweep --seeds 1", "compare --seeds 1"]
)
def test_a_cell_that_does_not_exist_is_refused(wait: Path, command: str) -> None:
    refused = invoke(*command.split(), "wait.yaml", "--cell", "kiting")
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert refused.stderr.startswith(
        'there is no cell file and no shipped cell "kiting". Did you mean "kitting"?'
    )


@pytest.mark.slow
def test_a_sweep_runs_on_the_other_cell(wait: Path) -> None:
    swept = invoke("sweep", "wait.yaml", "--seeds", "1", "--workers", "1", "--cell", "kitting", "--json")
    result = json.loads(swept.stdout)
    (run,) = result["runs"]
    assert (result["settings"]["replacing_cell"], run["status"]) == ("kitting", "SUCCESS")
    assert "cell: kitting\n" in (Path(run["run_directory"]) / "cell.yaml").read_text()


def test_the_faults_are_those_of_a_run_on_the_other_cell(wait: Path) -> None:
    done = invoke("faults", "kit_fasteners", "--cell", "stand/mine.yaml", "--fault", "1", "--json")
    assert "cell: mine\n" in (Path(json.loads(done.stdout)["run_directory"]) / "cell.yaml").read_text()
