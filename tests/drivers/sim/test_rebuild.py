"""A world rebuilt from its log is the world, to the last bit; its arm brakes on the path it was on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from executive.behaviours import load_skills
from executive.cell.device_config import STEP
from executive.drivers.sim.driver import SimDriver
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Trajectory
from executive.run.assembly import RunOptions, assemble
from executive.station.station import Station
from executive.testing.oracle import WorldAccess, make_oracle_kind
from tests.cut_off import Cut
from tests.meanwhile import meanwhile, rebuild

SEED = 3
TICKS = (1, 400, 777)


@dataclass(frozen=True)
class Left:
    """What a run that was cut off left: its world's log, and what the world was like."""

    log: Path
    state: str
    tick: int
    motion: Trajectory | None
    time: float


def driver_of(station: Station) -> SimDriver:
    assert isinstance(station.driver, SimDriver)
    return station.driver


def state_of(station: Station) -> str:
    """Everything that moves, and the seal."""
    world = driver_of(station).world
    tool = driver_of(station).tool
    joints = [joint[:2] for joint in world.client.getJointStates(world.arm, range(7))]
    bodies = [
        (body, world.client.getBasePositionAndOrientation(body), world.client.getBaseVelocity(body))
        for body in world.labels
    ]
    return repr((joints, bodies, tool.held_body, tool.pull, station.tick_count))


@pytest.fixture(scope="module")
def mission(missions: Path):
    return load_mission(missions / "sort_overhead.yaml", load_skills())


@pytest.fixture(scope="module")
def left(mission, tmp_path_factory: pytest.TempPathFactory) -> list[Left]:
    """One run, and what it would have left at some of its control steps."""
    folder = tmp_path_factory.mktemp("logs")
    run = assemble(mission, RunOptions(SEED, make_cell=make_oracle_kind()))
    cell = run.station
    cell.log_to(folder / "log")
    snapshots: list[Left] = []
    advance = cell.advance

    def advanced() -> None:
        advance()
        if cell.tick_count in TICKS:
            copy = folder / str(cell.tick_count)
            copy.write_bytes((folder / "log").read_bytes())
            arm = driver_of(cell).arm
            snapshots.append(Left(copy, state_of(cell), cell.tick_count, arm.motion, arm.motion_time))
        if cell.tick_count == max(TICKS):
            raise Cut

    cell.advance = advanced  # type: ignore[method-assign]
    with pytest.raises(Cut):
        run.execute()
    run.close()
    return snapshots


def rebuilt(mission, log: Path) -> Station:
    return rebuild(log, mission, SEED, make_oracle_kind())


@pytest.fixture
def cells(mission, left: list[Left], tmp_path: Path) -> Iterator[list[tuple[Left, Station]]]:
    pairs = []
    for number, one in enumerate(left):
        log = tmp_path / str(number)
        log.write_bytes(one.log.read_bytes())
        pairs.append((one, rebuilt(mission, log)))
    yield pairs
    for _, cell in pairs:
        cell.close()


def test_it_is_the_same_to_the_last_bit(cells: list[tuple[Left, Station]]) -> None:
    assert len(cells) == len(TICKS)
    assert any(one.motion is not None for one, _ in cells)
    for one, cell in cells:
        assert state_of(cell) == one.state, one.tick


def test_the_arm_brakes_on_the_path_it_was_on(cells: list[tuple[Left, Station]], mission) -> None:
    limits = JointLimits.from_config(mission.cell_config.arm.limits)
    for one, cell in cells:
        commands = (
            [] if one.motion is None else [one.motion.state_at(one.time - k * STEP).q for k in (2, 1, 0)]
        )
        for _ in range(240):
            if cell.cell.arm.at_rest:
                break
            cell.advance()
            assert one.motion is not None
            on_path = one.motion.state_at(driver_of(cell).arm.motion_time).q
            assert np.abs(driver_of(cell).arm.commanded_q - on_path).max() < 1e-7, one.tick
            commands.append(driver_of(cell).arm.commanded_q)
        assert cell.cell.arm.at_rest, one.tick
        if len(commands) > 3:
            accelerations = np.diff(commands, 2, axis=0) / STEP**2
            assert np.max(np.abs(accelerations) / limits.stop_acceleration) <= 1.001, one.tick


@pytest.mark.parametrize(
    "line", [b'["step", 0, 1]', b'["step", 0, 1e999, 0, 0, 0, 0, 0, 0]', b'["remove", 999]', b'["jump"]']
)
def test_an_impossible_command_is_refused(mission, left: list[Left], tmp_path: Path, line: bytes) -> None:
    log = tmp_path / "log"
    log.write_bytes(left[0].log.read_bytes() + line + b"\n")
    with pytest.raises(InputError, match="the log of the world is damaged"):
        rebuilt(mission, log)


def test_what_happened_meanwhile_is_there_and_took_none_of_the_runs_time(
    mission, left, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    log.write_bytes(left[1].log.read_bytes())
    moved: list[tuple[int, np.ndarray]] = []

    def act(world) -> None:
        held = world.held_object.body if world.held_object else None
        one, other = [thing for thing in world.objects if thing.body != held][:2]
        world.remove(other)
        world.move(one, (0.0, 0.3))
        moved.extend([(one.body, one.position + np.array([0.0, 0.3, 0.0])), (other.body, np.zeros(3))])

    meanwhile(log, mission, SEED, act, make_oracle_kind())
    cell = rebuilt(mission, log)
    things = {thing.body: thing.position for thing in WorldAccess(cell).objects}
    assert np.abs(things[moved[0][0]] - moved[0][1]).max() < 0.01
    assert moved[1][0] not in things
    assert (cell.tick_count, cell.cell.arm.at_rest) == (left[1].tick, True)
    cell.close()
