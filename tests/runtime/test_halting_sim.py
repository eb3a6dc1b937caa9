"""Ctrl-C at moments all over a simulated sort: what the arm does between the key and the standstill."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from py_trees.common import Status
from scipy.optimize import minimize_scalar

from executive.clock import STEP
from executive.discovery import discover
from executive.geometry import Array
from executive.mission.load import load_mission
from executive.motion.limits import JointLimits
from executive.motion.trajectory import Trajectory
from executive.record.journal import Journal, read_journal
from executive.runtime.run import Outcome, Run
from executive.sim.cell import SimCell
from executive.testing.oracle import oracle_cell

TICKS = [int(tick) for tick in np.linspace(40, 1900, 12)]
BEFORE, AFTER = 5, 6
"""Commands looked at before the key and control steps added after the run, so that no edge is missed."""


@dataclass(frozen=True)
class Halt:
    """A run that was halted.

    Attributes:
        tick: At which control step the key was pressed.
        outcome: How the run ended.
        path: The motion under way at the key, or None where the arm stood.
        commands: Joint positions `(N, 7)` [rad] sent to the arm, from `BEFORE` steps before the key on.
        measured: Joint positions `(N, 7)` [rad] of the arm in the steps after the end of the run.
        running: Nodes that still say they are running.
        journal: The entries of the journal.
    """

    tick: int
    outcome: Outcome
    path: Trajectory | None
    commands: Array
    measured: Array
    running: list[str]
    journal: list[dict[str, Any]]


def halt_at(tick: int, missions: Path, folder: Path) -> Halt:
    """Press Ctrl-C after `tick` control steps of a sort."""
    journal = Journal(folder / f"{tick}.jsonl")
    loaded = load_mission(missions / "sort_overhead.yaml", discover())
    run = Run(loaded, discover(), seed=2, kind=oracle_cell(), observers=[journal])
    workcell = run.workcell
    assert isinstance(workcell, SimCell)
    client, arm, advance = workcell._world.client, workcell._arm, workcell.advance
    send = client.setJointMotorControlArray
    last, commands, paths = arm.q, [], []

    def sent(*args: Any, targetPositions: list[float], **options: Any) -> None:
        nonlocal last
        last = np.array(targetPositions)
        send(*args, targetPositions=targetPositions, **options)

    def advanced() -> None:
        if len(commands) == tick:
            paths.append(arm._motion)
            os.kill(os.getpid(), signal.SIGINT)
        advance()
        commands.append(last)

    client.setJointMotorControlArray = sent
    workcell.advance = advanced  # type: ignore[method-assign]
    try:
        outcome = run.execute()
        measured = []
        for _ in range(AFTER):
            workcell.advance()
            measured.append(arm.q)
    finally:
        run.close()
        journal.close()
    return Halt(
        tick, outcome, paths[0], np.array(commands[tick - BEFORE :]), np.array(measured),
        [node.name for node in run.root.iterate() if node.status is Status.RUNNING],
        read_journal(folder / f"{tick}.jsonl"),
    )  # fmt: skip


@pytest.fixture(scope="module")
def halts(missions: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Halt]:
    folder = tmp_path_factory.mktemp("halts")
    return [halt_at(tick, missions, folder) for tick in TICKS]


@pytest.fixture(scope="module")
def limits(missions: Path) -> JointLimits:
    loaded = load_mission(missions / "sort_overhead.yaml", discover())
    return JointLimits.of(loaded.cell_config.arm.limits)


def moving(halts: list[Halt]) -> Iterator[tuple[Halt, Trajectory]]:
    """Yield the halts of a moving arm, each with the path it was on."""
    for halt in halts:
        if halt.path is not None:
            yield halt, halt.path


def distance(q: Array, path: Trajectory) -> float:
    """Return how far joint positions are from all that a motion passes [rad]."""
    near = int(np.argmin(np.abs(path.samples.q - q).max(axis=1))) * STEP
    bounds = near - STEP, near + STEP
    apart = minimize_scalar(
        lambda s: np.linalg.norm(path.at(s).q - q), bounds=bounds, method="bounded", options={"xatol": 1e-9}
    )
    return float(np.abs(path.at(apart.x).q - q).max())


def test_most_of_these_halts_meet_the_arm_on_the_move(halts: list[Halt]) -> None:
    assert len(list(moving(halts))) >= 8


def test_the_arm_is_at_rest_within_half_a_second(halts: list[Halt]) -> None:
    for halt in halts:
        assert (halt.outcome.status, halt.outcome.message) == ("HALTED", "halted by the user")
        assert halt.outcome.ticks - halt.tick <= 120, halt.tick
        assert np.ptp(halt.commands[-AFTER:], axis=0).max() == 0.0, halt.tick
        assert np.ptp(halt.measured, axis=0).max() < 1e-5, halt.tick


def test_braking_stays_on_the_planned_path(halts: list[Halt]) -> None:
    for halt, path in moving(halts):
        off = [distance(command, path) for command in halt.commands[BEFORE:]]
        assert max(off) < 1e-6, halt.tick


def test_braking_keeps_to_the_stop_limits(halts: list[Halt], limits: JointLimits) -> None:
    for halt, _ in moving(halts):
        accelerations = np.diff(halt.commands, 2, axis=0) / STEP**2
        jerks = np.diff(accelerations, axis=0) / STEP
        assert np.max(np.abs(accelerations) / limits.stop_acceleration) <= 1.0, halt.tick
        # A difference over a step sees a little more than the profile's own constant jerk.
        assert np.max(np.abs(jerks) / limits.stop_jerk) <= 1.02, halt.tick


def test_no_node_goes_on_and_the_journal_is_complete(halts: list[Halt]) -> None:
    for halt in halts:
        assert halt.running == [], halt.tick
        assert [entry["kind"] for entry in halt.journal].count("end") == 1
        assert halt.journal[-1]["kind"] == "end"
        assert halt.journal[-1]["status"] == "HALTED"
        statuses = [e for e in halt.journal if e["kind"] == "status"]
        left = {e["node"]: e["status"] for e in statuses}
        assert "RUNNING" not in left.values(), halt.tick


def test_the_next_run_in_the_same_process_succeeds(missions: Path, halts: list[Halt]) -> None:
    before = signal.getsignal(signal.SIGINT)
    loaded = load_mission(missions / "sort_overhead.yaml", discover())
    run = Run(loaded, discover(), seed=2, kind=oracle_cell())
    try:
        assert run.execute().status == "SUCCESS"
    finally:
        run.close()
    assert signal.getsignal(signal.SIGINT) is before
