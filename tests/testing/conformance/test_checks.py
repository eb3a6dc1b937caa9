"""Every check against the skills that make its mistake, with the exact messages; and every shipped skill."""

from __future__ import annotations

import re
import signal

import faulty_skills as faulty
import pytest

from executive.plugins import load_skills
from executive.skill import Skill
from executive.testing.conformance import list_conformance_checks
from executive.testing.conformance.conformance_check import RULES, Check, ConformanceError

ARRANGE = "skills/README.md has an example."
FAULT = " This is a fault, which ends the run: fail with a declared reason, or correct the code."
FINALLY = "The code in finally must take no control step and raise no exception."
REST = "Call cell.arm.stop() in finally, or use follow of executive.manipulation.motions."
CHANCE = "The skill may not depend on chance, wall time or earlier runs; a seed may be a param."
TOOL = "Leave the tool in this state, or change the declaration."
EMPTY = "with an empty tool"


FAULTY: list[tuple[str, type[Skill], list[str]]] = [
    ("has_documentation", faulty.Undocumented, [
        'the docstring of Undocumented begins with "", which is not a sentence. State in the first line what '
        "the skill achieves.",
        'Undocumented.gap has no doc. Write param(..., doc="its meaning").',
        'Undocumented.target has no doc. Write port(..., doc="its meaning").',
    ]),
    ("has_allowed_defaults", faulty.BadDefaults, [
        f"the default of BadDefaults.{problem}. Correct the default or the bounds." for problem in (
            "near must be at least 0.2 m, not 0.1",
            "far must be at most 0.2 m, not 0.3",
            'order must be "columns" or "none", not the text "rows"',
            'gap must be a number, not the text "wide"',
        )
    ]),
    ("ends_as_declared", faulty.RaisesUndeclared, [
        f'{EMPTY} at tick 1 RaisesUndeclared raised the undeclared reason "too_many"; it declares: tired '
        f"(faulty_skills.py:N).{FAULT}",
    ]),
    ("declares_reasons", faulty.TextForTuple, [
        'TextForTuple.reasons is the string "tired". Write a tuple: ("tired",).',
    ]),
    ("declares_resources", faulty.TextForTuple, [
        "TextForTuple uses 'arm'. Write a tuple of arm, tool, camera.",
    ]),
    ("declares_resources", faulty.BadResources, [
        "BadResources uses gripper. Write a tuple of arm, tool, camera.",
        'BadResources moves the arm but does not use it. Add "arm" to uses, or remove moves.',
        'BadResources.tool_state_after_failure has "dropped", which is not a reason of the skill. '
        "Allowed: tired, halt.",
    ]),
    ("ends_as_declared", faulty.StartsGenerator, [
        f"{EMPTY} at tick 0 the generator plan(...) was passed to the arm where a motion is expected: "
        '"yield from" is missing. Write "motion = yield from plan(...)" '
        f"(faulty_skills.py:N).{FAULT}",
    ]),
    ("decides_without_effect", faulty.BusyCondition, [
        *(f"BusyCondition {text}, and declares is_condition. Remove one of the two." for text in (
            "writes $count", "uses the camera", "requires a state of the tool",
        )),
        *(f"BusyCondition calls cell.{call}, and declares is_condition. A condition may only read the cell."
          for call in ("camera.capture", "ledger.invalidate_positions")),
        "BusyCondition took 2 ticks, and declares is_condition. Decide without a yield.",
    ]),
    ("can_succeed", faulty.AlwaysFails, [
        f'AlwaysFails never succeeded; {EMPTY} it failed with "tired" (after 1 step). Set up a scene in '
        f"which it succeeds: list_conformance_checks(AlwaysFails, lambda scene: ...); {ARRANGE}",
    ]),
    ("can_succeed", faulty.Shake, [
        'Shake never succeeded; with an item in the tool it failed with "blocked" (the motion would bring '
        "tool or load 30 mm too near to the table, with the tool at (0.530, -0.110, 0.020) m). Set up a "
        f"scene in which it succeeds: list_conformance_checks(Shake, lambda scene: ...); {ARRANGE}",
    ]),
    ("can_succeed", faulty.NeedsUnknown, [
        'NeedsUnknown cannot be tested: no value can be generated for "plan" (dict) and "words" (a text). '
        f'Return it from a function in a test: '
        f'list_conformance_checks(NeedsUnknown, lambda scene: {{"plan": ..., "words": ...}}); {ARRANGE}',
    ]),
    ("terminates", faulty.WaitsForEver, [
        f"{EMPTY} WaitsForEver was still running after 60 s. Limit the duration of each wait, and fail "
        "with a reason when it expires.",
    ]),
    ("ends_as_declared", faulty.TrustsTheDetector, [
        f"{EMPTY} while the table is empty at tick 12 IndexError: tuple index out of range "
        f"(faulty_skills.py:N).{FAULT}",
        f"{EMPTY} while the arm occludes the table at tick 12 IndexError: tuple index out of range "
        f"(faulty_skills.py:N).{FAULT}",
        f"{EMPTY} while no detector answers at tick 12 Unavailable: detector embedded: the detector is dead "
        f"(injected fault) (faulty_skills.py:N).{FAULT}",
        f"{EMPTY} while the detectors detect nothing at tick 12 IndexError: tuple index out of range "
        f"(faulty_skills.py:N).{FAULT}",
    ]),
    ("ends_as_declared", faulty.FailsWithoutSentence, [
        'with an item in the tool at tick 1 it failed with "tired" and no message. '
        "State what happened, with numbers: the operator reads only this message.",
    ]),
    ("has_outputs_of_declared_types", faulty.WrongOutputs, [
        f"{EMPTY} WrongOutputs.chosen is of the type int, not a text. "
        "Set a value of this type, or change the declaration.",
        f"{EMPTY} WrongOutputs.targets is of the type list, not a list of Target. "
        "Set a value of this type, or change the declaration.",
    ]),
    ("leaves_inputs_unchanged", faulty.ChangesInput, [
        f"{EMPTY} it changed the value of self.targets. Other nodes read the same value later: "
        "change a copy.",
    ]),
    ("uses_only_declared_parts", faulty.UsesUndeclared, [
        'UsesUndeclared calls cell.camera.capture and does not declare the camera. Add "camera" to uses.',
        "UsesUndeclared calls cell.camera.capture and does not declare that it senses. Add senses = True.",
        "UsesUndeclared calls cell.operator.ask and does not declare that it senses. Add senses = True.",
        'UsesUndeclared calls cell.arm.stop and does not declare the arm. Add "arm" to uses.',
    ]),
    ("uses_only_declared_parts", faulty.MovesUndeclared, [
        "MovesUndeclared calls cell.arm.start and does not declare that it moves. Add moves = True.",
    ]),
    ("leaves_tool_as_declared", faulty.LetsGo, [
        "with an item in the tool it succeeded, and the tool is empty. It should hold something, by "
        f"tool_state. {TOOL}",
    ]),
    ("leaves_tool_as_declared", faulty.GraspsInSecret, [
        f"{EMPTY} it succeeded, and the tool holds an object that is not in the ledger. "
        "Call cell.ledger.record_grasp, or open the tool in finally.",
    ]),
    ("leaves_tool_as_declared", faulty.HoldsOnWhenHalted, [
        f"{EMPTY} it was halted at tick 1, and the tool holds something. It should be empty, as before, "
        f'because tool_state_after_failure has no "halt". {TOOL}',
    ]),
    ("leaves_arm_at_rest", faulty.RunsOnWhenHalted, [
        f"{EMPTY} it was halted at tick 26, and the arm still moves. {REST}",
    ]),
    ("halts_in_one_tick", faulty.WaitsInFinally, [
        f"{EMPTY} at tick 1 it yielded while it was halted; \"finally\" must not contain a yield. {FINALLY}",
    ]),
    ("is_deterministic", faulty.DependsOnChance, [
        f"{EMPTY}, in two equal runs, it set its outputs to different values. {CHANCE}",
    ]),
    ("is_deterministic", faulty.CallsByChance, [
        f"{EMPTY}, in two equal runs, it called camera.get_view_box at tick 1 with different arguments. "
        f"{CHANCE}",
    ]),
    ("is_deterministic", faulty.WaitsByChance, [
        f"{EMPTY}, in two equal runs, it ended as SUCCESS after 1 ticks and then as SUCCESS after 0. "
        f"{CHANCE}",
    ]),
    ("has_short_ticks", faulty.ComputesTooLong, [
        "with an item in the tool tick 1 computed for N ms, which blocks the arm. "
        "Distribute the work over ticks with yield, or do it in a detector.",
    ]),
]  # fmt: skip
"""Check, skill, and the first problems that the check tells of it."""


def check_of(skill: type[Skill], name: str) -> Check:
    return next(check for check in list_conformance_checks(skill) if check.name == name)


def find_problems(check: Check) -> list[str]:
    """Return the problems without what depends on the machine, or on a line in a file."""
    patterns = ((r"\.py:\d+", ".py:N"), (r"\d+ ms", "N ms"))
    problems = list(check.run().problems)
    for pattern, word in patterns:
        problems = [re.sub(pattern, word, problem) for problem in problems]
    return problems


@pytest.mark.parametrize(("check", "skill", "problems"), FAULTY, ids=lambda one: getattr(one, "__name__", ""))
def test_a_mistake_is_reported(check: str, skill: type[Skill], problems: list[str]) -> None:
    assert find_problems(check_of(skill, check))[: len(problems)] == problems


def test_every_check_has_a_skill_that_fails_it() -> None:
    tested = {check for check, _, _ in FAULTY}
    assert tested == {rule.__name__ for rule in RULES}


def test_a_check_has_the_name_under_which_the_skill_is_installed() -> None:
    assert str(list_conformance_checks(faulty.Pause, name="Break")[0]) == "Break.has_documentation"


@pytest.mark.parametrize("skill", [faulty.Push, faulty.ShakeInTheAir], ids=lambda skill: skill.__name__)
def test_nothing_is_found_in_a_skill_that_conforms(skill: type[Skill]) -> None:
    for check in list_conformance_checks(skill):
        check()


QUICK = ("Grasp", "Release", "SelectTarget")
"""Shipped skills that are tried in the default tier; the others take seconds."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in load_skills()]
)
def test_every_shipped_skill_conforms(name: str) -> None:
    for check in list_conformance_checks(load_skills()[name], name=name):
        check()


def test_a_problem_is_raised_with_the_rule_and_without_a_stage_nothing_succeeds() -> None:
    with pytest.raises(ConformanceError) as raised:
        check_of(faulty.AlwaysFails, "can_succeed")()
    assert str(raised.value).splitlines()[0] == (
        "The skill can be tested, and succeeds in at least one situation; a condition may always fail. "
        "Violated:"
    )
    check = check_of(faulty.NeedsUnknown, "leaves_arm_at_rest")
    assert check.run().status == "not run"
    with pytest.raises(ConformanceError, match='no value can be generated for "plan"'):
        check()


def test_a_tick_that_does_not_come_back_is_broken_off_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.testing.conformance.skill_test_run.STUCK_TIMEOUT", 0.3)
    answered = signal.getsignal(signal.SIGALRM)
    checks = {check.name: check for check in list_conformance_checks(faulty.LoopsWithoutYield)}
    problem = (
        f"{EMPTY} while the table has changed since the last image at tick 1 LoopsWithoutYield did not "
        "return for 0.3 s, at faulty_skills.py:N. "
        "A long tick blocks the arm: yield in each loop that waits, and do long computations in a detector."
    )
    assert find_problems(checks["terminates"]) == find_problems(checks["halts_in_one_tick"]) == [problem]
    assert [checks[name].run().status for name in ("halts_in_one_tick", "has_allowed_defaults")] == [
        "not run",
        "ok",
    ]
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0
    assert signal.getsignal(signal.SIGALRM) is answered


def test_a_constructor_that_does_not_return_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.testing.conformance.skill_test_run.STUCK_TIMEOUT", 0.3)
    (problem, *_) = find_problems(check_of(faulty.LoopsInConstructor, "terminates"))
    assert "LoopsInConstructor did not return for 0.3 s, at faulty_skills.py:N." in problem
