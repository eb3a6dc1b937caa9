"""Assembly of a run: work cell, operator, tree and events of a loaded mission."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from executive.cell.protocols import Operator
from executive.cell.workcell import CellOptions, ResumePoint, Workcell
from executive.cells.without_hardware import CellWithoutHardware
from executive.events import Observer, RequestGiven, RunStarted
from executive.mission.build import TreeNode, build
from executive.mission.load import LoadedMission
from executive.plugins import cell_kind
from executive.replay.input_log import InputLog, Interruption
from executive.replay.replayed_cell import ReplayedCell
from executive.run.operator import ScriptedOperator, TerminalOperator
from executive.run.planning_ahead import PlanningAhead
from executive.run.resume import ResumedRun
from executive.run.run import Run
from executive.run.run_context import RunContext
from executive.run.run_control import RunControl
from executive.run.versions import versions
from executive.skill import Skill
from executive.tree.blackboard import Blackboard


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    Attributes:
        seed: Seed of all random numbers.
        requests: Answers of the operator; None: a person answers at the terminal or in a view.
        keyboard: True if a person can type at the terminal.
        gui: True to show the simulated world in a window.
        realtime: True to pace the run by the wall clock.
        kind: Kind of the work cell; None: the installed kind that the cell file names.
        substitutes: Skills that replace the skills of nodes, by a pattern of the paths of the nodes
            (`*/Grasp`).
        scene: File that changes the world of a simulated cell; None: as the cell file declares it.
    """

    seed: int
    requests: Sequence[str] | None = None
    keyboard: bool = True
    gui: bool = False
    realtime: bool = False
    kind: Callable[..., Workcell] | None = None
    substitutes: Mapping[str, type[Skill]] = field(default_factory=dict)
    scene: Path | None = None


def assemble(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    options: RunOptions,
    observers: Sequence[Observer] = (),
) -> Run:
    """Return a run of a mission from its start.

    Args:
        loaded: The mission and its cell.
        skills: Installed skills by name.
        options: Options of the run.
        observers: Called with every event, in order.

    Raises:
        InputError: The cell is of a kind that is not installed, or a request names no class.
    """
    parts = _Parts(loaded, skills, options, observers)
    workcell = parts.build_cell()
    parts.context.connect(workcell, PlanningAhead(workcell.cell))
    start = RunStarted(
        loaded.mission.name,
        str(loaded.path),
        options.seed,
        loaded.params,
        loaded.overrides,
        options.requests,
        str(loaded.cell_path.parent.resolve()),
        workcell.cell.clock.step,
        dict(versions()),
    )
    root = parts.build_tree()
    name = loaded.mission.name
    return Run(parts.context, root, parts.control, name, start=start, realtime=options.realtime)


def assemble_resumed(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    options: RunOptions,
    log: InputLog,
    world: Path,
    *,
    is_complete: bool = True,
    has_ended: bool = False,
) -> ResumedRun:
    """Return a run that replays a recorded run on its rebuilt cell and, if it was interrupted, continues.

    Args:
        loaded: The mission and its cell.
        skills: Installed skills by name.
        options: Options of the interrupted run.
        log: The recorded inputs.
        world: File from which the cell rebuilds its world.
        is_complete: True if the log holds all events of its last control step.
        has_ended: True if the run is not continued.

    Raises:
        InputError: The cell is of a kind that is not installed, or its world cannot be rebuilt.
    """
    parts = _Parts(loaded, skills, options)
    frames, pose_changes = (log.count_answers(f"camera.{name}") for name in ("frame", "next_pose"))
    inner = parts.build_cell(ResumePoint(world, frames, pose_changes), log.count_events(RequestGiven))
    last = log.find_interruption(inner.steps, inner.last_command, is_complete=is_complete)
    return parts.build_resumed_run(inner, log, None if has_ended else last)


def assemble_replay(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    log: InputLog,
    seed: int,
    observers: Sequence[Observer] = (),
) -> ResumedRun:
    """Return a run that only replays a recorded run, without a cell."""
    options = RunOptions(seed, requests=(), kind=CellWithoutHardware)
    parts = _Parts(loaded, skills, options, observers)
    return parts.build_resumed_run(parts.build_cell(), log)


class _Parts:
    """Builder of the parts of a run.

    Attributes:
        context: Cell and events of the run; it is connected to the cell before the tree is built.
        control: Stops, pauses and steps the run.
    """

    def __init__(
        self,
        loaded: LoadedMission,
        skills: Mapping[str, type[Skill]],
        options: RunOptions,
        observers: Sequence[Observer] = (),
    ) -> None:
        self._loaded, self._skills, self._options = loaded, skills, options
        self.context = RunContext(observers)
        self.control = RunControl()

    def build_cell(self, resume: ResumePoint | None = None, served_requests: int = 0) -> Workcell:
        """Return the work cell of the run.

        Args:
            resume: State in which an interrupted run left the cell; None for a new run.
            served_requests: Number of requests that the operator of the interrupted run had given.
        """
        loaded, options, emit = self._loaded, self._options, self.context.emit
        operator: Operator
        if options.requests is None:
            operator = TerminalOperator(emit, self.control, keyboard=options.keyboard)
        else:
            operator = ScriptedOperator(options.requests, tuple(loaded.routes), emit, served_requests)
        cell_options = CellOptions(
            operator, loaded.cell_path.parent, options.gui, resume=resume, scene=options.scene
        )
        kind = options.kind or cell_kind(loaded.cell_config.kind)
        return kind(
            loaded.cell_config, seed=options.seed, routes=loaded.routes, emit=emit, options=cell_options
        )

    def build_tree(self) -> TreeNode:
        """Return the tree."""
        cell, emit = self.context.cell, self.context.emit
        return build(self._loaded, self._skills, cell, Blackboard(), emit, self._options.substitutes)

    def build_resumed_run(
        self, inner: Workcell, log: InputLog, last: Interruption | None = None
    ) -> ResumedRun:
        """Return a run that replays a log, and continues on the cell `inner` after a `last` interruption."""
        replayed = ReplayedCell(inner, log, last)
        self.context.connect(replayed)
        root, name, realtime = self.build_tree(), self._loaded.mission.name, self._options.realtime
        return ResumedRun(self.context, replayed, root, self.control, name, realtime=realtime)
