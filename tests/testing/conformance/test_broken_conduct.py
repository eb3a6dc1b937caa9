"""What a skill does wrongly is found, and told word for word."""

from __future__ import annotations

import broken_conduct as broken
import pytest
from verdicts import Said, failures, problems

from executive.skill import Skill

BROKEN: list[tuple[type[Skill], Said]] = [
    (broken.Forgetful, {"outputs_set": (
        "with an empty tool Forgetful succeeded without setting chosen. "
        "Set every output before run returns, or fail with a reason."
    )}),
    (broken.Miscounting, {"outputs_fit": (
        "with an empty tool Miscounting.chosen is 3, not a text. Set what it declares, or declare what it is."
    )}),
    (broken.Inventing, {"outputs_fit": (
        "with an empty tool Inventing.bins is ['red_bin', 'green_bin'], but there is no bin \"green_bin\". "
        "There are: red_bin, blue_bin, yellow_bin."
    )}),
    (broken.Scribbling, {"writes_only_outputs": (
        "with an empty tool it set self.count, which is no output. "
        "Declare it as Out[...], call it _count, or make it a local name."
    )}),
    (broken.Overwriting, {"writes_only_outputs": (
        "with an empty tool it set self.targets anew, which was given to it. "
        "Params and inputs are read only; take a local name."
    )}),
    (broken.Greedy, {"inputs_unchanged": (
        "with an empty tool it changed what self.targets holds. "
        "Others read the same value after it: work on a copy."
    )}),
    (broken.Presumptuous, {"uses_only_what_it_declares": (
        'Presumptuous calls cell.camera.capture and does not use the camera. Add "camera" to uses.'
    )}),
    (broken.Moody, {"repeats_itself": (
        "with an empty tool, twice the same, it called camera.area at tick 1 with different arguments. "
        "Nothing may depend on chance, on time, on an object's address, or on what an earlier run has left; "
        "a seed may be a param."
    )}),
    (broken.Restless, {"repeats_itself": (
        "with an empty tool, twice the same, it succeeded after 0 ticks and then it succeeded after 1. "
        "Nothing may depend on chance, on time, on an object's address, or on what an earlier run has left; "
        "a seed may be a param."
    )}),
    (broken.Slow, {"ticks_are_quick": (
        "with an item in the tool it computed for {ms} ms in tick 1, which holds up the arm. "
        "Spread the work over ticks by yield, or let a detector do it beside."
    )}),
    (broken.Boasting, {"never_sooner_than_shortest": (
        "with an empty tool it took 0.008 s, less than the 1.000 s that shortest promises. "
        "executive check refuses timeouts by it: return a bound that holds on every cell."
    )}),
    (broken.Demanding, {"never_sooner_than_shortest": (
        "Demanding.shortest raises KeyError: 'gap', asked with no more than a mission may say (nothing). "
        "Return 0 where nothing is known."
    )}),
    (broken.Clockwatching, {"keeps_to_the_clock": (
        "with an empty tool it called time.sleep in broken_conduct.py:{line}. "
        "The only clock is cell.clock: now, and sleep to yield from."
    )}),
    (broken.Leaking, {"leaves_nothing_open": (
        "with an empty tool it left the open file /dev/null (number {fd}). "
        "Close it in finally; what works beside the ticks is a detector."
    )}),
]  # fmt: skip
"""Skills, and what is said of them first, by the name of every check that fails."""

EVERYTHING: list[tuple[type[Skill], str, list[str]]] = [
    (broken.Presumptuous, "uses_only_what_it_declares", [
        'Presumptuous calls cell.camera.capture and does not use the camera. Add "camera" to uses.',
        "Presumptuous calls cell.camera.capture and does not say that it senses. Add senses = True.",
        "Presumptuous calls cell.operator.ask and does not say that it senses. Add senses = True.",
        'Presumptuous calls cell.arm.stop and does not use the arm. Add "arm" to uses.',
    ]),
    (broken.Sneaking, "uses_only_what_it_declares", [
        "Sneaking calls cell.arm.start and does not say that it moves. Add moves = True.",
    ]),
]  # fmt: skip
"""Skills, a check, and everything that it says."""


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
@pytest.mark.parametrize(("skill", "said"), BROKEN, ids=lambda value: getattr(value, "__name__", ""))
def test_a_broken_rule_is_found_and_nothing_else(skill: type[Skill], said: Said) -> None:
    assert failures(skill) == said


@pytest.mark.parametrize(("skill", "check", "told"), EVERYTHING)
def test_everything_that_breaks_a_rule_is_told(skill: type[Skill], check: str, told: list[str]) -> None:
    assert problems(skill, check) == told
