"""From a loaded mission to a running tree."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from py_trees.common import Status

from executive.control.scope import Scope
from executive.events import ignore
from executive.mission.build import build
from executive.mission.load import LoadedMission
from executive.mission.outline import outline
from executive.mission.text.files import shipped_folder
from executive.skill import Skill

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
    def built(text: str, scope: Scope | None = None, emit: Any = ignore) -> Any:
        clock = SimpleNamespace(now=0.0)
        cell: Any = SimpleNamespace(clock=clock)
        return build(load(text), skills, cell, Scope() if scope is None else scope, emit)

    return built


def test_paths_are_readable_and_unique(built: Any) -> None:
    paths = [node.path for node in outline(built(EVERYTHING))]
    assert paths == [
        "tree/repeat",
        "tree/repeat/do",
        "tree/repeat/do/look/Look",
        "tree/repeat/do/2:try",
        "tree/repeat/do/2:try/retry",
        "tree/repeat/do/2:try/retry/recover/look/Look",
        "tree/repeat/do/2:try/retry/do",
        "tree/repeat/do/2:try/retry/do/Pick",
        "tree/repeat/do/2:try/retry/do/Drop",
        "tree/repeat/do/2:try/catch/1",
        "tree/repeat/do/2:try/catch/1/1:succeed",
        "tree/repeat/do/2:try/catch/1/2:invert",
        "tree/repeat/do/2:try/catch/1/2:invert/do/fallback",
        "tree/repeat/do/2:try/catch/1/2:invert/do/fallback/1:succeed",
        "tree/repeat/do/2:try/catch/1/2:invert/do/fallback/Look",
        "tree/repeat/do/2:try/finally/timeout",
        "tree/repeat/do/2:try/finally/timeout/do/Look",
        "tree/repeat/do/last_look",
        "tree/repeat/do/pair",
        "tree/repeat/do/pair/1:Look",
        "tree/repeat/do/pair/2:Look",
    ]


def test_the_outline_reads_like_the_mission(built: Any) -> None:
    lines = [
        "  " * node.depth + node.name + (f" ({node.detail})" if node.detail else "")
        for node in outline(built(EVERYTHING))
    ]
    assert lines == [
        "repeat (2 times)",
        "  do",
        "    look: Look (view: table)",
        "    try",
        "      retry (up to 2 attempts, on Pick.missed)",
        "        recover look: Look (view: full)",
        "        do",
        "          Pick",
        "          Drop (bin: red_bin)",
        "      catch 1",
        "        succeed",
        "        invert",
        "          do: fallback",
        "            succeed",
        "            Look",
        "      finally: timeout (5 s)",
        "        do: Look",
        "    last_look (Look, seen: $other)",
        "    pair (sequence)",
        "      Look",
        "      Look",
    ]


def test_a_built_tree_runs_and_moves_values_along(built: Any) -> None:
    scope = Scope()
    events: list[dict[str, Any]] = []
    root = built(
        HEAD + "tree: [Look, {Pick: {held: $thing}}, {Drop: {held: $thing, bin: red_bin}}]\n",
        scope,
        lambda kind, **data: events.append(data),
    )
    for _ in range(4):
        root.tick_once()
    assert root.status is Status.SUCCESS
    assert dict(scope) == {"seen": [1], "thing": "thing"}
    assert [event["node"] for event in events if event["status"] == "SUCCESS"] == [
        "tree/Look", "tree/Pick", "tree/Drop", "tree",
    ]  # fmt: skip


def test_two_trees_of_one_mission_share_nothing(
    load: Callable[..., LoadedMission], skills: dict[str, type[Skill]]
) -> None:
    loaded = load(HEAD + "tree: Look\n")
    first, second = Scope(), Scope()
    cell: Any = SimpleNamespace()
    one, two = (build(loaded, skills, cell, scope, ignore) for scope in (first, second))
    one.tick_once()
    one.tick_once()
    assert (dict(first), dict(second)) == ({"seen": [1]}, {})
    assert two.status is Status.INVALID


def test_a_labelled_use_names_its_failures(built: Any) -> None:
    root = built(
        HEAD
        + "tree:\n  try: [{use: pick, as: first}]\n  catch:\n    - {on: [first.missed], do: succeed}\n"
        + "trees: {pick: [Look, Pick]}\n"
    )
    assert [node.path for node in outline(root)] == [
        "tree/try", "tree/try/do", "tree/try/do/first", "tree/try/do/first/do",
        "tree/try/do/first/do/Look", "tree/try/do/first/do/Pick", "tree/try/catch/1/succeed",
    ]  # fmt: skip


@pytest.mark.parametrize("name", sorted(path.stem for path in shipped_folder().glob("*.yaml")))
def test_shipped_missions_load_and_build(name: str) -> None:
    from executive.discovery import discover
    from executive.mission.load import load_mission

    installed = discover()
    if not installed:
        pytest.skip("the project is not installed, so it has no entry points")
    loaded = load_mission(name, installed)
    assert loaded.warnings == ()
    cell: Any = SimpleNamespace(clock=SimpleNamespace(now=0.0))
    paths = [node.path for node in outline(build(loaded, installed, cell, Scope(), ignore))]
    assert len(paths) == len(set(paths))
