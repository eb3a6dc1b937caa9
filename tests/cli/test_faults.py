"""`executive faults`: what it prints, and its exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner, Result

from executive.campaign.faults.planned_fault import PlannedFault, SkillFault
from executive.campaign.faults.results import Branch, FaultCampaignResults, Trial
from executive.cli.main import main

FAKE = ("sort_overhead", "--set", "cell.kind=fake")
FAULT = PlannedFault(
    "tree/Grasp", "Grasp", "sort.yaml:7", "missed", "first", "the suction cup cannot seal",
    SkillFault("tree/Grasp", "fails", "missed"),
)  # fmt: skip
TRIAL = Trial("SUCCESS", "", "", "", True, "", 10, 1.0, faults={1: FAULT}, have_occurred=True)


def invoke(*words: str) -> Result:
    return CliRunner().invoke(main, ("faults", *words))


@pytest.fixture
def campaigns(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Stands for the campaign: what it was asked for, and what it says went wrong."""
    fake = SimpleNamespace(asked=[], problems=(), complete=True)

    class Campaign:
        def __init__(self, subject, options):
            fake.asked.append((subject.name, subject.cell_description, subject.seed, options.workers))
            self._name = subject.name

        def run_single_faults(self):
            fake.asked.append("singles")
            return self._figures(pairs=False)

        def run_fault_pairs(self, count):
            fake.asked.append(("pairs", count))
            return self._figures(pairs=True)

        def _figures(self, *, pairs):
            trial = Trial(**{**vars(TRIAL), "problems": fake.problems})
            ways = (Branch("sort.yaml:14", "recover"),)
            return FaultCampaignResults(self._name, "fake", 0, 11.5, 1, (trial,), ways, fake.complete, pairs)

    monkeypatch.setattr("executive.campaign.faults.campaign.Campaign", Campaign)
    return fake


def test_pairs_are_tried_instead_and_an_oracle_where_one_is_wanted(campaigns):
    shown = invoke("sort_overhead", "--oracle", "--pairs", "7", "--json")
    assert campaigns.asked == [("sort_overhead", "sim, true detections", 0, 2), ("pairs", 7)]
    assert json.loads(shown.stdout)["pairs"] is True


def test_the_list_runs_nothing_but_the_undisturbed_mission():
    shown = invoke(*FAKE, "--list")
    assert shown.exit_code == 0
    lines = shown.stdout.splitlines()
    assert lines[0].split(maxsplit=2)[:2] == ["1", "tree/look/try/retry/recover/MoveToScan"]
    assert any("Grasp missed, first: the suction cup cannot seal" in line for line in lines)
    listed = json.loads(invoke(*FAKE, "--list", "--json").stdout)
    assert [entry["fault"] for entry in listed] == list(range(1, len(lines) + 1))


@pytest.mark.slow
def test_one_fault_is_repeated_and_recorded(tmp_path: Path):
    lines = invoke(*FAKE, "--list").stdout.splitlines()
    number = next(
        line.split()[0] for line in lines if "Grasp missed, first: the suction cup cannot seal" in line
    )
    shown = invoke(*FAKE, "--fault", number, "--runs", str(tmp_path))
    assert shown.exit_code == 0, shown.output
    lines = shown.stdout.splitlines()
    assert lines[0].startswith(f"fault {number}: tree/")
    assert lines[1] == "  SUCCESS"
    assert (Path(lines[-1]) / "result.json").is_file()
    plain = json.loads(invoke(*FAKE, "--fault", number, "--runs", str(tmp_path), "--json").stdout)
    assert (plain["fault"], plain["verdict"], plain["happened"]) == (number, "ok", True)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--fault", "0"), "sort_overhead has no fault 0; the numbers are 1 to "),
        (("--fault", "twelve"), '"twelve" is not a fault; write its number, or 3+12 for two faults'),
        (("--fault", "1", "--list"), "--pairs, --fault and --list exclude each other"),
        (("--pairs", "0"), "0 is not in the range x>=1"),
    ],
)
def test_what_cannot_be_tried_is_refused(words, expected):
    shown = invoke(*FAKE, *words)
    assert shown.exit_code == 2
    assert expected in shown.stderr


@pytest.mark.parametrize(
    ("problems", "complete", "code", "expected"),
    [
        ((), True, 0, "    never entered: sort.yaml:14: recover"),
        (("the arm is not at rest",), True, 1, "wrong: the arm is not at rest"),
        ((), False, 130, "ended by the user"),
    ],
)
def test_it_prints_the_matrix_and_ends_by_what_it_found(campaigns, problems, complete, code, expected):
    campaigns.problems, campaigns.complete = problems, complete
    shown = invoke(*FAKE, "--workers", "1", "--seed", "4")
    assert campaigns.asked == [("sort_overhead", "fake", 4, 1), "singles"]
    assert (shown.exit_code, expected in shown.stdout) == (code, True)
    assert "  Grasp  sort.yaml:7  missed  " in shown.stdout
