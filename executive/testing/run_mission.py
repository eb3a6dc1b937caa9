"""Run a whole mission in a test, whatever goes wrong in it."""

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

LONGEST = 600.0
"""Time on its clock after which a mission that is not done counts as one that never ends [s]."""


@dataclass(frozen=True)
class MissionResult(RunEnded):
    """How a mission ended, and what is to be known of it.

    Attributes:
        events: Everything the run told its observers, in order.
        items: Counts of the items by final state; see `Accounts.count_states`.
        accounts: The ledger, with the final state of each item.
        audit: What really became of the objects, or None where nobody can know.
        cell: The cell it ran in, closed; without what was wrapped around it.
    """

    events: Sequence[TimedEvent]
    items: Mapping[str, int]
    accounts: Accounts
    audit: Mapping[str, int] | None
    cell: Any

    @property
    def agrees(self) -> bool:
        """True if what the ledger believes is what the audit found."""
        return self.audit is None or agrees(self.items, self.audit, self.empty)

    def entered(self, pattern: str) -> list[str]:
        """Return the path of every node that was activated and whose path fits a pattern, in order."""
        started = (one.event.node for one in self.events if isinstance(one.event, NodeStarted))
        return [node for node in started if fnmatchcase(node, pattern)]

    def reasons(self, pattern: str = "*") -> list[str]:
        """Return the reason of every failure of a skill whose node fits a pattern, in order."""
        ended = (one.event for one in self.events if isinstance(one.event, NodeEnded))
        failures = (event for event in ended if event.skill and event.status == "FAILURE")
        return [event.reason for event in failures if fnmatchcase(event.node, pattern)]

    def faults(self) -> list[FaultInjected]:
        """Return the injected faults, in order."""
        return [one.event for one in self.events if isinstance(one.event, FaultInjected)]


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
    longest: float = LONGEST,
) -> MissionResult:
    """Run a mission to its end and return how it went; the cell is closed.

    Args:
        mission: A mission file, or the name of a shipped mission.
        kind: Makes the work cell, whatever kind the mission's cell file names.
        seed: Decides everything random.
        set: Other values for params by name, and for the cell as `cell.<key>.<key>`.
        requests: What the operator asks for, in turn.
        substitutes: What runs instead of a node's skill, by a pattern of the node's path.
        faults: What happens to the cell, and when.
        arrange: Gets the cell before the run, to put things on its table.
        observers: Told of every event.
        longest: Time on the run's clock after which the run ends as a fault [s].

    Raises:
        MissionError: Something is wrong with the mission.
        InputError: There is no such mission, or a pattern fits no node, or one with another skill than its
            substitute's.
    """
    skills = discover()
    loaded = load_mission(mission, skills, set)
    events: list[TimedEvent] = []

    def arranged(*args: Any, **options: Any) -> Workcell:
        workcell = kind(*args, **options)
        try:
            if arrange is not None:
                arrange(workcell)
        except BaseException:
            workcell.close()
            raise
        return workcell

    make_cell = with_faults(arranged, faults, longest=longest)
    options = RunOptions(seed, requests, kind=make_cell, substitutes=substitutes or {})
    run = assemble(loaded, skills, options, [events.append, *observers])
    workcell = run.workcell
    assert isinstance(workcell, FaultyCell)
    try:
        workcell.require_nodes([getattr(node, "path", node.name) for node in run.root.iterate()])
        _require_fitting_substitutes(run, skills)
        run.observe(workcell.hear)
        outcome = run.execute()
        return MissionResult(
            **asdict(outcome),
            events=events,
            items=run.items(),
            accounts=workcell.accounts,
            audit=run.audit(),
            cell=innermost(workcell),
        )
    finally:
        run.close()


def _require_fitting_substitutes(run: Run, skills: Mapping[str, type[Skill]]) -> None:
    """Return if every node runs its own skill, or a subclass of that."""
    for node in run.root.iterate():
        if isinstance(node, SkillLeaf) and not issubclass(node.skill_type, skills[node.skill_name]):
            raise InputError(
                f"{node.path} runs {node.skill_name}, and {node.skill_type.__name__} is none; "
                "give its substitute a pattern that fits nodes of its own skill only"
            )
