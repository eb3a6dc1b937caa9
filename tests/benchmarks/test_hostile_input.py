"""The benchmark with hostile files: every kind of problem is found, and a small campaign has none."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.benchmarks.hostile_files import Arguments
from tests.benchmarks.hostile_input import CommandResult, find_problems

CHECK, CHECK_JSON = ["check", "mission.yaml"], ["check", "mission.yaml", "--json"]


@pytest.mark.parametrize(
    ("result", "problem"),
    [
        (CommandResult(2, "mission.yaml:1: wrong\n", "", 1.0, 100.0), None),
        (CommandResult(3, "", "internal error (KeyError: 1)", 1.0, 100.0), "an internal error: "),
        (CommandResult(3, "", "fault", 1.0, 100.0), "exit code 3: fault"),
        (CommandResult(2, "", "", 1.0, 100.0), "exit code 2 without a message"),
        (CommandResult(2, "wrong", "", 5.1, 100.0), "5.1 s of CPU time; 5 s are allowed"),
        (CommandResult(2, "wrong", "", 1.0, 301.0), "301 MB of memory; 300 MB are allowed"),
        (CommandResult(2, "a\x1b[31m", "", 1.0, 100.0), r"prints '\x1b'"),
        (CommandResult(2, "x" * 201, "", 1.0, 100.0), "prints 'xxxxx"),
    ],
)
def test_problems_of_an_result_are_found(result: CommandResult, problem: str | None) -> None:
    problems = find_problems(CHECK, result)
    assert any(found.startswith(problem) for found in problems) if problem else problems == []


@pytest.mark.parametrize(("arguments", "found"), [(CHECK, False), (CHECK_JSON, True)])
def test_text_in_place_of_json_is_a_problem(arguments: Arguments, found: bool) -> None:
    problems = find_problems(arguments, CommandResult(2, "wrong", "", 1.0, 100.0))
    assert any(problem.startswith("standard output is no JSON") for problem in problems) is found


@pytest.mark.slow
def test_a_small_campaign_has_no_problem() -> None:
    sizes = ["--texts", "12", "--data-sets", "8", "--models", "4", "--seed", "7"]
    command = [sys.executable, "-m", "tests.benchmarks.hostile_input", *sizes]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
