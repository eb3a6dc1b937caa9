"""Assembly of the runs of a loaded mission: new, resumed and replayed runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from executive.cell.protocols import Operator
from executive.cell.workcell import CellOptions, ResumePoint, Workcell
from executive.cells.without_hardware import CellWithoutHardware
from executive.events import Observer, RequestGiven, RunStarted
from executive.mission.build import build_tree
from executive.mission.load import LoadedMission
from executive.plugins import load_cell_kind
from executive.replay.input_log import InputLog, Interruption
from executive.replay.replayed_cell import ReplayedCell
from executive.run.lookahead_planner import LookaheadPlanner
from executive.run.operator import ScriptedOperator, TerminalOperator
from executive.run.resumed_run import ResumedRun
from executive.run.run import Run
from executive.run.run_context import RunContext
from executive.run.run_control import RunControl
from executive.run.versions import list_versions
from executive.skill import Skill
from executive.tree.blackboard import Blackboard
from executive.tree.tree_node import TreeNode


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
    builder = _RunBuilder(loaded, options, RunContext(observers))
    workcell = builder.build_workcell()
    builder.context.connect(workcell, LookaheadPlanner(workcell.cell))
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
    return Run(
        builder.context, builder.build_tree(), builder.control, loaded.mission.name,
        start_event=start_event, is_realtime=options.is_realtime,
    )  # fmt: skip


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
        InputError: The kind of the cell is not installed, or its world cannot be reconstructed.
    """
    builder = _RunBuilder(loaded, options, RunContext())
    frame_count, pose_count = (len(log.inputs.get(name, ())) for name in ("camera.frame", "camera.next_pose"))
    request_count = sum(isinstance(timed.event, RequestGiven) for timed in log.events)
    workcell = builder.build_workcell(ResumePoint(world_log, frame_count, pose_count), request_count)
    interruption = log.make_final_interruption(
        workcell.steps, workcell.last_command_step, is_complete=is_complete
    )
    return builder.build_resumed_run(workcell, log, None if has_ended else interruption)


def assemble_replay(
    loaded: LoadedMission, log: InputLog, seed: int, observers: Sequence[Observer] = ()
) -> ResumedRun:
    """Return a run that replays a recorded run without hardware or simulation."""
    options = RunOptions(seed, requests=(), make_cell=CellWithoutHardware)
    builder = _RunBuilder(loaded, options, RunContext(observers))
    return builder.build_resumed_run(builder.build_workcell(), log)


@dataclass(frozen=True, eq=False)
class _RunBuilder:
    """Builder of the work cell, the tree and the run of a mission.

    Attributes:
        loaded, options: Arguments of `assemble`.
        context: Cell and events of the run; its method `connect` must be called before `build_tree`.
        control: Control with which other threads stop, pause and step the run.
    """

    loaded: LoadedMission
    options: RunOptions
    context: RunContext
    control: RunControl = field(default_factory=RunControl)

    def build_workcell(self, resume_point: ResumePoint | None = None, request_count: int = 0) -> Workcell:
        """Return the work cell of the run.

        Args:
            resume_point: State of the cell at the interruption of the run; None for a new run.
            request_count: Number of requests that the operator had given before the interruption.
        """
        loaded, options, emit = self.loaded, self.options, self.context.emit
        operator: Operator
        if options.requests is None:
            operator = TerminalOperator(emit, self.control, has_keyboard=options.has_keyboard)
        else:
            operator = ScriptedOperator(options.requests, tuple(loaded.routes), emit, request_count)
        config, base = loaded.cell_config, loaded.cell_path.parent
        cell_options = CellOptions(
            operator, base, options.gui, resume=resume_point, scene=options.scene, quotas=loaded.quotas
        )
        make_cell = options.make_cell or load_cell_kind(config.kind)
        return make_cell(config, seed=options.seed, routes=loaded.routes, emit=emit, options=cell_options)

    def build_tree(self) -> TreeNode:
        """Return the behaviour tree of the mission for the cell of `context`."""
        cell, emit = self.context.cell, self.context.emit
        return build_tree(self.loaded, self.loaded.skills, cell, Blackboard(), emit, self.options.substitutes)

    def build_resumed_run(
        self, workcell: Workcell, log: InputLog, interruption: Interruption | None = None
    ) -> ResumedRun:
        """Return a run that replays a log and, after the interruption at its end, continues on `workcell`."""
        replayed_cell = ReplayedCell(workcell, log, interruption)
        self.context.connect(replayed_cell)
        return ResumedRun(
            self.context, replayed_cell, self.build_tree(), self.control, self.loaded.mission.name,
            is_realtime=self.options.is_realtime,
        )  # fmt: skip
