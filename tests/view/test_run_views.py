"""What a person watches while a mission runs."""

from __future__ import annotations

import io
from dataclasses import replace
from types import SimpleNamespace

import py_trees
import pytest
from events import at, item_changed, run_started, skill_started
from py_trees.behaviour import Behaviour
from rich.console import Console

from executive.events import BranchChosen, NodeEnded, NodeStarted, TimedEvent
from executive.record.result import Result
from executive.run.operator import RunControl
from executive.view.terminal import LineView, TerminalView, format_repeat_command, format_summary

GRASP = "tree/sort/repeat/Grasp"


def node(name: str, path: str, *children: Behaviour, detail: str = "") -> Behaviour:
    """Return a node as the executive builds them: named, with a path and some words about it."""
    made = py_trees.composites.Sequence(name, memory=True, children=list(children))
    made.path, made.detail = path, detail
    return made


REPEAT = node("repeat", "tree/sort/repeat", node("Detect", "tree/sort/repeat/Detect"), node("Grasp", GRASP))
TREE = node("sort", "tree/sort", REPEAT, node("Release", "tree/sort/Release", detail="slot: 1"))
RUN = SimpleNamespace(root=TREE, control=RunControl())


def item(state: str, item: str = "cube-1", **fields) -> TimedEvent:
    return at(9, item_changed(item, state, position=[0.5, 0.1, 0.0], **fields), 1.5)


def started(node: str, item: str = "", clock: float = 1.0) -> TimedEvent:
    return at(1, skill_started(node, item) if node == GRASP else NodeStarted(node), clock)


def failed(node: str, clock: float = 1.0, **fields) -> TimedEvent:
    return at(1, NodeEnded(node, "FAILURE", "Grasp" if node == GRASP else "", **fields), clock)


MISSED = {"item": "cube-1", "reason": "missed", "message": "no seal 0.1 s after contact"}
AGAIN = BranchChosen("tree/sort/repeat", "attempt 2 of 3", "Grasp.missed")


@pytest.mark.parametrize(
    ("events", "shown"),
    [
        ([started(GRASP, "cube-1"), failed(GRASP, 1.1, **MISSED)],
         ["     1.00 s  Grasp [cube-1] ...",
          "     1.10 s  Grasp [cube-1] failed: missed: no seal 0.1 s after contact"]),
        ([started("tree/sort/repeat"), at(1, AGAIN, 2.0), failed("tree/sort/repeat", reason="Grasp.missed")],
         ["     2.00 s  repeat: attempt 2 of 3, after Grasp.missed"]),
        ([item("seen"), item("seen", looks=2), item("placed", bin="red_bin")],
         ["     1.50 s  cube-1 seen", "     1.50 s  cube-1 placed in red_bin"]),
    ],
    ids=["a line where a skill starts and one where it ends", "control nodes only where they decide",
         "items where their state changes"],
)  # fmt: skip
def test_there_is_a_line_for_all_that_is_news(events, shown):
    stream = io.StringIO()
    view = LineView(stream)
    view.open(RUN)
    for event in events:
        view(event)
    assert stream.getvalue().splitlines() == shown


def page(view: TerminalView) -> str:
    """Return what a screen shows."""
    console = Console(file=io.StringIO(), width=100)
    console.print(view.render())
    return console.file.getvalue()


def test_the_live_view_shows_the_running_path_the_items_and_the_clock():
    view = TerminalView(Console(file=io.StringIO(), force_terminal=True, width=100, color_system=None))
    view.open(RUN)
    for event in (
        at(0, run_started(mission="sort", seed=7)), started("tree/sort"), started("tree/sort/repeat"),
        started(GRASP), failed(GRASP, reason="missed"),
        item("placed", bin="red_bin"),
    ):  # fmt: skip
        view(event)
    shown = page(view)
    view.close()
    for what in ("sort  seed 7  1.5 s", "▶ repeat", "✗ Grasp  missed", "cube-1", "placed", "red_bin"):
        assert what in shown


RESULT = Result(
    mission="sort", seed=7, status="FAILURE", reason="Transit.dropped", message="lost at 1.2 m/s",
    node="sort/0/3", robot_time_s=34.25, wall_time_s=6.84, run="runs/latest",
)  # fmt: skip


def test_the_summary_says_how_it_ended_how_long_it_took_and_how_to_repeat_it_in_a_shell():
    items = [
        item_changed("cube-1", "placed", bin="red_bin"), item_changed("cube-2", "placed", bin="red_bin"),
        item_changed("duck-1", "rejected", position=[0.5, 0.1, 0.0], reason="three misses"),
    ]  # fmt: skip
    repeat = format_repeat_command("my mission.yaml", 7, {"attempts": "a b"}, ["cube"])
    lines = [
        "FAILURE Transit.dropped at sort/0/3: lost at 1.2 m/s",
        "34.2 s on the robot's clock, 6.8 s by the wall clock",
        "runs/latest  (repeat: executive run 'my mission.yaml' --seed 7 --set 'attempts=a b' --request cube)",
        "  red_bin: cube-1, cube-2",
        "  rejected: duck-1 (x 0.50 m, y 0.10 m: three misses)",
    ]
    assert format_summary(RESULT, items, repeat).splitlines() == lines
    result = replace(RESULT, status="SUCCESS", reason="", node="", message="")
    shown = format_summary(result, [], repeat, "runs/x/report.html").splitlines()
    assert shown == ["SUCCESS", *lines[1:3], "report: runs/x/report.html"]
