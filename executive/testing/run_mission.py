"""Execution of a whole mission in a test."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from executive.cell.cell_wrapper import innermost
from executive.cell.workcell import Accounts, Workcell
from executive.cells.fake.cell import FakeCell
from executive.errors import InputError
from executive.events import FaultInjected, NodeEnded, NodeStarted, Observer, RunEnded, TimedEvent
from executive.mission.load import load_mission
from executive.plugins import discover
from executive.record.result import agrees
from executive.run.assembly import RunOptions, assemble
from executive.run.run import Run
from executive.skill import Skill
from executive.testing.faults.faulty_cell import FaultyCell, with_faults
from executive.testing.faults.script import ScheduledFault
from executive.tree.skill_leaf import SkillLeaf

TIMEOUT = 600.0
"""Time on the run's clock after which a mission counts as endless [s]."""


@dataclass(frozen=True)
class MissionResult(RunEnded):
    """End and record of a mission.

    Attributes:
        events: All events of the run, in order.
        items: Counts of the items by final state; see `Accounts.count_states`.
        accounts: The ledger, with the final state of each item.
        audit: True final counts of the objects, or None if they are unknown.
        cell: The innermost cell of the run, closed.
    """

    events: Sequence[TimedEvent]
    items: Mapping[str, int]
    accounts: Accounts
    audit: Mapping[str, int] | None
    cell: Any

    @property
    def agrees(self) -> bool:
        """True if the ledger and the audit agree, or there is no audit."""
        return self.audit is None or agrees(self.items, self.audit, self.empty)

    def find_activations(self, pattern: str) -> list[str]:
        """Return the path of each activated node whose path matches a pattern, in order."""
        started = (timed.event.node for timed in self.events if isinstance(timed.event, NodeStarted))
        return [node for node in started if fnmatchcase(node, pattern)]

    def find_reasons(self, pattern: str = "*") -> list[str]:
        """Return the reason of each failure of a skill whose node's path matches a pattern, in order."""
        ended = (timed.event for timed in self.events if isinstance(timed.event, NodeEnded))
        failures = (event for event in ended if event.skill and event.status == "FAILURE")
        return [event.reason for event in failures if fnmatchcase(event.node, pattern)]

    def find_faults(self) -> list[FaultInjected]:
        """Return the injected faults, in order."""
        return [timed.event for timed in self.events if isinstance(timed.event, FaultInjected)]


def run_mission(
    mission: str | Path,
    kind: Callable[..., Workcell] = FakeCell,
    *,
    seed: int = 0,
    set: Mapping[str, str] | None = None,
    requests: Sequence[str] = (),
    substitutes: Mapping[str, type[Skill]] | None = None,
    faults: Sequence[ScheduledFault] = (),
    arrange: Callable[[Any], object] | None = None,
    observers: Sequence[Observer] = (),
    timeout: float = TIMEOUT,
) -> MissionResult:
    """Run a mission to its end, close the cell and return the result.

    Args:
        mission: A mission file, or the name of a shipped mission.
        kind: Makes the work cell, instead of the kind in the mission's cell file.
        seed: Random seed.
        set: Values of params by name, and of keys of the cell file as `cell.<key>.<key>`.
        requests: Requests of the operator, in order.
        substitutes: Skills that replace those of nodes, by a pattern of the node's path.
        faults: Faults of the cell, and their times.
        arrange: Called with the cell before the run, to put objects on its table.
        observers: Called with each event.
        timeout: Time on the run's clock after which the run ends as a fault [s].

    Raises:
        MissionError: The mission is wrong.
        InputError: The mission does not exist, or a pattern matches no node, or a node with another skill
            than that of the substitute.
    """
    skills = discover()
    loaded = load_mission(mission, skills, set)
    events: list[TimedEvent] = []

    def make_arranged_cell(*args: Any, **options: Any) -> Workcell:
        workcell = kind(*args, **options)
        try:
            if arrange is not None:
                arrange(workcell)
        except BaseException:
            workcell.close()
            raise
        return workcell

    make_cell = with_faults(make_arranged_cell, faults, timeout=timeout)
    options = RunOptions(seed, requests, kind=make_cell, substitutes=substitutes or {})
    run = assemble(loaded, skills, options, [events.append, *observers])
    workcell = run.workcell
    assert isinstance(workcell, FaultyCell)
    try:
        workcell.check_patterns([getattr(node, "path", node.name) for node in run.root.iterate()])
        _require_matching_substitutes(run, skills)
        run.add_observer(workcell.on_event)
        outcome = run.execute()
        return MissionResult(
            **asdict(outcome),
            events=events,
            items=run.count_items(),
            accounts=workcell.accounts,
            audit=run.count_ground_truth(),
            cell=innermost(workcell),
        )
    finally:
        run.close()


def _require_matching_substitutes(run: Run, skills: Mapping[str, type[Skill]]) -> None:
    """Return if each node runs its own skill or a subclass of it."""
    for node in run.root.iterate():
        if isinstance(node, SkillLeaf) and not issubclass(node.skill_type, skills[node.skill_name]):
            raise InputError(
                f"{node.path} runs {node.skill_name}, and {node.skill_type.__name__} is not a subclass; "
                "give the substitute a pattern that matches only nodes of its own skill"
            )
