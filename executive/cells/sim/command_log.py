"""Log of the commands to a simulated world, from which the world can be rebuilt.

Snapshots of PyBullet lose constraints and motor targets. Commands are deterministic: from the same initial
world, the same commands produce a bitwise identical world.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from executive.cells.log_file import LogFile
from executive.errors import Fault, InputError, explain_os_errors
from executive.geometry import Array
from executive.motion.state import JointState
from executive.motion.trajectory import Trajectory

VERSION = 2
"""Version of the format of the log."""
MAX_JOINTS = 100
"""Maximum number of joints of an arm in a log."""
MAGIC = b"executive world "
"""Start of the first line of every log, which continues with version and joint count, as `2 joints 7`."""
RUN_STEP, IDLE_STEP, VACUUM_ON, VACUUM_OFF, SEAL_BREAK = b"SICOP"
"""Kinds of commands: a physics step in a control step of the run, a physics step outside of control steps,
vacuum on, vacuum off, and break of the seal."""
JOINT_TARGETS, MOTION, MOTION_END, SET_POSE, REMOVE = b"JMDXR"
"""More kinds: joint targets, start and end of a motion, new pose of an object, removal of an object."""
_PAYLOAD_FORMATS = {
    **dict.fromkeys((RUN_STEP, IDLE_STEP, VACUUM_ON, VACUUM_OFF, SEAL_BREAK, MOTION_END), ""),
    MOTION: "2dI", SET_POSE: "i7d", REMOVE: "i",
}  # fmt: skip
"""Formats (of `struct`) of the numbers of each kind except JOINT_TARGETS: a time and a position per joint."""


class Command(NamedTuple):
    """One command in a log.

    Attributes:
        kind: Kind of the command, one of the constants above.
        numbers: Arguments of the command.
        states: Positions, velocities and accelerations of the `n` joints at the `N` samples of a motion
            `(N, 3 n)`; None for other kinds.
    """

    kind: int
    numbers: tuple[float, ...] = ()
    states: Array | None = None


class CommandLog:
    """Appends commands to a file, each before its execution.

    Args:
        path: Path of the file, or None to record nothing.
        joint_count: Number of joints of the arm.
        resume: True to append to an existing file, from which an incomplete last command is removed.

    Raises:
        InputError: The file cannot be written, or is no log.
    """

    def __init__(self, path: Path | None = None, joint_count: int = 0, *, resume: bool = False) -> None:
        self._file: LogFile | None = None
        if path is None:
            return
        header = MAGIC + f"{VERSION} joints {joint_count}\n".encode()
        self._length = max((end for _, end in _read_with_ends(path)), default=len(header)) if resume else 0
        self._file = LogFile(path, "the log of the world", self._length)
        if not resume:
            try:
                self._write(header)
            except Fault as fault:
                raise InputError(str(fault)) from fault

    def append(self, kind: int, *numbers: float) -> None:
        """Append a command."""
        if self._file is not None:
            payload_format = f"{len(numbers)}d" if kind == JOINT_TARGETS else _PAYLOAD_FORMATS[kind]
            self._write(bytes([kind]) + struct.pack(f"<{payload_format}", *numbers))

    def append_motion(self, motion: Trajectory) -> None:
        """Append the start of a motion with its states, so that a resumed run can brake along its path."""
        if self._file is not None:
            states = np.hstack(motion.samples)
            numbers = motion.duration, motion.guarded_start_time, len(states)
            payload = struct.pack(f"<{_PAYLOAD_FORMATS[MOTION]}", *numbers) + states.astype("<f8").tobytes()
            self._write(bytes([MOTION]) + payload)

    def close(self) -> None:
        """Close the file; further calls do nothing."""
        if self._file is not None:
            self._file.close()

    def _write(self, data: bytes) -> None:
        assert self._file is not None
        self._file.write(data, self._length)
        self._length += len(data)


def is_command_log(path: Path) -> bool:
    """Return True if a file is the command log of a simulated world.

    Raises:
        InputError: The file cannot be read.
    """
    return _read_content(path).startswith(MAGIC)


def read_commands(path: Path) -> Iterator[Command]:
    """Yield the commands of a log in order, without an incomplete last command.

    Raises:
        InputError: The file cannot be read, or is no valid log.
    """
    for command, _ in _read_with_ends(path):
        yield command


def _read_with_ends(path: Path) -> Iterator[tuple[Command, int]]:
    """Yield the complete commands of a log, each with the offset of its end in the file [byte]."""
    data = _read_content(path)
    if not data.startswith(MAGIC):
        raise InputError(f'"{path}" is no log of a world: it does not begin with {MAGIC.decode().strip()!r}')
    header, _, _ = data.partition(b"\n")
    version, *rest = header.removeprefix(MAGIC).split()
    if version != str(VERSION).encode() or rest[:1] != [b"joints"]:
        raise InputError(
            f'the log of the world "{path}" has version {version.decode(errors="replace")}; this program '
            f"reads version {VERSION}; run the mission again"
        )
    if not (len(rest) == 2 and rest[1].isdigit() and 0 < int(rest[1]) <= MAX_JOINTS):
        raise InputError(f'the log of the world "{path}" does not state its number of joints; it was changed')
    offset, joint_count = len(header) + 1, int(rest[1])
    formats, state_size = {**_PAYLOAD_FORMATS, JOINT_TARGETS: f"{1 + joint_count}d"}, 3 * joint_count
    while offset < len(data):
        kind, start = data[offset], offset
        if kind not in formats:
            if not data[offset:].strip(b"\0"):
                # A power failure left the last blocks empty.
                return
            raise _make_damage_error(path, start)
        payload = struct.Struct(f"<{formats[kind]}")
        if offset + 1 + payload.size > len(data):
            return
        numbers = payload.unpack_from(data, offset + 1)
        offset += 1 + payload.size
        states = None
        if kind == MOTION:
            count = state_size * int(numbers[-1])
            if offset + 8 * count > len(data):
                return
            states = np.frombuffer(data, "<f8", count, offset).reshape(-1, state_size)
            offset += 8 * count
        # The second number of a motion is the start of its guarded part, infinite if there is no such part.
        finite_numbers = numbers if states is None else (numbers[0], *states.flat)
        if not all(map(math.isfinite, finite_numbers)):
            raise _make_damage_error(path, start)
        yield Command(kind, numbers, states), offset


def _make_damage_error(path: Path, offset: int) -> InputError:
    """Return the error for a log without a valid command at an offset [byte]."""
    return InputError(
        f'the log of the world "{path}" is damaged at byte {offset}: a log is only ever appended to, so '
        "somebody changed it after the run, or the disk lost a part of it; restore a copy"
    )


def _read_content(path: Path) -> bytes:
    consequence = "without it a simulated run can neither be resumed nor filmed"
    with explain_os_errors(InputError, f'cannot read the log of the world "{path}"', consequence):
        return path.read_bytes()


def get_joint_states(command: Command) -> JointState:
    """Return the states in a MOTION command as arrays `(N, n)`."""
    assert command.states is not None
    return JointState(*np.hsplit(command.states, 3))
