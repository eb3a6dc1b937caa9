# ruff: noqa: E501 - what is said is quoted as it is printed
"""How a skill ends wrongly is found, and told word for word."""

from __future__ import annotations

import broken_endings as broken
import pytest
from verdicts import Said, failures

from executive.skill import Skill

BROKEN: list[tuple[type[Skill], Said]] = [
    (broken.Scheming, {"arranged": (
        "Scheming cannot be tried: no value can be made up for the input \"plan\" (Mapping) and the input "
        '"words" (a text). Give it in a test: conformance(Scheming, lambda stage: {"plan": ..., "words": ...}), '
        "as skills/README.md shows."
    )}),
    (broken.Instant, {"hands_back_steps": (
        'Instant.run returned a NoneType. Make it a generator: if it never waits, begin it with "yield from ()".'
    )}),
    (broken.Listing, {"hands_back_steps": (
        'Listing.run returned a list. Make it a generator: if it never waits, begin it with "yield from ()".'
    )}),
    (broken.Endless, {
        "comes_to_an_end": (
            "with an empty tool Endless was not over after 60 s. "
            "Whatever it waits for may never come: wait for so long at most, then fail with a reason."
        ),
        "succeeds_somewhere": (
            "Endless never succeeded; with an empty tool it was not over. Arrange a stage on which it can: "
            "conformance(Endless, lambda stage: ...), as skills/README.md shows."
        ),
    }),
    (broken.Faulty, {
        "ends_as_declared": (
            "with an item in the tool at tick 1 KeyError in broken_endings.py:{line}: 'bin'. That is a fault, "
            "which ends the run: fail with a declared reason where this can happen, or mend it."
        ),
        "adversity_ends_as_declared": (
            "with an item in the tool while everything on the table is gone at tick 1 KeyError in "
            "broken_endings.py:{line}: 'bin'. That is a fault, which ends the run: fail with a declared reason "
            "where this can happen, or mend it."
        ),
    }),
    (broken.Undeclared, {
        "ends_as_declared": (
            'with an item in the tool at tick 1 it failed with "bored", which it does not declare. '
            "Add it to reasons; there are: tired."
        ),
        "adversity_ends_as_declared": (
            "with an item in the tool while everything on the table is gone at tick 1 it failed with "
            '"bored", which it does not declare. Add it to reasons; there are: tired.'
        ),
    }),
    (broken.Wordless, {
        "ends_as_declared": (
            'with an item in the tool at tick 1 it failed with "tired" and no sentence. '
            "Say what happened, with the numbers: it is all that the operator will read."
        ),
        "adversity_ends_as_declared": (
            "with an item in the tool while everything on the table is gone at tick 1 it failed with "
            '"tired" and no sentence. '
            "Say what happened, with the numbers: it is all that the operator will read."
        ),
    }),
    (broken.Numbers, {
        "ends_as_declared": (
            "with an item in the tool at tick 1 TypeError: it yielded a int; to run the steps of others "
            'write "yield from". That is a fault, which ends the run: fail with a declared reason where this '
            "can happen, or mend it."
        ),
        "adversity_ends_as_declared": (
            "with an item in the tool while everything on the table is gone at tick 1 TypeError: it yielded "
            'a int; to run the steps of others write "yield from". That is a fault, which ends the run: fail '
            "with a declared reason where this can happen, or mend it."
        ),
    }),
    (broken.Trusting, {"adversity_ends_as_declared": (
        "with an empty tool while no detector answers at tick 12 Unavailable in broken_endings.py:{line}: "
        "no answer within 5 s. That is a fault, which ends the run: fail with a declared reason where this "
        "can happen, or mend it."
    )}),
    (broken.Hopeless, {"succeeds_somewhere": (
        'Hopeless never succeeded; with an empty tool it failed with "tired" (after 1 step). Arrange a stage '
        "on which it can: conformance(Hopeless, lambda stage: ...), as skills/README.md shows."
    )}),
    (broken.Butterfingers, {"tool_left_as_declared": (
        "with an item in the tool it succeeded, and the tool is empty. It should hold something: tool_state "
        "says so. Leave the tool as declared, or declare how it is left."
    )}),
    (broken.Secretive, {"tool_left_as_declared": (
        "with an empty tool it succeeded, and the tool holds what the ledger does not know of. "
        "Tell it by cell.ledger.held, or open the tool in finally."
    )}),
    (broken.Hasty, {"rests_at_the_end": (
        "with an empty tool it succeeded while the arm still moves. Wait until it is at rest, or call "
        "cell.arm.stop() in finally, as follow of executive.moving does."
    )}),
    (broken.Unplanned, {
        "ends_as_declared": (
            "with an empty tool at tick 0 Fault in broken_endings.py:{line}: the generator planned(...) was "
            'passed to the arm where a motion is expected: "yield from" is missing. '
            'Write "motion = yield from planned(...)". That is a fault, which ends the run: fail with a '
            "declared reason where this can happen, or mend it."
        ),
        "adversity_ends_as_declared": (
            "with an empty tool while everything on the table is gone at tick 0 Fault in "
            "broken_endings.py:{line}: the generator planned(...) was "
            'passed to the arm where a motion is expected: "yield from" is missing. '
            'Write "motion = yield from planned(...)". That is a fault, which ends the run: fail with a '
            "declared reason where this can happen, or mend it."
        ),
        "succeeds_somewhere": (
            "Unplanned never succeeded; with an empty tool it ended as a fault: Fault in "
            "broken_endings.py:{line}: the generator planned(...) was "
            'passed to the arm where a motion is expected: "yield from" is missing. '
            'Write "motion = yield from planned(...)". '
            "Arrange a stage on which it can: conformance(Unplanned, lambda stage: ...), as skills/README.md "
            "shows."
        ),
    }),
    (broken.Lingering, {"halts_at_once": (
        'with an empty tool it was halted at tick 1: it yielded in "finally". '
        "What finally does must be done at once and cannot fail. (So after 1 of 2 halts.)"
    )}),
    (broken.Stumbling, {"halts_at_once": (
        "with an empty tool it was halted at tick 1: ValueError in broken_endings.py:{line}: not done. "
        "What finally does must be done at once and cannot fail. (So after 1 of 1 halts.)"
    )}),
    (broken.Runaway, {"halts_at_rest": (
        "with an empty tool it was halted at tick 13, and the arm moves on. "
        "Call cell.arm.stop() in finally, or use follow of executive.moving. (So after 168 of 181 halts.)"
    )}),
    (broken.Clinging, {"halts_with_tool_as_declared": (
        "with an empty tool it was halted at tick 1, and the tool holds something. It should be empty: as "
        'before, for tool_left says nothing of "halt". '
        "Leave the tool as declared, or declare how it is left. (So after 1 of 1 halts.)"
    )}),
]  # fmt: skip
"""Skills, and what is said of them first, by the name of every check that fails."""


@pytest.mark.parametrize(("skill", "said"), BROKEN, ids=lambda value: getattr(value, "__name__", ""))
def test_a_broken_rule_is_found_and_nothing_else(skill: type[Skill], said: Said) -> None:
    assert failures(skill) == said
