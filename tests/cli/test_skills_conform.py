"""`executive skills --conform`: a line per check, one array as JSON, an exit code that says it all."""

from __future__ import annotations

import json
import re
from typing import ClassVar

import pytest
from click.testing import CliRunner, Result

from executive.cell import Cell, Steps
from executive.cli.main import main
from executive.skill import In, Metres, Skill, param, port
from executive.testing.conformance.checks import RULES


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
    reasons: ClassVar = ("awake",)


class Called(Rest):
    """Do nothing."""

    def run(self, cell: Cell) -> Steps:
        """Be called away, as by Ctrl-C."""
        yield
        raise KeyboardInterrupt


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.discovery.discover", lambda: {"Rest": Rest, "Nap": Nap, "Dream": Dream})


def conform(*words: str) -> Result:
    return CliRunner().invoke(main, ["skills", *words, "--conform"])


def test_a_skill_that_conforms_has_a_line_per_check_and_exit_code_0() -> None:
    result = conform("Rest")
    *lines, total = result.stdout.splitlines()
    assert lines == [f"ok       Rest.{rule.__name__}" for rule in RULES]
    assert total == f"{len(RULES)} checks of 1 skill: {len(RULES)} ok"
    assert result.exit_code == 0


def test_what_is_wrong_is_told_in_its_line_and_exit_code_1() -> None:
    result = conform("Nap")
    failed = [line for line in result.stdout.splitlines() if not line.startswith("ok")]
    assert failed == [
        "failed   Nap.defaults_allowed: Nap.gap has the default 0.3, which is more than 0.2. "
        "Mend the default, or what it is checked against. (and 1 more)",
        f"{len(RULES)} checks of 1 skill: {len(RULES) - 1} ok, 1 failed",
    ]
    assert result.exit_code == 1


def test_what_cannot_be_made_up_is_told_once_and_what_needs_it_is_not_run() -> None:
    result = conform("Dream")
    told = [line for line in result.stdout.splitlines() if not line.startswith("ok")]
    assert told[0] == (
        'failed   Dream.arranged: Dream cannot be tried: no value can be made up for the input "story" '
        '(a text). Give it in a test: conformance(Dream, lambda stage: {"story": ...}), '
        "as skills/README.md shows."
    )
    assert told[1] == "not run  Dream.ticks_come_back"
    assert told[-1].endswith(f"1 failed, {len(told) - 2} not run")
    assert result.exit_code == 1


def test_without_a_name_all_skills_are_checked() -> None:
    *_, total = conform().stdout.splitlines()
    assert total.startswith(f"{3 * len(RULES)} checks of 3 skills: ")


def test_as_json_all_checks_are_one_array() -> None:
    result = conform("Nap", "--json")
    told = json.loads(result.stdout)
    assert [verdict["check"] for verdict in told] == [rule.__name__ for rule in RULES]
    assert {verdict["skill"] for verdict in told} == {"Nap"}
    (failed,) = (verdict for verdict in told if verdict["status"] != "ok")
    assert failed["check"] == "defaults_allowed"
    assert failed["status"] == "failed"
    assert failed["doc"].startswith("Every default is one that a mission could give")
    assert len(failed["problems"]) == 2
    assert result.exit_code == 1


def test_what_a_skill_prints_is_no_result() -> None:
    assert "resting" not in conform("Rest").stdout


def test_a_skill_that_is_not_installed_is_bad_input() -> None:
    result = conform("Rets")
    assert (result.exit_code, result.stdout) == (2, "")
    assert 'no skill "Rets" is installed. Did you mean "Rest"?' in result.stderr


def test_ctrl_c_tells_what_was_found_and_which_check_was_under_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.discovery.discover", lambda: {"Called": Called})
    result = conform("Called")
    *_, last = result.stdout.splitlines()
    assert last == "ok       Called.arranged"
    told, halted = result.stderr.split("\n", 1)
    assert re.sub(r":\d+$", ":{line}", told) == (
        "Called.ticks_come_back was under way, at test_skills_conform.py:{line}"
    )
    assert halted.strip() == "halted"
    assert result.exit_code == 130
