"""`executive compare`: its table, its page and its exit codes, with runs of which only the rows exist."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from at_terminal import invoke
from click.testing import Result
from test_sweep_command import make_record

from executive.campaign.jobs import SweepJob


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Result]:
    """Function that compares; runs of a mission with `cell.table.objects=[1, 1]` fail for even seeds."""

    def run_jobs(jobs: list[SweepJob], _run: Any, _fail: Any, _options: Any, store: Any) -> None:
        for job in jobs:
            has_loss = job.settings.overrides.get("cell.table.objects") == "[1, 1]" and job.seed % 2 == 0
            record = make_record(job, "FAILURE" if has_loss else "SUCCESS")
            run = replace(record.run, run_directory=str(tmp_path / f"{job.runs_folder.name}{job.seed}"))
            store(job.index, replace(record, run=run), 0)

    monkeypatch.setattr("executive.campaign.sweep.run_jobs", run_jobs)

    def compare_with(*words: str) -> Result:
        runs = () if "--resume" in words else ("--runs", str(tmp_path / "runs"))
        return invoke("compare", *words, *runs)

    return compare_with


def test_each_side_may_have_a_cell_of_its_own(compare) -> None:
    shown = compare("kit_fasteners", "--seeds", "0:2", "--cell-b", "kitting", "--json")
    assert [each["replacing_cell"] for each in json.loads(shown.stdout)["settings"]] == ["", "kitting"]
    refused = compare("kit_fasteners", "--seeds", "0:2", "--cell-b", "kitting", "--cell", "kitting")
    assert "omit it, or omit --cell-a and --cell-b" in refused.output


LOSS = ("kit_fasteners", "--seeds", "0:10", "--set", "cell.kind=fake", "--set-b", "cell.table.objects=[1, 1]")


def test_a_loss_is_detected_and_both_reports_are_linked(compare, tmp_path: Path) -> None:
    for side in "ab":
        (tmp_path / f"{side}4").mkdir()
        (tmp_path / f"{side}4" / "report.html").touch()
    shown = compare(*LOSS, "--json")
    assert shown.exit_code == 0, shown.output
    figures = json.loads(shown.stdout)
    success = figures["differences"][0]
    assert (success["difference"], success["high"] < 0) == (-0.5, True)
    assert [pair["seed"] for pair in figures["changed_pairs"]] == [0, 2, 4, 6, 8]
    assert [settings["overrides"] for settings in figures["settings"]] == [
        {"cell.kind": "fake"},
        {"cell.kind": "fake", "cell.table.objects": "[1, 1]"},
    ]
    said = " ".join(shown.stderr.split())
    assert "10 pairs of runs with the same seed" in said and "5 seeds with a different outcome" in said
    assert f"seed 4: A SUCCESS {tmp_path}/a4; B FAILURE Grasp.missed {tmp_path}/b4" in said
    page = Path(figures["page"])
    text = page.read_text(encoding="utf-8")
    links = {(page.parent / link).resolve() for link in re.findall(r'<a href="([^"]+)"', text)}
    assert links == {tmp_path / f"{side}4" / "report.html" for side in "ab"}
    assert "<script" not in text and " src=" not in text


def test_a_mission_compared_with_itself_and_resumed(compare) -> None:
    first = compare("kit_fasteners", "--seeds", "0:4", "--json")
    figures = json.loads(first.stdout)
    assert [(one["difference"], one["low"], one["high"]) for one in figures["differences"]] == [(0, 0, 0)] * 3
    again = compare("--resume", str(Path(figures["page"]).parent), "--json")
    assert (again.exit_code, json.loads(again.stdout)) == (0, figures)
