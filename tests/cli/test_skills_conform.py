"""`executive skills --conform`: a line per check, one array as JSON, an exit code that says it all."""

from __future__ import annotations

import pytest
from at_terminal import invoke
from click.testing import Result

from executive.cell.protocols import Cell, Steps
from executive.skill import Skill
from executive.testing.conformance import RULES


class Rest(Skill):
    """Do nothing."""

    def run(self, cell: Cell) -> Steps:
        """Wait one step."""
        print("resting")  # noqa: T201 - what a skill prints is no result
        yield


class Nap(Rest):
    """Fail without a message."""

    reasons = ("tired",)

    def run(self, cell: Cell) -> None:  # type: ignore[override]
        """Fail."""
        raise self.failure("tired", "")


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.behaviours.load_skills", lambda: {"Rest": Rest, "Nap": Nap})


def conform(*words: str) -> Result:
    return invoke("skills", *words, "--conform")


def test_a_skill_that_conforms_has_a_line_per_check_and_exit_code_0() -> None:
    result = conform("Rest")
    *lines, total = result.stdout.splitlines()
    assert lines == [f"ok       Rest.{rule.__name__}" for rule in RULES]
    assert total == f"{len(RULES)} checks of 1 skill: {len(RULES)} ok"
    assert result.exit_code == 0


def test_without_a_name_all_skills_are_checked_and_mistakes_have_exit_code_1() -> None:
    result = conform()
    lines = [line for line in result.stdout.splitlines() if not line.startswith("ok")]
    assert lines[0].startswith("failed   Nap.can_succeed: Nap never succeeded; with an empty tool")
    assert lines[1].startswith("failed   Nap.ends_as_declared: with an empty tool")
    total = 2 * len(RULES)
    assert lines[2:] == [f"{total} checks of 2 skills: {total - 2} ok, 2 failed"]
    assert result.exit_code == 1
