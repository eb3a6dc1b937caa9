"""Log of the commands to a simulated world, from which the world can be rebuilt.

Snapshots of PyBullet lose constraints and motor targets, while the same commands to the same world give
bitwise the same world.
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
"""Version of the format."""
MAX_JOINTS = 100
"""Largest number of joints of an arm."""
MAGIC = b"executive world "
"""Start of every log; the first line also has version and number of joints: `executive world 2 joints 7`."""
STEP, IDLE, CLOSE, OPEN, PART, JOINTS_TO, MOTION, DONE, PLACE, REMOVE = b"SICOPJMDXR"
"""Kinds of commands: a physics step of a run, and one between the parts of a run; vacuum on and off; a break
of the seal; joint targets; start and end of a motion; a new pose of an object, and its removal."""
_BODIES = {
    STEP: "", IDLE: "", CLOSE: "", OPEN: "", PART: "", DONE: "", MOTION: "2dI", PLACE: "i7d", REMOVE: "i",
}  # fmt: skip
"""Number formats of each command except JOINTS_TO, which has a time and one number for each joint."""


class Command(NamedTuple):
    """One command: its kind, its numbers, and the states `(N, 3 n)` of a motion."""

    kind: int
    numbers: tuple[float, ...] = ()
    states: Array | None = None


class CommandLog:
    """Appends commands to a file, each before its execution.

    Args:
        path: The file; None: nothing is recorded.
        joint_count: Number of joints of the arm.
        again: True continues an existing file, from which an incomplete last command is removed.

    Raises:
        InputError: The file cannot be written, or is no log.
    """

    def __init__(self, path: Path | None = None, joint_count: int = 0, *, again: bool = False) -> None:
        self._file: LogFile | None = None
        if path is None:
            return
        header = MAGIC + f"{VERSION} joints {joint_count}\n".encode()
        self._length = max((end for _, end in _commands(path)), default=len(header)) if again else 0
        self._file = LogFile(path, "the log of the world", self._length)
        if not again:
            try:
                self._append(header)
            except Fault as fault:
                raise InputError(str(fault)) from fault

    def note(self, kind: int, *numbers: float) -> None:
        """Append a command."""
        if self._file is not None:
            body = f"{len(numbers)}d" if kind == JOINTS_TO else _BODIES[kind]
            self._append(bytes([kind]) + struct.pack(f"<{body}", *numbers))

    def motion(self, motion: Trajectory) -> None:
        """Append the start of a motion with its states, so that a resumed run can brake on its path."""
        if self._file is not None:
            states = np.hstack(motion.samples)
            head = struct.pack(f"<{_BODIES[MOTION]}", motion.duration, motion.guarded_start_time, len(states))
            self._append(bytes([MOTION]) + head + states.astype("<f8").tobytes())

    def close(self) -> None:
        """Close the file; further calls do nothing."""
        if self._file is not None:
            self._file.close()

    def _append(self, data: bytes) -> None:
        assert self._file is not None
        self._file.write(data, self._length)
        self._length += len(data)


def is_log(path: Path) -> bool:
    """Return True if a file is a command log of a world.

    Raises:
        InputError: The file cannot be read.
    """
    return _content(path).startswith(MAGIC)


def read_commands(path: Path) -> Iterator[Command]:
    """Yield the commands of a log in order, except an incomplete last one.

    Raises:
        InputError: There is no such log.
    """
    for command, _ in _commands(path):
        yield command


def _commands(path: Path) -> Iterator[tuple[Command, int]]:
    """Yield the complete commands of a log, each with the position of its end in the file [byte]."""
    data = _content(path)
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
    place, joint_count = len(header) + 1, int(rest[1])
    bodies, state = {**_BODIES, JOINTS_TO: f"{1 + joint_count}d"}, 3 * joint_count
    while place < len(data):
        kind, start = data[place], place
        if kind not in bodies:
            if not data[place:].strip(b"\0"):
                # A power failure left the last blocks empty.
                return
            raise _make_damage_error(path, start)
        body = struct.Struct(f"<{bodies[kind]}")
        if place + 1 + body.size > len(data):
            return
        numbers = body.unpack_from(data, place + 1)
        place += 1 + body.size
        states = None
        if kind == MOTION:
            size = 8 * state * int(numbers[-1])
            if place + size > len(data):
                return
            states = np.frombuffer(data, "<f8", state * int(numbers[-1]), place).reshape(-1, state)
            place += size
        # The second number, the start of the guarded part, is infinite for a motion without one.
        finite = numbers if states is None else (numbers[0], *states.flat)
        if not all(map(math.isfinite, finite)):
            raise _make_damage_error(path, start)
        yield Command(kind, numbers, states), place


def _make_damage_error(path: Path, place: int) -> InputError:
    """Return the error for a log without a valid command at a position [byte]."""
    return InputError(
        f'the log of the world "{path}" is damaged at byte {place}: a log is only ever appended to, so '
        "somebody changed it after the run, or the disk lost a part of it; restore a copy"
    )


def _content(path: Path) -> bytes:
    without = "without it a simulated run can neither be taken up again nor filmed"
    with explain_os_errors(InputError, f'cannot read the log of the world "{path}"', without):
        return path.read_bytes()


def states_of(command: Command) -> JointState:
    """Return the states in a MOTION command as arrays `(N, n)`."""
    assert command.states is not None
    return JointState(*np.hsplit(command.states, 3))
