"""Assembly of the runs of a loaded mission: new, resumed and replayed runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from executive.cell.protocols import Operator
from executive.cell.workcell import CellOptions, ResumePoint, Workcell
from executive.cells.without_hardware import CellWithoutHardware
from executive.errors import InputError
from executive.events import Observer, RequestGiven, RunStarted
from executive.mission.build import build_tree
from executive.mission.load import LoadedMission
from executive.plugins import list_versions, load_cell_kind
from executive.replay.replayed_cell import InputLog, ReplayedCell
from executive.run.operator import ScriptedOperator, TerminalOperator
from executive.run.resumed_run import ResumedRun
from executive.run.run import LookaheadPlanner, Run, RunContext
from executive.run.run_control import RunControl
from executive.skill import Skill
from executive.tree.tree_node import Blackboard, TreeNode


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    Attributes:
        seed: Seed of all random numbers.
        requests: Requests of the operator, or None if a person gives requests at the terminal or in a view.
        has_keyboard: True if requests of the operator come from standard input.
        gui: True to show the simulated world in a window.
        is_realtime: True to execute the run at the speed of the wall clock.
        make_cell: Factory of the work cell, or None for the kind of cell that the cell file names.
        substitutes: Skill that replaces the skills of nodes, by a pattern for the node paths (`*/Grasp`).
        scene: Scene file, which changes the world of a simulated cell, or None.
    """

    seed: int
    requests: Sequence[str] | None = None
    has_keyboard: bool = True
    gui: bool = False
    is_realtime: bool = False
    make_cell: Callable[..., Workcell] | None = None
    substitutes: Mapping[str, type[Skill]] = field(default_factory=dict)
    scene: Path | None = None


def assemble(loaded: LoadedMission, options: RunOptions, observers: Sequence[Observer] = ()) -> Run:
    """Return a new run of a mission.

    Args:
        loaded: The mission and its cell.
        options: Options of the run.
        observers: Observers of the events; each event is passed to the observers in this order.

    Raises:
        InputError: The kind of the cell is not installed, or a request names no class of the mission.
    """
    context = RunContext(observers)
    control = RunControl()
    workcell = _build_workcell(loaded, options, context, control)
    context.connect(workcell, LookaheadPlanner(workcell.cell))
    start_event = RunStarted(
        mission=loaded.mission.name,
        file=str(loaded.path),
        seed=options.seed,
        params=loaded.params,
        overrides=loaded.overrides,
        requests=options.requests,
        base=str(loaded.cell_path.parent.resolve()),
        step=workcell.cell.clock.step,
        versions=dict(list_versions()),
    )
    root = _build_tree(loaded, options, context)
    is_realtime = options.is_realtime
    return Run(context, root, control, loaded.mission.name, start_event=start_event, is_realtime=is_realtime)


def assemble_resumed(
    loaded: LoadedMission,
    options: RunOptions,
    log: InputLog,
    world_log: Path,
    *,
    is_complete: bool = True,
    has_ended: bool = False,
) -> ResumedRun:
    """Return a run that replays a recorded run and, if that run was interrupted, continues on a cell.

    Args:
        loaded: The mission and its cell.
        options: Options of the interrupted run.
        log: The recorded inputs.
        world_log: File from which a simulated cell reconstructs its world.
        is_complete: True if the log contains all events of its last control step.
        has_ended: True if the recorded run has ended and is therefore only replayed.

    Raises:
        InputError: The kind of the cell is not installed, its world cannot be reconstructed, or the log lacks
            commands to arm or tool.
    """
    context = RunContext()
    control = RunControl()
    frame_count, pose_count = (len(log.inputs.get(name, ())) for name in ("camera.frame", "camera.next_pose"))
    request_count = sum(isinstance(timed.event, RequestGiven) for timed in log.events)
    resume_point = ResumePoint(world_log, frame_count, pose_count)
    workcell = _build_workcell(loaded, options, context, control, resume_point, request_count)
    # A killed run loses no command: before the cell executes a command, the journal contains an event of the
    # same control step, which is `ToolCommanded` or `MotionPlanned`.
    if workcell.last_command_step > log.last_tick:
        workcell.close()
        text = f"the journal ends in control step {log.last_tick}, and lacks later commands to arm or tool"
        raise InputError(f"{text}; somebody changed it, or a disk lost its end; run the mission again")
    interruption = log.make_final_interruption(workcell.steps, is_complete=is_complete)
    cell = ReplayedCell(workcell, log, None if has_ended else interruption)
    return _build_resumed_run(loaded, options, context, control, cell)


def assemble_replay(
    loaded: LoadedMission, log: InputLog, seed: int, observers: Sequence[Observer] = ()
) -> ResumedRun:
    """Return a run that replays a recorded run without hardware or simulation."""
    options = RunOptions(seed, requests=(), make_cell=CellWithoutHardware)
    context = RunContext(observers)
    control = RunControl()
    cell = ReplayedCell(_build_workcell(loaded, options, context, control), log)
    return _build_resumed_run(loaded, options, context, control, cell)


def _build_workcell(
    loaded: LoadedMission,
    options: RunOptions,
    context: RunContext,
    control: RunControl,
    resume_point: ResumePoint | None = None,
    request_count: int = 0,
) -> Workcell:
    """Return the work cell of a run.

    For a resumed run, `resume_point` is the state of the cell at the interruption, and `request_count` the
    number of requests that the operator had given before.
    """
    emit = context.emit
    operator: Operator = TerminalOperator(emit, control, has_keyboard=options.has_keyboard)
    if options.requests is not None:
        operator = ScriptedOperator(options.requests, tuple(loaded.routes), emit, request_count)
    config, base = loaded.cell_config, loaded.cell_path.parent
    cell_options = CellOptions(
        operator, base, options.gui, resume=resume_point, scene=options.scene, quotas=loaded.quotas
    )
    make_cell = options.make_cell or load_cell_kind(config.kind)
    return make_cell(config, seed=options.seed, routes=loaded.routes, emit=emit, options=cell_options)


def _build_resumed_run(
    loaded: LoadedMission, options: RunOptions, context: RunContext, control: RunControl, cell: ReplayedCell
) -> ResumedRun:
    """Return a run on a cell that replays a log and, after the interruption at its end, continues."""
    context.connect(cell)
    root = _build_tree(loaded, options, context)
    return ResumedRun(context, cell, root, control, loaded.mission.name, is_realtime=options.is_realtime)


def _build_tree(loaded: LoadedMission, options: RunOptions, context: RunContext) -> TreeNode:
    """Return the behaviour tree of the mission for the cell of `context`."""
    return build_tree(loaded, loaded.skills, context.cell, Blackboard(), context.emit, options.substitutes)
