"""Whatever a mission does when it runs, the checker has foreseen: random trees, random outcomes."""

from __future__ import annotations

import json
import random
from typing import Any, ClassVar, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from executive.cell.protocols import Cell, Steps
from executive.events import discard_event
from executive.mission.analysis import CheckContext, find_unhandled_failures
from executive.mission.expand import assign_paths, expand
from executive.mission.load import TreeBuilder, run_checks
from executive.mission.mission_file import parse_mission
from executive.mission.node_parser import NodeParser
from executive.skill import ANY, EMPTY, HOLDING, In, Out, Skill, port
from executive.text.findings import Source
from executive.text.yaml_files import parse_yaml
from executive.tree.blackboard import Blackboard
from executive.tree.node import load_control_nodes
from executive.tree.tree_node import halt

MOST_TICKS = 400

Tree = Any


class World:
    """What the skills act on: a die, a clock and a tool."""

    def __init__(self, seed: int) -> None:
        self.dice = random.Random(seed)
        self.ticks = 0
        self.holding = False
        self.clock, self.ledger = self, None

    @property
    def now(self) -> float:
        """The time: every tick takes a second."""
        return float(self.ticks)

    def sleep(self, duration: float) -> Steps:
        """Wait."""
        end = self.now + duration
        while self.now < end:
            yield


class Chance(Skill):
    """Take some ticks, then do what the dice say."""

    def end(self, world: World) -> None:
        """Do what success does."""

    def run(self, cell: Any) -> Any:
        for _ in range(cell.dice.randrange(3)):
            yield
        if self.reasons and cell.dice.random() < 0.4:
            raise self.failure(cell.dice.choice(self.reasons), "the dice say so")
        self.end(cell)


class Look(Chance):
    """See."""

    seen: Out[int] = port(doc="a value")
    senses: ClassVar = True
    reasons: ClassVar = ("dark", "lost")

    def end(self, world: World) -> None:
        self.seen = 1


class Choose(Chance):
    """Think."""

    seen: In[int] = port(doc="a value")
    other: In[int | None] = port(default=None, doc="a value")
    chosen: Out[int] = port(doc="a value")
    reasons: ClassVar = ("none",)

    def end(self, world: World) -> None:
        self.chosen = 2


class Take(Chance):
    """PossibleToolState."""

    chosen: In[int] = port(doc="a value")
    reasons: ClassVar = ("missed",)
    tool_state: ClassVar = (EMPTY, HOLDING)

    def end(self, world: World) -> None:
        assert not world.holding, "the checker lets a full tool be filled"
        world.holding = True


class Carry(Chance):
    """Move what is held."""

    reasons: ClassVar = ("blocked", "dropped")
    tool_state: ClassVar = (HOLDING, HOLDING)
    tool_state_after_failure: ClassVar = {"dropped": EMPTY, "halt": ANY}
    uses: ClassVar = ("arm",)
    moves: ClassVar = True

    def run(self, cell: Any) -> Any:
        assert cell.holding, "the checker lets an empty tool be carried"
        for _ in range(cell.dice.randrange(3)):
            yield
        chance = cell.dice.random()
        if chance < 0.2:
            cell.holding = False
            raise self.failure("dropped", "the dice say so")
        if chance < 0.4:
            raise self.failure("blocked", "the dice say so")


class Put(Chance):
    """Let go."""

    reasons: ClassVar = ("stuck",)
    tool_state: ClassVar = (HOLDING, EMPTY)

    def end(self, world: World) -> None:
        assert world.holding, "the checker lets an empty tool be emptied"
        world.holding = False


class Pause(Chance):
    """Do nothing for a while; it cannot fail."""


class Holds(Skill):
    """Ask the tool."""

    is_condition: ClassVar = True
    reasons: ClassVar = ("empty",)
    tool_state: ClassVar = (ANY, HOLDING)
    tool_state_after_failure: ClassVar = {"empty": ANY}

    def run(self, cell: Any) -> None:
        if not cell.holding:
            raise self.failure("empty", "the tool says so")


class Coin(Skill):
    """Toss a coin."""

    is_condition: ClassVar = True
    reasons: ClassVar = ("tails",)

    def run(self, cell: Any) -> None:
        if cell.dice.random() < 0.2:
            raise self.failure("tails", "the coin says so")


SKILLS: dict[str, type[Skill]] = {
    skill.__name__: skill for skill in (Look, Choose, Take, Carry, Put, Pause, Holds, Coin)
}
REASONS = [f"{name}.{reason}" for name, skill in SKILLS.items() for reason in skill.reasons]
REASONS += ["timeout.timeout", "invert.inverted", "guard.broken", "not.inverted"]

reasons = st.lists(st.sampled_from(REASONS), min_size=1, max_size=3, unique=True)
leaves = st.sampled_from(
    [*SKILLS, "succeed", {"Choose": {"other": "$element"}}, {"Choose": {"seen": "$chosen"}}]
)
routine = st.just(
    ["Look", "Choose", "Take", {"try": ["Carry", "Put"], "catch": [{"on": ["Carry.blocked"], "do": "Put"}]}]
)


def combined(condition: st.SearchStrategy[Tree]) -> st.SearchStrategy[Tree]:
    lists = st.lists(condition, min_size=1, max_size=3)
    return st.one_of(
        st.builds(lambda nodes: {"all": nodes}, lists),
        st.builds(lambda nodes: {"any": nodes}, lists),
        st.builds(lambda node: {"not": node}, condition),
    )


conditions = st.recursive(st.sampled_from(["Holds", "Coin"]), combined, max_leaves=3)


def bodies(node: st.SearchStrategy[Tree]) -> st.SearchStrategy[Tree]:
    lists = st.lists(node, min_size=1, max_size=4)
    catches = st.lists(st.fixed_dictionaries({"on": reasons, "do": node}), min_size=1, max_size=2)
    return st.one_of(
        lists,
        st.builds(lambda nodes: {"sequence": nodes}, lists),
        st.builds(lambda nodes: {"fallback": nodes}, lists),
        st.builds(
            lambda word, checks, node: {word: {"memory": False, "do": [*checks, node]}},
            st.sampled_from(["sequence", "fallback"]), st.lists(conditions, max_size=2), node,
        ),
        st.builds(
            lambda nodes, wait, halts: {"parallel": {"do": nodes, "wait_for": wait, "halt": halts}},
            lists, st.sampled_from(["all", "any", "lead"]), st.booleans(),
        ),
        st.builds(
            lambda n, on, recover, do: {"retry": {"attempts": n, **on, **recover, "do": do}},
            st.integers(1, 3),
            st.one_of(st.just({}), st.builds(lambda on: {"on": on}, reasons)),
            st.one_of(st.just({}), st.builds(lambda node: {"recover": node}, node)),
            node,
        ),
        st.builds(
            lambda n, until, do: {"repeat": {"times": n, "until": until, "do": do}},
            st.integers(0, 3), reasons, node,
        ),
        st.builds(lambda n, do: {"repeat": {"times": n, "do": do}}, st.integers(0, 3), node),
        st.builds(lambda until, do: {"repeat": {"until": until, "do": do}}, reasons, node),
        st.builds(
            lambda until, limit, do: {"repeat": {"until": [*until, {"elapsed": limit}], "do": do}},
            reasons, st.floats(0.1, 9), node,
        ),
        st.builds(lambda condition, do: {"while": {"condition": condition, "do": do}}, node, node),
        st.builds(
            lambda n, do: {"for_each": {"each": "element", "in": list(range(n)), "do": do}},
            st.integers(0, 3), node,
        ),
        st.builds(lambda do, catch: {"try": do, "catch": catch}, node, catches),
        st.builds(lambda do, catch, end: {"try": do, "catch": catch, "finally": end}, node, catches, node),
        st.builds(lambda do, end: {"try": do, "finally": end}, node, node),
        st.builds(lambda s, do: {"timeout": {"seconds": s, "do": do}}, st.integers(1, 5), node),
        st.builds(lambda holds, do: {"guard": {"holds": holds, "do": do}}, conditions, node),
        conditions,
        st.builds(lambda do: {"invert": do}, node),
        st.builds(lambda do: {"succeed": do}, node),
    )  # fmt: skip


trees = st.recursive(st.one_of(leaves, routine), bodies, max_leaves=14)


def sound(tree: Tree) -> CheckContext | None:
    """Return the mission of this tree if the checker finds no error in it."""
    source = Source("m.yaml", json.dumps({"mission": "m", "cell": "none", "tree": tree}))
    root, wrong = parse_yaml(source)
    assert root is not None
    parser = NodeParser([], SKILLS, load_control_nodes())
    mission, malformed = parse_mission(root, {}, parser), parser.findings
    expanded = expand(mission, SKILLS, {})
    assert expanded.tree is not None
    case = CheckContext(mission, assign_paths(expanded.tree), (), SKILLS, load_control_nodes(), None, {})
    findings = [*wrong, *malformed, *expanded.findings, *run_checks(case)]
    return None if any(finding.severity == "error" for finding in findings) else case


def run(case: CheckContext, seed: int) -> tuple[World, Any]:
    """Run a mission until it ends or for long enough; return its world and its root."""
    world = World(seed)
    root = TreeBuilder(SKILLS, cast("Cell", world), Blackboard(), discard_event, {}).build_node(case.tree)
    while world.ticks < MOST_TICKS:
        root.tick_once()
        if root.status is not Status.RUNNING:
            break
        world.ticks += 1
    return world, root


@pytest.mark.slow
@settings(max_examples=1000)
@given(tree=trees, seed=st.integers(0, 2**31))
def test_what_happens_was_foreseen(tree: Tree, seed: int) -> None:
    case = sound(tree)
    if case is None:
        return
    flow = case.flow_analysis
    for number in range(8):
        world, root = run(case, seed + number)
        if root.status is Status.RUNNING:
            assert halt(root) == []
            continue
        if root.status is Status.SUCCESS:
            state = flow.root_flow.success
            assert state is not None, "the checker says that this cannot succeed"
        else:
            failure = root.failure
            ends = {(f.source, f.reason, f.path): after for f, after in flow.root_flow.failures.items()}
            key = failure.source, failure.reason, failure.path
            assert key in ends, f"the checker has not foreseen {key}"
            assert str(failure) in [
                f"{ending.source}.{ending.reason}" for ending in find_unhandled_failures(flow)
            ]
            state = ends[key]
        assert state.find_tool_state(HOLDING if world.holding else EMPTY), (
            "the checker thinks the tool otherwise"
        )
