"""Tests of BehaviorTree.CPP, restated as missions: same statuses at every tick, or a reasoned difference."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest
from btcpp_cases import CASES, NOT_RESTATED, Case
from hand_set_clock import Clock
from py_trees.common import Status

from executive.events import discard_event
from executive.mission.build import TreeBuilder
from executive.mission.load import load_mission
from executive.mission.model.nodes import InnerNode, Node
from executive.skill import Skill
from executive.tree.blackboard import Blackboard
from executive.tree.node_registry import load_control_nodes
from executive.tree.tree_node import TreeNode

NODE_CLASSES = load_control_nodes()
TICK_PERIOD = 0.1
"""Time between two ticks [s]."""


class ScriptedSkill(Skill):
    """Follow a script; report each status.

    Attributes:
        words: Remaining words of the script, one word per activation; the last word is used again.
        letters: Letters of the current tick.
    """

    reasons: ClassVar = ("failed",)
    words: ClassVar[list[str]]
    letters: ClassVar[str]

    def run(self, cell: Any) -> Iterator[None]:
        """Succeed or fail after as many ticks as the word has letters."""
        word = self.words.pop(0) if len(self.words) > 1 else self.words[0]
        is_running = False
        try:
            for letter in word:
                type(self).letters += letter
                is_running = letter == "R"
                if is_running:
                    yield
                elif letter == "F":
                    raise self.failure("failed", "the script says so")
        finally:
            if is_running:
                type(self).letters += "H"


def make_skill(name: str) -> type[ScriptedSkill]:
    is_condition = name[0] in "CT"
    attributes = {"is_condition": is_condition, "senses": not is_condition}
    return type(name, (ScriptedSkill,), {"__doc__": "Follow a script.", **attributes})


SKILLS = {
    name: make_skill(name) for letter in "ABCDEFGT" for name in (letter, *(f"{letter}{n}" for n in (1, 2, 3)))
}


@pytest.fixture(scope="module")
def trees(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Node]:
    """Return the checked tree of each case by name; one mission contains all trees, side by side."""
    path: Path = tmp_path_factory.mktemp("cases") / "cases.yaml"
    branches = "\n".join(f"    - {case.tree}" for case in CASES)
    path.write_text(f"mission: cases\ncell: cells/overhead.yaml\ntree:\n  parallel:\n{branches}\n")
    mission = load_mission(path, SKILLS)
    assert isinstance(mission.tree, InnerNode)
    return {case.name: tree for case, tree in zip(CASES, mission.tree.children, strict=True)}


def run_ticks(case: Case, tree: Node, ticks: list[str]) -> dict[str, str]:
    """Return the letters of each node at each tick."""
    clock = Clock()
    cell: Any = SimpleNamespace(clock=clock, ledger=None)
    for name, skill in SKILLS.items():
        skill.words, skill.letters = case.scripts.get(name, "S").split(), ""
    builder = TreeBuilder(SKILLS, cell, Blackboard(), discard_event, {}, NODE_CLASSES)
    root: TreeNode = builder.build_node(tree)
    statuses: dict[str, list[str]] = defaultdict(list)
    for tick in ticks:
        if tick == "H":
            root.stop(Status.INVALID)
            statuses["root"].append("H")
        else:
            root.tick_once()
            statuses["root"].append(root.status.value[0])
        for name, skill in SKILLS.items():
            statuses[name].append(skill.letters or "-")
            skill.letters = ""
        clock.now += TICK_PERIOD
    root.stop(Status.INVALID)
    return {name: " ".join(letters) for name, letters in statuses.items()}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_test_of_behavior_tree_cpp_gives_the_same_statuses(case: Case, trees: Mapping[str, Node]) -> None:
    expected = {**case.expected, **case.different}
    statuses = run_ticks(case, trees[case.name], expected["root"].split())
    assert {name: statuses[name] for name in expected} == expected


def test_every_difference_is_real_and_has_a_reason() -> None:
    for case in CASES:
        assert bool(case.reason) == bool(case.different), case.name
        assert all(case.expected[name] != letters for name, letters in case.different.items()), case.name


def test_no_test_is_restated_twice_and_at_least_60_are_restated() -> None:
    names = {case.name.partition(",")[0] for case in CASES}
    assert len(names) >= 60
    assert not names & set(NOT_RESTATED)
