"""From a loaded mission to a running tree."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from py_trees.common import Status

from executive.events import Event, NodeEnded, discard_event
from executive.mission.load import LoadedMission, build_tree
from executive.mission.outline import make_outline
from executive.skill import Skill
from executive.tree.blackboard import Blackboard

HEAD = "mission: m\ncell: cells/small.yaml\n"

EVERYTHING = (
    HEAD
    + """
params: {tries: 2}
tree:
  repeat:
    times: 2
    do:
      - use: look
      - try:
          retry:
            attempts: $tries
            on: [Pick.missed]
            recover: {use: look, with: {view: full}}
            do: [Pick, {Drop: {bin: red_bin}}]
        catch:
          - on: [Pick.missed]
            do: [succeed, {invert: {fallback: [succeed, Look]}}]
        finally: {timeout: {seconds: 5, do: Look}}
      - {Look: {seen: $other}, as: last_look}
      - {sequence: [Look, Look], as: pair}
trees:
  look: {args: {view: table}, do: {Look: {view: $view}}}
"""
)


@pytest.fixture
def built(load: Callable[..., LoadedMission], skills: dict[str, type[Skill]]) -> Any:
    def built(text: str, scope: Blackboard | None = None, emit: Any = discard_event) -> Any:
        clock = SimpleNamespace(now=0.0)
        cell: Any = SimpleNamespace(clock=clock, ledger=None)
        return build_tree(load(text), cell, Blackboard() if scope is None else scope, emit)

    return built


def test_the_outline_reads_like_the_mission_and_paths_are_unique(built: Any) -> None:
    lines = [
        ("  " * node.depth + node.name + (f" ({node.detail})" if node.detail else ""), node.path)
        for node in make_outline(built(EVERYTHING))
    ]
    body, tried, caught = "tree/repeat/do", "tree/repeat/do/2:try", "tree/repeat/do/2:try/catch/1"
    assert lines == [
        ("repeat (2 times)", "tree/repeat"),
        ("  do", body),
        ("    look: Look (view: table)", f"{body}/look/Look"),
        ("    try", tried),
        ("      retry (up to 2 attempts, on Pick.missed)", f"{tried}/retry"),
        ("        recover look: Look (view: full)", f"{tried}/retry/recover/look/Look"),
        ("        do", f"{tried}/retry/do"),
        ("          Pick", f"{tried}/retry/do/Pick"),
        ("          Drop (bin: red_bin)", f"{tried}/retry/do/Drop"),
        ("      catch 1", caught),
        ("        succeed", f"{caught}/1:succeed"),
        ("        invert", f"{caught}/2:invert"),
        ("          do: fallback", f"{caught}/2:invert/do/fallback"),
        ("            succeed", f"{caught}/2:invert/do/fallback/1:succeed"),
        ("            Look", f"{caught}/2:invert/do/fallback/Look"),
        ("      finally: timeout (5 s)", f"{tried}/finally/timeout"),
        ("        do: Look", f"{tried}/finally/timeout/do/Look"),
        ("    last_look (Look, seen: $other)", f"{body}/last_look"),
        ("    pair (sequence)", f"{body}/pair"),
        ("      Look", f"{body}/pair/1:Look"),
        ("      Look", f"{body}/pair/2:Look"),
    ]


def test_a_built_tree_runs_and_moves_values_along(built: Any) -> None:
    scope = Blackboard()
    events: list[Event] = []
    root = built(
        HEAD + "tree: [Look, {Pick: {held: $thing}}, {Drop: {held: $thing, bin: red_bin}}]\n",
        scope,
        events.append,
    )
    for _ in range(4):
        root.tick_once()
    assert root.status is Status.SUCCESS
    assert dict(scope) == {"seen": [1], "thing": "thing"}
    assert [event.node for event in events if isinstance(event, NodeEnded) and event.status == "SUCCESS"] == [
        "tree/Look", "tree/Pick", "tree/Drop", "tree",
    ]  # fmt: skip
