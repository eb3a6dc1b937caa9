"""A mission halted at many moments of one run, each time as Ctrl-C would halt it.

The mission is run once. At each of the moments this process forks. The child requests a stop, halts as any
run does, is checked and ends; its parent continues to the next moment. Parent and child would share
a detector in another process, so use ground-truth detections (`--oracle`) for a simulated cell.
"""

from __future__ import annotations

import math
import shutil
import tempfile
import traceback
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from py_trees.common import Status

from executive.campaign.jobs import MissionUnderTest
from executive.cell.device_config import STEP
from executive.drivers.sim.arm import SimArm
from executive.errors import ExecutiveError
from executive.events import NodeEnded, NodeStarted, RunEnded, TimedEvent
from executive.geometry import Array
from executive.ledger.final_states import is_balanced
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Trajectory
from executive.record.journal import Journal, Trace, read_journal
from executive.run.assembly import RunOptions, assemble
from executive.station.station import Station
from tests.benchmarks.forks import ForkRunner
from tests.benchmarks.report import Figures, describe, record_subject, run_command

LIMITS = {"rest_s": 0.5, "deviation_rad": 1e-6, "acceleration_ratio": 1.0, "jerk_ratio": 1.02}
"""Limits of a halt: time to rest, distance of a joint's command from the planned trajectory, and acceleration
and jerk relative to the braking limits. Finite differences exceed the jerk of the profile a little."""
COMMANDS_BEFORE_STOP = 5
"""Number of checked commands from before the stop, so that the finite differences cover the stop."""
CHILD_TIMEOUT = 120.0
"""Time that a child may take to halt and be checked [s]."""
REST_CHECK_STEPS = 6
"""Number of control steps after the end of a run during which the arm must not move."""
MAX_MOVEMENT_AT_REST = 1e-5
"""Maximum movement of a joint of an arm at rest [rad]; for a fake arm, movement of the tool [m]."""


def measure(subject: MissionUnderTest, every: int | None = None) -> Figures:
    """Halt MISSION in every `--every` control steps of one run, each time as Ctrl-C would."""
    period_steps = every or (10 if subject.loaded.cell_config.kind == "sim" else 1)
    with tempfile.TemporaryDirectory() as folder:
        undisturbed, problem = record_subject(subject, subject.seed, Path(folder))
        if problem:
            raise ExecutiveError(f"{subject.name} with {problem}; choose a seed with which it succeeds")
        halts = _RunWithHalts(subject, period_steps, Path(folder)).run(undisturbed)
    return {
        **describe(subject),
        "ticks": undisturbed["ticks"],
        "halts": len(halts),
        "moving": sum(halt["moving"] for halt in halts),
        "holding": sum(bool(halt["holds"]) for halt in halts),
        "failed": sum(bool(halt["problems"]) for halt in halts),
        "worst": find_worst(halts),
        "problems": [f"{text} (tick {halt['tick']})" for halt in halts for text in halt["problems"]],
    }


def check_arm_at_rest(station: Station) -> Iterator[str]:
    """Yield a problem if the arm is not at rest now, or moves during `REST_CHECK_STEPS` control steps."""
    arm = next(iter(station.driver.arms.values()))
    if not arm.at_rest:
        yield "the arm is not at rest"
    positions = [arm.q]
    for _ in range(REST_CHECK_STEPS):
        station.advance()
        positions.append(arm.q)
    movement = float(np.ptp(positions, axis=0).max())
    if movement > MAX_MOVEMENT_AT_REST:
        yield f"the arm moved by {movement:.1e} after the run had ended"


def check_journal(events: Iterable[TimedEvent], outcome: RunEnded) -> Iterator[str]:
    """Yield a problem unless only the last event is the end of the run, and all nodes end before it."""
    *earlier, last = [timed.event for timed in events]
    if last != outcome or any(isinstance(event, RunEnded) for event in earlier):
        yield f"the journal ends with {last}, but the run ended with {outcome}"
    running: set[str] = set()
    for event in earlier:
        if isinstance(event, NodeStarted):
            if event.node in running:
                yield f"in the journal {event.node} starts twice without an end"
            running.add(event.node)
        elif isinstance(event, NodeEnded):
            running.discard(event.node)
    if running:
        yield f"in the journal {', '.join(running)} does not end"


def find_worst(halts: Sequence[Figures]) -> list[Figures]:
    """Return for each limited figure its largest value, the tick of the halt, and the limit."""
    worst = []
    for name, allowed in LIMITS.items():
        value, tick = max((halt.get(name, -math.inf), halt["tick"]) for halt in halts)
        if math.isfinite(value):
            worst.append({"figure": name, "value": value, "tick": tick, "allowed": allowed})
    return worst


def check_ledger(items: Mapping[str, int], audit: Mapping[str, int] | None) -> Iterator[str]:
    """Yield a sentence if the ledger does not balance, or disagrees with the audit.

    An object that was not detected before the halt is not in the ledger; the audit counts it as unseen.
    """
    matches = audit is None or (
        items["placed"] == audit["right"]
        and items["rejected"] + items["skipped"] + audit["unseen"] <= audit["left"]
        and items["lost"] == audit["elsewhere"]
        and audit["wrong_bin"] == 0
    )
    if not (is_balanced(items) and matches):
        yield f"the ledger says {dict(items)}; the audit {audit}"


def measure_braking(
    commands: Sequence[Array], commands_before_stop: int, trajectory: Trajectory, limits: JointLimits
) -> dict[str, float]:
    """Return the distance from the trajectory, and acceleration and jerk relative to the limits of braking.

    Args:
        commands: Joint positions of consecutive control steps [rad].
        commands_before_stop: Number of commands from before the stop.
        trajectory: The motion under way at the stop.
        limits: Joint limits of the arm.
    """
    accelerations = np.diff(commands, 2, axis=0) / STEP**2
    jerks = np.diff(accelerations, axis=0) / STEP
    return {
        "deviation_rad": max(
            measure_distance(command, trajectory) for command in commands[commands_before_stop:]
        ),
        "acceleration_ratio": float(np.max(np.abs(accelerations) / limits.stop_acceleration, initial=0.0)),
        "jerk_ratio": float(np.max(np.abs(jerks) / limits.stop_jerk, initial=0.0)),
    }


def measure_distance(q: Array, trajectory: Trajectory) -> float:
    """Return the largest joint distance [rad] of positions `(7,)` from the closest point of a trajectory.

    Golden-section search around the closest segment between two samples finds this point. The closest sample
    would be a bad start: it may belong to another part of a trajectory that passes the same point twice.
    """
    corners = trajectory.samples.q
    lines = np.diff(corners, axis=0)
    squares = np.maximum(np.sum(lines**2, axis=1), np.finfo(float).tiny)
    along = np.clip(np.sum((q - corners[:-1]) * lines, axis=1) / squares, 0.0, 1.0)
    feet = corners[:-1] + along[:, None] * lines
    time = int(np.argmin(np.linalg.norm(feet - q, axis=1))) * STEP
    low, high = time - STEP / 2, time + STEP * 3 / 2
    ratio = (math.sqrt(5) - 1) / 2
    for _ in range(60):
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        if np.linalg.norm(trajectory.state_at(a).q - q) < np.linalg.norm(trajectory.state_at(b).q - q):
            high = b
        else:
            low = a
    return float(np.abs(trajectory.state_at((low + high) / 2).q - q).max())


class _RunWithHalts:
    """The run, and the results of its children so far."""

    def __init__(self, subject: MissionUnderTest, period_steps: int, folder: Path) -> None:
        self._period_steps = period_steps
        self._forks = ForkRunner(CHILD_TIMEOUT)
        self._journal_path = folder / "journal.jsonl"
        self._journal = Journal(self._journal_path)
        self._trace = Trace()
        self._commands: deque[Array] = deque(maxlen=COMMANDS_BEFORE_STOP)
        self._motion: Trajectory | None = None
        self._halts: list[Figures] = []
        self._halt: Figures = {}
        self._limits = JointLimits.from_config(subject.loaded.cell_config.arm.limits)
        options = RunOptions(subject.seed, subject.requests, make_cell=subject.make_cell)
        self._run = assemble(subject.loaded, options, [lambda event: self._journal(event), self._trace])
        self._arm = next(iter(self._run.station.driver.arms.values()))
        self._run.station.tick_callbacks += [self._keep_command, self._fork_and_halt_if_due]

    def run(self, undisturbed: Figures) -> list[Figures]:
        """Run the mission and return what its children sent.

        Raises:
            ExecutiveError: The run differed from the run without halts.
        """
        try:
            outcome = self._run.execute()
            if self._forks.is_child:
                self._check(outcome)
        except BaseException:
            if not self._forks.is_child:
                raise
            self._halt["problems"] = [traceback.format_exc()]
        finally:
            # In every case: a child must not run beyond this line.
            if self._forks.is_child:
                self._forks.send_and_exit(self._halt)
            self._run.close()
            self._journal.close()
        if outcome.status == "HALTED":
            raise KeyboardInterrupt
        if self._trace.hexdigest() != undisturbed["trace"]:
            raise ExecutiveError(
                f"the run with halts ended as {outcome.status}, and differs from that without"
            )
        return self._halts

    def _keep_command(self) -> None:
        if isinstance(self._arm, SimArm):
            self._commands.append(self._arm.commanded_q)

    def _fork_and_halt_if_due(self) -> None:
        """Fork if a halt is due: the child requests a stop and goes on; the parent keeps the result."""
        if self._forks.is_child or self._run.tick % self._period_steps:
            return
        self._halt = {"tick": self._run.tick, "moving": not self._arm.at_rest, "holds": ""}
        answer = self._forks.fork_and_wait()
        if answer is not None:
            result, problem = answer
            self._halts.append(result or {**self._halt, "problems": [problem]})
            return
        self._journal_path = shutil.copyfile(self._journal_path, self._journal_path.with_name("child.jsonl"))
        self._journal = Journal(self._journal_path, resume=True)
        self._commands = deque(self._commands)
        self._halt["commands_before_stop"] = len(self._commands)
        self._motion = self._arm.motion if isinstance(self._arm, SimArm) else None
        self._run.control.stop()

    def _check(self, outcome: RunEnded) -> None:
        """Add the figures and problems of the halt that this child has made."""
        run = self._run
        self._journal.close()
        halt = self._halt
        halt["holds"] = outcome.held_item
        halt["rest_s"] = (outcome.ticks - halt["tick"]) * run.station.cell.clock.step
        if self._motion is not None:
            before_stop = halt["commands_before_stop"]
            halt.update(measure_braking([*self._commands], before_stop, self._motion, self._limits))
        problems = [
            *check_journal(read_journal(self._journal_path), outcome),
            *check_ledger(run.station.ledger.count_states(), run.station.audit()),
            *check_arm_at_rest(run.station),
        ]
        if run.station.cell.tool.holding != bool(outcome.held_item):
            problems.append(f'the held item of the run is "{outcome.held_item}", the tool says otherwise')
        if (outcome.status, outcome.reason) != ("HALTED", "halted"):
            problems.append(f"the run ended as {outcome.status} {outcome.reason}: {outcome.message}")
        if running := [node.name for node in run.root.iterate() if node.status is Status.RUNNING]:
            problems.append(f"still running: {', '.join(running)}")
        for name, allowed in LIMITS.items():
            if halt.get(name, 0.0) > allowed:
                problems.append(f"{name} is {halt[name]:.4g}; {allowed:g} is allowed")
        halt["problems"] = problems


if __name__ == "__main__":
    run_command(measure)
