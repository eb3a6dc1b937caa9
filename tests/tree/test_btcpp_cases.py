"""Tests of BehaviorTree.CPP 4.10, restated as missions: same statuses at every tick.

A script has one word per activation of a skill, with one letter per tick: `R` running, `S` success,
`F` failure; the last word is used again. An expectation has one word per tick: the statuses of a node, then
`H` if it was halted; `-` if it was not ticked.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest
from hand_set_clock import Clock
from py_trees.common import Status

from executive.events import discard_event
from executive.mission.build import TreeBuilder
from executive.mission.load import load_mission
from executive.skill import Skill
from executive.tree.blackboard import Blackboard
from executive.tree.node_registry import load_control_nodes


class ScriptedSkill(Skill):
    """Follow a script."""

    reasons: ClassVar = ("failed",)
    words: ClassVar[list[str]]
    letters: ClassVar[str]

    def run(self, cell: Any) -> Iterator[None]:
        letter = ""
        try:
            for letter in self.words.pop(0) if len(self.words) > 1 else self.words[0]:
                type(self).letters += letter
                if letter == "R":
                    yield
            if letter == "F":
                raise self.failure("failed", "the script says so")
        finally:
            type(self).letters += "H" if letter == "R" else ""


SKILLS = {
    name: type(name, (ScriptedSkill,), {"__doc__": ".", "is_condition": name == "C", "senses": name != "C"})
    for name in "ABCD"
}


@pytest.mark.parametrize(
    ("tree", "scripts", "expected"),
    [
        ("[C, A, {succeed: B}, {invert: D}]", {"C": "S F", "A": "RS", "B": "F", "D": "F"},
         {"root": "R S F", "C": "S - F", "A": "R S -", "B": "- F -", "D": "- F -"}),
        ("{sequence: {memory: false, do: [C, A]}}", {"C": "S F", "A": "RR"}, {"root": "R F", "A": "R H"}),
        ("{guard: {holds: C, do: A}}", {"C": "S F", "A": "RR"}, {"root": "R F", "A": "R H"}),
        ("{fallback: [C, A, B]}", {"C": "F S", "A": "RF"}, {"root": "R S", "C": "F -", "B": "- S"}),
        ("{fallback: {memory: false, do: [C, A]}}", {"C": "F S", "A": "RR"}, {"root": "R S", "A": "R H"}),
        ("{parallel: [A, B]}", {"A": "RF", "B": "RRS"}, {"root": "R R F", "A": "R F -", "B": "R R S"}),
        ("{parallel: {halt: true, do: [A, B]}}", {"A": "RF", "B": "RRR"}, {"root": "R F", "B": "R RH"}),
        ("{parallel: {wait_for: any, do: [A, B]}}", {"A": "RRS", "B": "RF"}, {"root": "R R S", "B": "R F -"}),
        ("{parallel: {wait_for: 2, halt: true, do: [C, A, B]}}", {"A": "RS", "B": "RRR"},
         {"root": "R S", "C": "S -", "A": "R S", "B": "R RH"}),
        ("{timeout: {seconds: 0.1, do: A}}", {"A": "RRR"}, {"root": "R F", "A": "R RH"}),
        ("{retry: {attempts: 3, do: A}}", {"A": "F F F S"}, {"root": "R R F S", "A": "F F F S"}),
        ("{repeat: {times: 3, do: A}}", {"A": "RS RS RS RF"}, {"root": "R R R S R F", "A": "R SR SR S R F"}),
        ("{try: A, catch: {on: A.failed, do: {invert: B}}, finally: D}", {"A": "F RS", "B": "RS"},
         {"root": "R F R S", "A": "F - R S", "B": "R S - -", "D": "- S - S"}),
    ],
)  # fmt: skip
def test_a_node_behaves_as_its_counterpart(tree: str, scripts: Any, expected: Any, tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(f"mission: m\ncell: cells/overhead.yaml\ntree: {tree}\n")
    for name, skill in SKILLS.items():
        skill.words = scripts.get(name, "S").split()
        skill.letters = ""
    cell: Any = SimpleNamespace(clock=Clock(), ledger=None)
    builder = TreeBuilder(SKILLS, cell, Blackboard(), discard_event, {}, load_control_nodes())
    body: Any = load_mission(path, SKILLS).tree
    root = builder.build_node(body)
    statuses: dict[str, list[str]] = {name: [] for name in ("root", *SKILLS)}
    for _ in expected["root"].split():
        root.tick_once()
        statuses["root"].append(root.status.value[0])
        for name, skill in SKILLS.items():
            statuses[name].append(skill.letters or "-")
            skill.letters = ""
        cell.clock.now += 0.1
    root.stop(Status.INVALID)
    assert {name: " ".join(statuses[name]) for name in expected} == expected
