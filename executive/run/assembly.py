"""Assembly of the runs of a loaded mission: new, resumed and replayed runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from executive.cell.protocols import Operator
from executive.cell.workcell import CellOptions, ResumePoint, Workcell
from executive.cells.without_hardware import CellWithoutHardware
from executive.events import Observer, RequestGiven, RunStarted
from executive.mission.build import TreeNode, build_tree
from executive.mission.load import LoadedMission
from executive.plugins import load_cell_kind
from executive.replay.input_log import InputLog, Interruption
from executive.replay.replayed_cell import ReplayedCell
from executive.run.lookahead_planner import LookaheadPlanner
from executive.run.operator import ScriptedOperator, TerminalOperator
from executive.run.resume import ResumedRun
from executive.run.run import Run
from executive.run.run_context import RunContext
from executive.run.run_control import RunControl
from executive.run.versions import list_versions
from executive.skill import Skill
from executive.tree.blackboard import Blackboard


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    Attributes:
        seed: Seed of all random numbers.
        requests: Requests of the operator; None: a person gives requests at the terminal or in a view.
        keyboard: True if a person can type at the terminal.
        gui: True to show the simulated world in a window.
        realtime: True to pace the run by the wall clock.
        kind: Constructor of the work cell; None: the installed kind that the cell file names.
        substitutes: Skills that replace the skills of nodes, by a pattern of the paths of the nodes
            (`*/Grasp`).
        scene: Scene file, which changes the world of a simulated cell; None: the world of the cell file.
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
    """Return a new run of a mission.

    Args:
        loaded: The mission and its cell.
        skills: Installed skills by name.
        options: Options of the run.
        observers: Observers of the events, in the order of their calls.

    Raises:
        InputError: The kind of the cell is not installed, or a request is not a class of the mission.
    """
    builder = _RunBuilder(loaded, skills, options, observers)
    workcell = builder.build_cell()
    builder.context.connect(workcell, LookaheadPlanner(workcell.cell))
    start = RunStarted(
        loaded.mission.name,
        str(loaded.path),
        options.seed,
        loaded.params,
        loaded.overrides,
        options.requests,
        str(loaded.cell_path.parent.resolve()),
        workcell.cell.clock.step,
        dict(list_versions()),
    )
    root = builder.build_tree()
    name = loaded.mission.name
    return Run(builder.context, root, builder.control, name, start=start, realtime=options.realtime)


def assemble_resumed(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    options: RunOptions,
    log: InputLog,
    world_log: Path,
    *,
    is_complete: bool = True,
    has_ended: bool = False,
) -> ResumedRun:
    """Return a run that replays a recorded run and, if the run was interrupted, continues on its cell.

    Args:
        loaded: The mission and its cell.
        skills: Installed skills by name.
        options: Options of the interrupted run.
        log: The recorded inputs.
        world_log: File from which the cell rebuilds its world.
        is_complete: True if the log contains all events of its last control step.
        has_ended: True if the recorded run had ended, so that it is only replayed.

    Raises:
        InputError: The kind of the cell is not installed, or the world of the cell cannot be rebuilt.
    """
    builder = _RunBuilder(loaded, skills, options)
    frames, pose_changes = (log.count_readings(f"camera.{name}") for name in ("frame", "next_pose"))
    inner = builder.build_cell(ResumePoint(world_log, frames, pose_changes), log.count_events(RequestGiven))
    last = log.find_interruption(inner.steps, inner.last_command, is_complete=is_complete)
    return builder.build_resumed_run(inner, log, None if has_ended else last)


def assemble_replay(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    log: InputLog,
    seed: int,
    observers: Sequence[Observer] = (),
) -> ResumedRun:
    """Return a run that replays a recorded run without hardware or simulation."""
    options = RunOptions(seed, requests=(), kind=CellWithoutHardware)
    builder = _RunBuilder(loaded, skills, options, observers)
    return builder.build_resumed_run(builder.build_cell(), log)


class _RunBuilder:
    """Builder of the parts of a run.

    Attributes:
        context: Recorded cell and events of the run; `connect` must precede `build_tree`.
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

    def build_cell(self, resume_point: ResumePoint | None = None, request_count: int = 0) -> Workcell:
        """Return the work cell of the run.

        Args:
            resume_point: State in which an interrupted run left the cell; None for a new run.
            request_count: Number of requests that the operator gave before the interruption.
        """
        loaded, options, emit = self._loaded, self._options, self.context.emit
        operator: Operator
        if options.requests is None:
            operator = TerminalOperator(emit, self.control, keyboard=options.keyboard)
        else:
            operator = ScriptedOperator(options.requests, tuple(loaded.routes), emit, request_count)
        cell_options = CellOptions(
            operator, loaded.cell_path.parent, options.gui, resume=resume_point, scene=options.scene
        )
        kind = options.kind or load_cell_kind(loaded.cell_config.kind)
        return kind(
            loaded.cell_config, seed=options.seed, routes=loaded.routes, emit=emit, options=cell_options
        )

    def build_tree(self) -> TreeNode:
        """Return the behaviour tree of the mission on the cell of `context`."""
        cell, emit = self.context.cell, self.context.emit
        return build_tree(self._loaded, self._skills, cell, Blackboard(), emit, self._options.substitutes)

    def build_resumed_run(
        self, inner: Workcell, log: InputLog, last: Interruption | None = None
    ) -> ResumedRun:
        """Return a run that replays a log and continues on `inner` after the interruption `last`."""
        replayed_cell = ReplayedCell(inner, log, last)
        self.context.connect(replayed_cell)
        root, name, realtime = self.build_tree(), self._loaded.mission.name, self._options.realtime
        return ResumedRun(self.context, replayed_cell, root, self.control, name, realtime=realtime)
