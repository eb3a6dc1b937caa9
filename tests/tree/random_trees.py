"""Random trees of every control node over scripted leaves, for properties that hold for all trees."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from build_nodes import (
    fallback,
    for_each,
    invert,
    lead,
    make_backoff,
    make_site,
    parallel,
    repeat,
    retry,
    sequence,
    succeed,
    timeout,
    try_catch,
    while_loop,
)
from hand_set_clock import Clock
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from scripted_leaf import Leaf

from executive.events import BranchChosen, Event, NodeEnded, NodeStarted
from executive.tree.blackboard import Blackboard
from executive.tree.tree_node import NodeContext


@dataclass(frozen=True)
class Plan:
    """What a tree looks like; any number of equal trees can be built from it."""

    word: str
    options: tuple[Any, ...] = ()
    children: tuple[Plan, ...] = ()
    label: str = ""


@dataclass
class World:
    """What one tree runs in, and everything its nodes said, one text each."""

    clock: Clock = field(default_factory=Clock)
    scope: Blackboard = field(default_factory=Blackboard)
    log: list[str] = field(default_factory=list)

    def emit(self, event: Event) -> None:
        match event:
            case NodeStarted(node):
                self.log.append(f"{node} starts")
            case NodeEnded(node, status):
                self.log.append(f"{node} {status.replace('INVALID', 'halted')} {event.reason}".rstrip())
            case BranchChosen(node, choice, reason):
                self.log.append(f"{node} {choice} {reason}".rstrip())


def grow(plan: Plan, world: World, path: str = "root") -> Behaviour:
    """Return a fresh tree as planned; a node's path says where it stands."""
    children = [grow(child, world, f"{path}/{index}") for index, child in enumerate(plan.children)]
    if plan.word == "leaf":
        scripts, breaks = plan.options
        leaf = Leaf(path, scripts, world.log)
        leaf.breaks = breaks
        return leaf
    return _NODES[plan.word](make_site(path, plan.label, world.emit), children, plan.options, world)


def run(root: Behaviour, world: World, ticks: int) -> Iterator[str]:
    """Tick until the tree ends or breaks, at most `ticks` times; yield each status, or what broke."""
    for _ in range(ticks):
        try:
            root.tick_once()
        except Exception as error:
            yield f"{type(error).__name__}: {error}"
            return
        yield root.status.value
        if root.status is not Status.RUNNING:
            return
        world.clock.now += world.clock.step


def lives(plan: Plan, most: int) -> Iterator[tuple[Behaviour, World]]:
    """Yield equal trees ticked once, twice, and so on, as long as they run and at most `most` times."""
    for ticks in range(1, most + 1):
        world = World()
        root = grow(plan, world)
        said = list(run(root, world, ticks))
        yield root, world
        if said[-1] != "RUNNING":
            return


def bottom_up(node: Behaviour) -> Iterator[Behaviour]:
    """Yield every node, children before parents, in the order of the tree."""
    for child in node.children:
        yield from bottom_up(child)
    yield node


_Make = Callable[[NodeContext, list[Behaviour], tuple[Any, ...], World], Behaviour]

_NODES: Mapping[str, _Make] = {
    "sequence": lambda site, nodes, options, world: sequence(site, nodes),
    "fallback": lambda site, nodes, options, world: fallback(site, nodes),
    "parallel": lambda site, nodes, options, world: parallel(site, nodes, *options),
    "beside": lambda site, nodes, options, world: lead(site, nodes),
    "retry": lambda site, nodes, options, world: retry(
        site, nodes[0], *options[:2], (*nodes, None)[1], options[2], world.clock
    ),
    "repeat": lambda site, nodes, options, world: repeat(site, nodes[0], *options),
    "while": lambda site, nodes, options, world: while_loop(site, *nodes),
    "for_each": lambda site, nodes, options, world: for_each(
        site, nodes[0], world.scope, site.path, *options
    ),
    "try": lambda site, nodes, options, world: try_catch(
        site, nodes[0], [(options[0], nodes[1])], *nodes[2:]
    ),
    "timeout": lambda site, nodes, options, world: timeout(site, nodes[0], *options, world.clock),
    "invert": lambda site, nodes, options, world: invert(site, *nodes),
    "succeed": lambda site, nodes, options, world: succeed(site, *nodes),
}


def _planned(word: str, child: Any, fewest: int, most: int, *options: Any) -> Any:
    children = st.lists(child, min_size=fewest, max_size=most).map(tuple)
    return st.builds(Plan, st.just(word), st.tuples(*options), children, st.sampled_from(["", "x"]))


def _parallel(child: Any) -> Any:
    def counted(plan: Plan) -> Any:
        wait_for = st.none() | st.integers(1, len(plan.children))
        options = st.tuples(wait_for, st.booleans())
        return options.map(lambda chosen: Plan("parallel", chosen, plan.children, plan.label))

    return _planned("parallel", child, 2, 4).flatmap(counted)


def _above(child: Any) -> Any:
    some, one = st.sampled_from([(), (("x", "lost"),)]), st.just((("x", "lost"),))
    backoff = st.none() | st.builds(make_backoff, st.sampled_from([0.125, 0.25]), st.just(2.0), st.just(0.5))
    elements = st.lists(st.none() | st.integers(0, 3), max_size=3)
    return st.one_of(
        _planned("sequence", child, 0, 3),
        _planned("fallback", child, 1, 3),
        # More often than the others: only below it does more than one branch run.
        _planned("beside", child, 1, 3),
        _parallel(child),
        _parallel(child),
        _parallel(child),
        _planned("retry", child, 1, 2, st.integers(1, 3), some, backoff),
        _planned("repeat", child, 1, 1, st.none() | st.integers(0, 3), one),
        _planned("while", child, 2, 2),
        _planned("for_each", child, 1, 1, elements),
        _planned("try", child, 2, 3, one),
        _planned("timeout", child, 1, 1, st.sampled_from([0.125, 0.25, 0.5, 1.0])),
        _planned("invert", child, 1, 1),
        _planned("succeed", child, 0, 1),
    )


_SCRIPTS = st.builds(
    lambda waits, end: "R " * waits + end,
    st.sampled_from([0, 1, 1, 2, 3, 5]),
    st.sampled_from([*["S"] * 6, *["lost"] * 4, "stuck", "stuck", "!"]),
)

_LEAVES = st.builds(
    lambda scripts, breaks: Plan("leaf", (tuple(scripts), breaks)),
    st.lists(_SCRIPTS, min_size=1, max_size=3),
    st.booleans(),
)


def _trees(depth: int) -> Any:
    return _LEAVES if depth == 0 else _LEAVES | _above(_trees(depth - 1))


PLANS = _above(_trees(2))
"""Trees of up to four levels, where every control node stands above every other."""
