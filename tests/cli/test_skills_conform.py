"""`executive skills --conform`: a line per check, one array as JSON, an exit code that says it all."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner, Result

from executive.cell.protocols import Cell, Steps
from executive.cli.main import main
from executive.skill import In, Metres, Skill, param, port
from executive.testing.conformance.conformance_check import RULES


class Rest(Skill):
    """Do nothing."""

    def run(self, cell: Cell) -> Steps:
        """Wait one step."""
        print("resting")  # noqa: T201 - what a skill prints is no result
        yield


class Nap(Rest):
    """Do nothing."""

    gap: Metres = param(0.3, le=0.2, doc="how far")
    limit: Metres = param(0.0, ge=0.1, doc="at least so far")


class Dream(Rest):
    """Do nothing."""

    story: In[str] = port(doc="what about")


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.plugins.load_skills", lambda: {"Rest": Rest, "Nap": Nap, "Dream": Dream})


def conform(*words: str) -> Result:
    return CliRunner().invoke(main, ["skills", *words, "--conform"])


def test_a_skill_that_conforms_has_a_line_per_check_and_exit_code_0() -> None:
    result = conform("Rest")
    *lines, total = result.stdout.splitlines()
    assert lines == [f"ok       Rest.{rule.__name__}" for rule in RULES]
    assert total == f"{len(RULES)} checks of 1 skill: {len(RULES)} ok"
    assert result.exit_code == 0


def test_without_a_name_all_skills_are_checked_and_mistakes_have_exit_code_1() -> None:
    result = conform()
    lines = [line for line in result.stdout.splitlines() if not line.startswith("ok")]
    assert lines[:3] == [
        "failed   Nap.has_allowed_defaults: the default of Nap.gap must be at most 0.2 m, not 0.3. "
        "Correct the default or the bounds. (and 1 more)",
        "failed   Dream.can_succeed: Dream cannot be tested: "
        'no value can be generated for "story" (a text). '
        'Return it from a function in a test: list_conformance_checks(Dream, lambda scene: {"story": ...}); '
        "skills/README.md has an example.",
        "not run  Dream.terminates",
    ]
    not_run = len(lines) - 3
    total = 3 * len(RULES)
    assert lines[-1] == f"{total} checks of 3 skills: {total - 2 - not_run} ok, 2 failed, {not_run} not run"
    assert result.exit_code == 1


def test_as_json_all_checks_are_one_array() -> None:
    result = conform("Nap", "--json")
    printed = json.loads(result.stdout)
    assert [verdict["check"] for verdict in printed] == [rule.__name__ for rule in RULES]
    assert {verdict["skill"] for verdict in printed} == {"Nap"}
    (failed,) = (verdict for verdict in printed if verdict["status"] != "ok")
    assert (failed["check"], failed["status"]) == ("has_allowed_defaults", "failed")
    assert failed["doc"].startswith("Each default is a valid value of its param")
    assert len(failed["problems"]) == 2
    assert result.exit_code == 1
