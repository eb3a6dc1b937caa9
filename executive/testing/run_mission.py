"""Execution of a whole mission in a test, and substitutes of its skills that fail or raise an error.

Each of the functions that make a substitute returns a subclass of a skill, with the same ports, params and
reasons, for `run_mission(substitutes={"*/Grasp": make_failing(Grasp, "missed", start_count=2)})`. A
substitute counts its starts over all nodes and runs, so make a new substitute for each mission run.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from fnmatch import fnmatchcase
from itertools import count, islice
from pathlib import Path
from typing import Any, cast

from py_trees.visitors import VisitorBase

from executive.behaviours import load_skills
from executive.cell.protocols import Cell, Steps
from executive.errors import InputError
from executive.events import FaultInjected, NodeEnded, NodeStarted, Observer, RunEnded, TimedEvent
from executive.ledger.tracker import Tracker
from executive.mission.load import load_mission
from executive.record.result import is_confirmed_by_audit
from executive.run.assembly import RunOptions, assemble
from executive.run.run import Run
from executive.skill import Skill
from executive.station.station import Station
from executive.testing.fake_cell import FakeCell
from executive.testing.faulty_cell import FaultInjector, ScheduledFault
from executive.tree.skill_leaf import SkillLeaf

MISSION_TIMEOUT = 600.0
"""Default timeout of a run, on the run's clock [s]; after the timeout the run ends as a fault."""
RunMethod = Callable[[Skill, Cell], Steps | None]
"""Type of the method `run` of a skill."""


@dataclass(frozen=True)
class MissionResult(RunEnded):
    """Result of a mission run: its `RunEnded` event, all events, and the final counts.

    Attributes:
        events: All events of the run, in order.
        items: Number of items of the ledger by final state; `seen` counts all items except phantoms.
        ledger: The ledger, with the final state of each item.
        audit: True number of objects by final place; None if the cell has no ground truth.
        cell: The closed station of the run.
    """

    events: Sequence[TimedEvent]
    items: Mapping[str, int]
    ledger: Tracker
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
    make_cell: Callable[..., Station] = FakeCell,
    *,
    cell: str = "",
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
        make_cell: Function that makes the station, instead of the kind in the cell file.
        cell: Cell file or name of the shipped cell that replaces the mission's cell, or "".
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
    loaded = load_mission(mission, load_skills(), set, replacing_cell=cell)
    events: list[TimedEvent] = []
    injector = FaultInjector(faults, timeout)
    options = RunOptions(seed, requests, make_cell=injector.wrap(make_cell), substitutes=substitutes or {})
    with closing(assemble(loaded, options, [events.append, *observers])) as run:
        station = run.station
        if arrange is not None:
            arrange(station)
        injector.check_patterns([getattr(node, "path", node.name) for node in run.root.iterate()])
        _check_substitutes(run, loaded.skills)
        run.add_observer(injector.on_event)
        for visitor in visitors:
            run.behaviour_tree.add_visitor(visitor)
        return MissionResult(
            **asdict(run.execute()),
            events=events,
            items=station.ledger.count_states(),
            ledger=station.ledger,
            audit=station.audit(),
            cell=station,
        )


def _check_substitutes(run: Run, skills: Mapping[str, type[Skill]]) -> None:
    """Raise InputError if a node runs neither the skill of the mission nor a subclass of this skill."""
    for node in run.root.iterate():
        if isinstance(node, SkillLeaf) and not issubclass(node.skill_type, skills[node.skill_name]):
            raise InputError(
                f"{node.path} runs {node.skill_name}, but {node.skill_type.__name__} is not a subclass; "
                "give the substitute a pattern that matches only nodes of its skill"
            )


def make_failing(
    skill: type[Skill], reason: str, *, start_count: int | None = None, message: str = "injected failure"
) -> type[Skill]:
    """Return a skill whose first `start_count` runs fail (None: all); later runs execute the original skill.

    Raises:
        InputError: The skill does not declare this reason.
    """
    if reason not in skill.reasons:
        declared = ", ".join(skill.reasons) or "none"
        raise InputError(f'{skill.__name__} cannot fail with "{reason}"; it declares: {declared}')

    def run(self: Skill, cell: Cell) -> None:
        del cell
        raise self.failure(reason, message)

    return make_substitute(skill, "Failing", run, _list_first_starts(start_count))


def make_raising(
    skill: type[Skill], error: Exception, *, delay_steps: int = 0, start_count: int | None = None
) -> type[Skill]:
    """Return a skill that raises `error` after `delay_steps` control steps of the original skill.

    The original skill is closed before the error. A run that ends earlier raises no error. The error is
    raised in the first `start_count` runs; in all runs if `start_count` is None.
    """

    def run(self: Skill, cell: Cell) -> Steps:
        steps_done = 0
        with closing(_run_original(skill, self, cell)) as steps:
            for _ in islice(steps, delay_steps):
                yield
                steps_done += 1
            if steps_done == delay_steps:
                raise error

    return make_substitute(skill, "Raising", run, _list_first_starts(start_count))


def make_substitute(
    skill: type[Skill], prefix: str, run: RunMethod, start_numbers: Container[int] | None = None
) -> type[Skill]:
    """Return a subclass of a skill with another method `run`.

    Args:
        skill: Class of the skill.
        prefix: Prefix of the name of the subclass.
        run: Replacement of the method `run`.
        start_numbers: Numbers of the starts, from 1, at which the replacement runs; None: all starts.
    """
    start_counter = count(1)

    def choose_run(self: Skill, cell: Cell) -> Steps | None:
        is_replaced = start_numbers is None or next(start_counter) in start_numbers
        return run(self, cell) if is_replaced else _run_original(skill, self, cell)

    members = {
        "run": choose_run,
        "__doc__": f"Substitute of {skill.__name__}.",
        "__module__": skill.__module__,
    }
    return cast(type[Skill], type(f"{prefix}{skill.__name__}", (skill,), members))


def _list_first_starts(start_count: int | None) -> Container[int] | None:
    """Return the numbers of the first `start_count` starts; None: all starts."""
    return None if start_count is None else range(1, start_count + 1)


def _run_original(skill: type[Skill], instance: Skill, cell: Cell) -> Generator[None, None, None]:
    """Execute the method `run` of `skill` on `instance`; `run` may be a generator or a plain function."""
    yield from skill.run(instance, cell) or ()
