"""A check is one test: it returns, or says what rule is broken and how."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from broken_conduct import Forgetful
from broken_endings import Scheming
from conforming_skills import Pause, Push
from test_broken_calls import BROKEN as BROKEN_CALLS
from test_broken_conduct import BROKEN as BROKEN_CONDUCT
from test_broken_declarations import BROKEN as BROKEN_DECLARATIONS
from test_broken_endings import BROKEN as BROKEN_ENDINGS

from executive.skill import Skill
from executive.testing.conformance import conformance
from executive.testing.conformance.check import Check, NotConforming
from executive.testing.conformance.checks import RULES


def check_of(skill: type[Skill], name: str) -> Check:
    (found,) = (check for check in conformance(skill) if check.name == name)
    return found


@pytest.mark.parametrize("skill", [Push, Pause])
def test_nothing_is_found_in_a_skill_that_conforms(skill: type[Skill]) -> None:
    for check in conformance(skill):
        check()


def test_every_rule_is_broken_by_a_skill() -> None:
    skills = (*BROKEN_DECLARATIONS, *BROKEN_CALLS, *BROKEN_ENDINGS, *BROKEN_CONDUCT)
    broken = {name for _, said in skills for name in said}
    assert broken | {"named_for_missions", "imports_allowed", "ticks_come_back"} == {
        rule.__name__ for rule in RULES
    }


def test_a_name_that_no_mission_can_say_is_found() -> None:
    first, *others = (check.verdict() for check in conformance(Pause, name="take_a_break"))
    assert first.check == "named_for_missions"
    assert first.problems == (
        'no mission can name a skill "take_a_break". Call it in CamelCase, for instance PointAt.',
    )
    assert {verdict.status for verdict in others} == {"ok"}


@pytest.mark.parametrize("statement", ["import time", "from threading import Lock", "import asyncio.events"])
def test_a_file_that_imports_another_clock_or_other_threads_is_found(statement: str, tmp_path: Path) -> None:
    skill = written(tmp_path / "waving.py", statement)
    package = statement.split()[1].partition(".")[0]
    verdicts = (check.verdict() for check in conformance(skill))
    (failed,) = (verdict for verdict in verdicts if verdict.status != "ok")
    assert failed.check == "imports_allowed"
    assert failed.problems == (
        f"waving.py:3 imports {package}. A skill waits on cell.clock and acts through cell alone; "
        "find there what it needs.",
    )


def written(path: Path, statement: str) -> type[Skill]:
    """Return a skill whose file has a statement in its third line."""
    text = f"""
from executive.skill import Skill
{statement}

class Wave(Skill):
    '''Wave once.'''

    def run(self, cell):
        yield
"""
    path.write_text(text, encoding="utf-8")
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    # The annotations of a class are looked up in the module of its name.
    sys.modules[path.stem] = module
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[path.stem]
    wave: type[Skill] = module.Wave
    return wave


def test_what_is_wrong_is_raised_with_the_rule_it_breaks() -> None:
    with pytest.raises(NotConforming) as raised:
        check_of(Forgetful, "outputs_set")()
    first, second, *_ = str(raised.value).splitlines()
    assert first == "When it succeeds it has set every output. Not so:"
    assert second.startswith("with an empty tool Forgetful succeeded without setting chosen.")


def test_what_could_not_be_run_is_no_success() -> None:
    check = check_of(Scheming, "halts_at_rest")
    assert check.verdict().status == "not run"
    with pytest.raises(NotConforming, match='no value can be made up for the input "plan"'):
        check()


def test_a_check_is_called_after_skill_and_rule() -> None:
    assert str(conformance(Pause)[0]) == "Pause.named_for_missions"
    assert str(conformance(Pause, name="Break")[0]) == "Break.named_for_missions"
