"""`executive faults`: what it prints, and its exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from at_terminal import invoke
from click.testing import Result

from executive.campaign.fault_list import PlannedFault, SkillFault
from executive.campaign.faults import Campaign, Trial

FAKE = ("sort_overhead", "--set", "cell.kind=fake", "--set", "cell.table.objects=[1, 1]")
FAULT = PlannedFault(
    "tree/Grasp", "Grasp sort.yaml:7", "missed", "first", SkillFault("Grasp", "missed", (1,))
)
TRIAL = Trial("SUCCESS", "", "", "", True, "", 10, 1.0, faults={1: FAULT}, have_occurred=True)


def faults(*words: str) -> Result:
    return invoke("faults", *words)


def test_faults_are_listed_and_one_is_repeated_and_recorded(tmp_path: Path) -> None:
    listed = json.loads(faults(*FAKE, "--list", "--json").stdout)
    lines = faults(*FAKE, "--list").stdout.splitlines()
    assert [line.split()[0] for line in lines] == [str(entry["fault"]) for entry in listed]
    number = next(entry["fault"] for entry in listed if "Grasp missed, first: grip" in entry["description"])
    shown = faults(*FAKE, "--fault", str(number), "--runs", str(tmp_path))
    lines = shown.stdout.splitlines()
    assert (shown.exit_code, lines[1]) == (0, "  SUCCESS")
    assert lines[0].startswith(f"fault {number}: tree/")
    assert (Path(lines[-1]) / "result.json").is_file()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--fault", "0"), "has no fault 0; the numbers are 1 to "),
        (("--fault", "twelve"), '"twelve" is not a fault'),
        (("--fault", "1", "--list"), "--pairs, --fault and --list exclude each other"),
    ],
)
def test_contradicting_options_are_refused(words: tuple[str, ...], expected: str) -> None:
    shown = faults(*FAKE, *words)
    assert (shown.exit_code, expected in shown.stderr) == (2, True)


@pytest.mark.parametrize(
    ("words", "problems", "is_complete", "code", "expected"),
    [
        ((), (), True, 0, "never entered: "),
        (("--pairs", "7"), ("the arm is not at rest",), True, 1, "wrong: the arm is not at rest"),
        ((), (), False, 130, "ended by the user"),
        (("--json",), (), True, 0, '"verdict": "ok"'),
    ],
)
def test_the_exit_code_depends_on_the_trials(
    words: tuple[str, ...], problems: tuple[str, ...], is_complete: bool, code: int, expected: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    asked: list[Any] = []

    def run(campaign: Campaign, *count: int) -> None:
        asked.append((campaign.mission.seed, *count))
        campaign.trials = [Trial(**{**vars(TRIAL), "problems": problems})]
        campaign.is_complete = is_complete

    monkeypatch.setattr(Campaign, "run_single_faults", run)
    monkeypatch.setattr(Campaign, "run_fault_pairs", run)
    shown = faults(*FAKE, "--seed", "4", *words)
    assert (shown.exit_code, expected in shown.stdout) == (code, True)
    assert asked == [(4, 7) if words[:1] == ("--pairs",) else (4,)]
