"""Ctrl-C at moments of a simulated sort: the arm brakes on its path, and the record is complete."""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from py_trees.common import Status
from scipy.optimize import minimize_scalar

from executive.cell.clock import STEP
from executive.cells.sim.cell import SimCell
from executive.events import NodeEnded, NodeStarted, RunEnded
from executive.geometry import Array
from executive.mission.load import load_mission
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Trajectory
from executive.plugins import load_skills
from executive.record.journal import Journal, read_journal
from executive.run.assembly import RunOptions, assemble
from executive.testing.oracle import make_oracle_kind

pytestmark = pytest.mark.slow

BEFORE, AFTER = 5, 6
"""Commands looked at before the key and control steps added after the run, so that no edge is missed."""


@dataclass(frozen=True)
class Halt:
    """A run that was halted.

    Attributes:
        tick: Control step at which the key was pressed.
        outcome: How the run ended.
        path: The motion under way at the key.
        commands: Joint positions `(N, 7)` [rad] sent to the arm, from `BEFORE` steps before the key on.
        measured: Joint positions `(N, 7)` [rad] of the arm in the steps after the end of the run.
        limits: The arm's limits.
        running: Nodes that still say they are running.
        journal: The entries of the journal.
    """

    tick: int
    outcome: RunEnded
    path: Trajectory
    commands: Array
    measured: Array
    limits: JointLimits
    running: list[str]
    journal: list[dict[str, Any]]


@pytest.fixture(scope="module", params=[209, 885, 1223])
def halt(missions: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Halt:
    """Press Ctrl-C in the first motion after some control steps of a sort."""
    earliest, file = request.param, tmp_path_factory.mktemp("halt") / "journal.jsonl"
    loaded = load_mission(missions / "sort_overhead.yaml", load_skills())
    journal = Journal(file)
    run = assemble(loaded, RunOptions(2, make_cell=make_oracle_kind()), [journal])
    workcell = run.workcell
    assert isinstance(workcell, SimCell)
    client, arm, advance = workcell._world.client, workcell._arm, workcell.advance
    send = client.setJointMotorControlArray
    last, commands = arm.q, []
    pressed: list[tuple[int, Trajectory]] = []

    def sent(*args: Any, targetPositions: list[float], **options: Any) -> None:
        nonlocal last
        last = np.array(targetPositions)
        send(*args, targetPositions=targetPositions, **options)

    def advanced() -> None:
        if not pressed and len(commands) >= earliest and arm._motion is not None:
            pressed.append((len(commands), arm._motion))
            os.kill(os.getpid(), signal.SIGINT)
        advance()
        commands.append(last)

    client.setJointMotorControlArray = sent
    workcell.advance = advanced  # type: ignore[method-assign]
    handler = signal.getsignal(signal.SIGINT)
    try:
        outcome = run.execute()
        measured = []
        for _ in range(AFTER):
            workcell.advance()
            measured.append(arm.q)
    finally:
        run.close()
        journal.close()
    assert signal.getsignal(signal.SIGINT) is handler
    (tick, path), *_ = pressed
    return Halt(
        tick, outcome, path, np.array(commands[tick - BEFORE :]), np.array(measured),
        JointLimits.from_config(loaded.cell_config.arm.limits),
        [node.name for node in run.root.iterate() if node.status is Status.RUNNING],
        read_journal(file),
    )  # fmt: skip


def distance(q: Array, path: Trajectory) -> float:
    """Return the distance of joint positions from all that a motion passes [rad]."""
    near = int(np.argmin(np.abs(path.samples.q - q).max(axis=1))) * STEP
    bounds = near - STEP, near + STEP
    apart = minimize_scalar(
        lambda s: np.linalg.norm(path.state_at(s).q - q),
        bounds=bounds, method="bounded", options={"xatol": 1e-9},
    )  # fmt: skip
    return float(np.abs(path.state_at(apart.x).q - q).max())


def test_the_arm_is_at_rest_within_half_a_second(halt: Halt) -> None:
    assert (halt.outcome.status, halt.outcome.message) == ("HALTED", "halted by the user")
    assert halt.outcome.ticks - halt.tick <= 120
    assert np.ptp(halt.commands[-AFTER:], axis=0).max() == 0.0
    assert np.ptp(halt.measured, axis=0).max() < 1e-5


def test_braking_stays_on_the_planned_path_and_within_the_stop_limits(halt: Halt) -> None:
    assert max(distance(command, halt.path) for command in halt.commands[BEFORE:]) < 1e-6
    accelerations = np.diff(halt.commands, 2, axis=0) / STEP**2
    jerks = np.diff(accelerations, axis=0) / STEP
    assert np.max(np.abs(accelerations) / halt.limits.stop_acceleration) <= 1.0
    # A difference over a step sees a little more than the profile's own constant jerk.
    assert np.max(np.abs(jerks) / halt.limits.stop_jerk) <= 1.02


def test_no_node_goes_on_and_the_journal_is_complete(halt: Halt) -> None:
    ends = [timed.event for timed in halt.journal if isinstance(timed.event, RunEnded)]
    assert (halt.running, ends) == ([], [halt.journal[-1].event])
    assert ends[0].status == "HALTED"
    nodes = (timed.event for timed in halt.journal if isinstance(timed.event, NodeStarted | NodeEnded))
    assert not [
        event for event in {event.node: event for event in nodes}.values() if isinstance(event, NodeStarted)
    ]
