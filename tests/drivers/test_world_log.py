"""The log of what was done to a world, torn or not."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest

from executive.cell.arm import Goal
from executive.drivers.world_log import (
    IDLE_STEP,
    MOTION,
    OPEN,
    RUN_STEP,
    CommandLog,
    encode_motion,
    read_commands,
)
from executive.errors import InputError
from executive.motion.planner import Planner
from executive.testing.fake_cell import load_empty_cell


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "world.log"


def test_it_reads_what_was_written_bit_by_bit(path: Path) -> None:
    cell = load_empty_cell()
    written = CommandLog(path)
    joints = [1 / 3, *np.random.default_rng(1).normal(size=7)]
    motion = Planner(cell).plan(np.radians(cell.arm.poses_deg["home"]), Goal((0.5, 0.0, 0.1)))
    written.append(RUN_STEP, *joints)
    written.append(MOTION, *encode_motion(motion))
    written.close()
    written.close()
    again = CommandLog(path, resume=True)
    again.append(IDLE_STEP)
    again.close()
    targets, started, idle = read_commands(path)
    assert targets == (RUN_STEP, joints)
    assert idle == (IDLE_STEP, [])
    assert started.arguments[0] == motion.duration
    samples = np.frombuffer(base64.b64decode(started.arguments[1])).reshape(3, -1, 7)
    assert np.array_equal(samples, motion.samples)


def test_a_torn_command_is_left_out_and_overwritten(path: Path) -> None:
    written = CommandLog(path)
    written.append(RUN_STEP)
    whole = path.stat().st_size
    written.append(RUN_STEP, *range(8))
    written.close()
    content = path.read_bytes()
    for length in (whole, whole + 1, len(content) - 1):
        path.write_bytes(content[:length] + bytes(4096))
        assert [one.kind for one in read_commands(path)] == [RUN_STEP], length
    again = CommandLog(path, resume=True)
    again.append(OPEN)
    again.close()
    assert [one.kind for one in read_commands(path)] == [RUN_STEP, OPEN]


def test_a_damaged_log_says_so(path: Path) -> None:
    written = CommandLog(path)
    written.append(RUN_STEP)
    written.close()
    path.write_bytes(path.read_bytes().replace(b'"', b"") + b'["step"]\n')
    with pytest.raises(InputError, match=r"is damaged in line 2: .* restore a copy"):
        list(read_commands(path))


def test_a_file_that_is_no_log_says_so(path: Path) -> None:
    with pytest.raises(InputError, match="there is no file"):
        list(read_commands(path))
    path.write_bytes(b"executive world 2 joints 7\nS")
    with pytest.raises(InputError, match="is no log of a world"):
        CommandLog(path, resume=True)
    with pytest.raises(InputError, match=r"cannot write .*: not a directory"):
        CommandLog(path / "below")
