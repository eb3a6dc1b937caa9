"""The log of what was done to a world, torn or not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.cell.arm import Goal
from executive.cell.config import CellConfig
from executive.cells.sim import command_log as log
from executive.cells.sim.command_log import CommandLog, read_commands
from executive.errors import InputError
from executive.motion.arms import build_planner


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "world.log"


def test_it_reads_what_was_written_bit_by_bit(path: Path) -> None:
    written = CommandLog(path, 7)
    joints = (1 / 3, *np.random.default_rng(1).normal(size=7))
    written.append(log.VACUUM_ON)
    written.append(log.JOINT_TARGETS, *joints)
    written.append(log.RUN_STEP)
    written.append(log.SET_POSE, 7, *joints[:7])
    written.close()
    again = CommandLog(path, 7, resume=True)
    again.append(log.IDLE_STEP)
    again.close()
    read = list(read_commands(path))
    assert [one.kind for one in read] == [
        log.VACUUM_ON, log.JOINT_TARGETS, log.RUN_STEP, log.SET_POSE, log.IDLE_STEP,
    ]  # fmt: skip
    assert read[1].numbers == joints
    assert read[3].numbers == (7, *joints[:7])


def test_a_command_that_was_torn_is_left_out_wherever_it_was(path: Path, overhead: CellConfig) -> None:
    planner = build_planner(overhead)
    written = CommandLog(path, 7)
    written.append(log.RUN_STEP)
    whole = path.stat().st_size
    written.append(log.JOINT_TARGETS, *range(8))
    motion = planner.plan(np.radians(overhead.arm.poses_deg["home"]), Goal((0.5, 0.0, 0.1)))
    written.append_motion(motion)
    written.close()
    *_, command = read_commands(path)
    assert command.numbers[:2] == (motion.duration, motion.guarded_start_time)
    for one, other in zip(command.states, motion.samples, strict=True):
        assert np.array_equal(one, other)
    content = path.read_bytes()
    for length in (whole, whole + 1, whole + 64, whole + 65, whole + 70, len(content) - 1):
        path.write_bytes(content[:length])
        kinds = [one.kind for one in read_commands(path)]
        assert kinds == [log.RUN_STEP] + [log.JOINT_TARGETS] * (length >= whole + 65), length


def test_a_damaged_log_says_so(path: Path) -> None:
    written = CommandLog(path, 7)
    written.append(log.RUN_STEP)
    written.append(log.JOINT_TARGETS, *range(8))
    written.close()
    content = path.read_bytes()
    path.write_bytes(content + bytes(4096))
    assert [one.kind for one in read_commands(path)] == [log.RUN_STEP, log.JOINT_TARGETS]
    not_finite = content[:-8] + np.float64(np.nan).tobytes()
    for damaged in (content + b"?" + content, not_finite):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"is damaged at byte \d+: .* restore a copy"):
            list(read_commands(path))
    path.write_bytes(content.replace(b"joints 7", b"joints x"))
    with pytest.raises(InputError, match="does not state its number of joints"):
        list(read_commands(path))


def test_a_file_that_is_no_log_says_so(path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read the log of the world .*without it a simulated run"):
        list(read_commands(path))
    path.write_bytes(b"something else")
    with pytest.raises(InputError, match=r"is no log of a world: it does not begin with 'executive world'"):
        list(read_commands(path))
    with pytest.raises(InputError, match=r"cannot write .*: not a directory"):
        CommandLog(path / "below", 7)
    assert not log.is_command_log(path)
    CommandLog(path, 7).close()
    assert log.is_command_log(path)


@pytest.mark.parametrize("header", [b"executive world 1\n", b"executive world 3 arms 2\n"])
def test_a_log_of_another_version_is_refused_in_one_message(path: Path, header: bytes) -> None:
    path.write_bytes(header + b"SSS")
    version = header.split()[2].decode()
    with pytest.raises(
        InputError, match=rf"has version {version}; this program reads version 2; run the mission"
    ):
        list(read_commands(path))
    with pytest.raises(InputError, match="reads version 2"):
        CommandLog(path, 7, resume=True)
