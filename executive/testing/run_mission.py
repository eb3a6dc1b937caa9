"""Execution of a whole mission in a test."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from py_trees.visitors import VisitorBase

from executive.cell.workcell import Accounts, Workcell, find_innermost_cell
from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.events import FaultInjected, NodeEnded, NodeStarted, Observer, RunEnded, TimedEvent
from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.result import is_confirmed_by_audit
from executive.run.assembly import RunOptions, assemble
from executive.run.run import Run
from executive.skill import Skill
from executive.testing.faults import FaultyCell, ScheduledFault, with_faults
from executive.tree.tree_node import SkillLeaf

MISSION_TIMEOUT = 600.0
"""Default timeout of a run, on the run's clock [s]; after the timeout the run ends as a fault."""


@dataclass(frozen=True)
class MissionResult(RunEnded):
    """Result of a mission run: its `RunEnded` event, all events, and the final counts.

    Attributes:
        events: All events of the run, in order.
        items: Number of items of the ledger by final state; `seen` counts all items except phantoms.
        accounts: The ledger, with the final state of each item.
        audit: True number of objects by final place; None if the cell has no ground truth.
        cell: The closed cell of the run, without wrappers.
    """

    events: Sequence[TimedEvent]
    items: Mapping[str, int]
    accounts: Accounts
    audit: Mapping[str, int] | None
    cell: Any

    @property
    def agrees(self) -> bool:
        """True if the counts of ledger and audit agree, or there is no audit."""
        return self.audit is None or is_confirmed_by_audit(self.items, self.audit, self.is_table_empty)

    def list_activated_nodes(self, pattern: str) -> list[str]:
        """Return the paths of the activated nodes whose paths match the pattern, in order of activation."""
        paths = [timed.event.node for timed in self.events if isinstance(timed.event, NodeStarted)]
        return [path for path in paths if fnmatchcase(path, pattern)]

    def list_failure_reasons(self, pattern: str = "*") -> list[str]:
        """Return the failure reasons of the skills whose paths match the pattern, in order."""
        ends = [timed.event for timed in self.events if isinstance(timed.event, NodeEnded)]
        skill_failures = [end for end in ends if end.skill and end.status == "FAILURE"]
        return [end.reason for end in skill_failures if fnmatchcase(end.node, pattern)]

    def list_injected_faults(self) -> list[FaultInjected]:
        """Return the `FaultInjected` events, in order."""
        return [timed.event for timed in self.events if isinstance(timed.event, FaultInjected)]


def run_mission(
    mission: str | Path,
    make_cell: Callable[..., Workcell] = FakeCell,
    *,
    seed: int = 0,
    set: Mapping[str, str] | None = None,
    requests: Sequence[str] = (),
    substitutes: Mapping[str, type[Skill]] | None = None,
    faults: Sequence[ScheduledFault] = (),
    arrange: Callable[[Any], object] | None = None,
    observers: Sequence[Observer] = (),
    visitors: Sequence[VisitorBase] = (),
    timeout: float = MISSION_TIMEOUT,
) -> MissionResult:
    """Run a mission to its end, close the cell and return the result.

    Args:
        mission: Mission file, or name of a shipped mission.
        make_cell: Function that makes the work cell, instead of the kind in the cell file.
        seed: Random seed.
        set: Values of params by name, and of keys of the cell file by `cell.<key>.<key>`.
        requests: Requests of the operator, in order.
        substitutes: Replacement skills, by glob pattern of the node path.
        faults: Fault script of the cell.
        arrange: Function that changes the cell before the run, for instance puts objects on the table.
        observers: Functions that are called with each event.
        visitors: Visitors of py_trees, which see every ticked node after each tick.
        timeout: Timeout on the run's clock, after which the run ends as a fault [s].

    Raises:
        MissionError: The mission has errors.
        InputError: The mission does not exist, a pattern matches no node, or a substitute is no subclass of
            the skill that it replaces.
    """
    loaded = load_mission(mission, load_skills(), set)
    events: list[TimedEvent] = []
    make_faulty_cell = with_faults(make_cell, faults, timeout=timeout)
    options = RunOptions(seed, requests, make_cell=make_faulty_cell, substitutes=substitutes or {})
    run = assemble(loaded, options, [events.append, *observers])
    workcell = run.workcell
    assert isinstance(workcell, FaultyCell)
    try:
        if arrange is not None:
            arrange(workcell.inner)
        workcell.check_patterns([getattr(node, "path", node.name) for node in run.root.iterate()])
        _check_substitutes(run, loaded.skills)
        run.add_observer(workcell.on_event)
        for visitor in visitors:
            run.behaviour_tree.add_visitor(visitor)
        return MissionResult(
            **asdict(run.execute()),
            events=events,
            items=run.count_items(),
            accounts=workcell.accounts,
            audit=run.count_ground_truth(),
            cell=find_innermost_cell(workcell),
        )
    finally:
        run.close()


def _check_substitutes(run: Run, skills: Mapping[str, type[Skill]]) -> None:
    """Raise InputError if a node runs neither the skill of the mission nor a subclass of this skill."""
    for node in run.root.iterate():
        if isinstance(node, SkillLeaf) and not issubclass(node.skill_type, skills[node.skill_name]):
            raise InputError(
                f"{node.path} runs {node.skill_name}, but {node.skill_type.__name__} is not a subclass; "
                "give the substitute a pattern that matches only nodes of its skill"
            )
