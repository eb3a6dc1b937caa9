"""`executive report`, and the report that `executive run` leaves."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from at_terminal import invoke

FEW = ("--set", "cell.kind=fake", "--set", "cell.table.objects=[1, 1]")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run directory, made once."""
    runs = tmp_path_factory.mktemp("recorded")
    assert invoke("run", "sort_fruit", *FEW, "--quiet", "--runs", str(runs)).exit_code == 0
    return (runs / "latest").resolve()


@pytest.fixture
def run(recorded: Path, tmp_path: Path) -> Path:
    """A run directory whose report is gone, `latest` below the test's `runs`."""
    path = Path(shutil.copytree(recorded, tmp_path / "runs" / recorded.parent.name / recorded.name))
    (path / "report.html").unlink()
    (tmp_path / "runs" / "latest").symlink_to(path.relative_to(tmp_path / "runs"))
    return path


@pytest.mark.parametrize(("quiet", "said"), [((), 1), (("--quiet",), 0)])
def test_without_its_report_a_run_ends_as_it_did(tmp_path, monkeypatch, quiet, said) -> None:
    def broken(path: Path) -> Path:
        raise ZeroDivisionError("no ink")

    monkeypatch.setattr("executive.view.report.write_report", broken)
    shown = invoke("run", "sort_fruit", *FEW, *quiet, "--json", "--runs", str(tmp_path))
    assert shown.exit_code == 0
    assert json.loads(shown.stdout)["status"] == "SUCCESS"
    assert shown.stderr.count("note: no report was written: ZeroDivisionError: no ink; ") == said
    assert "report:" not in shown.stderr


def test_it_writes_the_report_of_a_run_and_says_where(run: Path) -> None:
    runs, file = run.parents[1], run / "report.html"
    for words in (
        [str(run)],
        ["latest", "--runs", str(runs)],
        [f"{run.relative_to(runs)}", "--runs", str(runs)],
    ):
        shown = invoke("report", *words)
        assert (shown.exit_code, shown.stdout, shown.stderr) == (0, f"{file}\n", "")
    assert file.read_text().startswith("<!doctype html>")
    shown = invoke("report", str(run), "--json")
    assert json.loads(shown.stdout) == {"report": str(file), "bytes": file.stat().st_size}


def refused(*words: str) -> str:
    shown = invoke("report", *words)
    assert (shown.exit_code, shown.stdout) == (2, "")
    return shown.stderr


def test_what_has_no_report_is_refused_with_what_helps(run: Path) -> None:
    runs = run.parents[1]
    assert refused("nowhere", "--runs", str(runs)) == (
        f'"nowhere" is no run directory, and "{runs}" contains no run directory of this name; '
        f"the last runs there: {run.relative_to(runs)}\n"
    )
    (run / "report.html").mkdir()
    assert refused(str(run), "--json") == (
        f'cannot write the report "{run / "report.html"}": is a directory; copy the run directory to a '
        "writable folder, and write the report of the copy\n"
    )
    (run / "tree.json").unlink()
    assert refused(str(run)) == f"there is no file {run / 'tree.json'}\n"
