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
from executive.errors import InputError, explain_os_errors
from executive.motion.joints import JointState
from executive.motion.trajectory import Trajectory

FORMAT_VERSION = 2
"""Version of the format of the log."""
MAX_JOINT_COUNT = 100
"""Maximum number of joints of an arm in a log."""
FILE_SIGNATURE = b"executive world "
"""Start of the first line of every log; version and joint count follow, for example `2 joints 7`."""
RUN_STEP, IDLE_STEP, VACUUM_ON, VACUUM_OFF, SEAL_BREAK = map(ord, "SICOP")
"""Kinds of commands, each the code of a letter: a physics step inside or outside of a control step of the
run, vacuum on, vacuum off, and break of the seal."""
JOINT_TARGETS, MOTION, MOTION_END, SET_POSE, REMOVE = map(ord, "JMDXR")
"""Kinds of commands: joint targets, start and end of a motion, new pose and removal of an object."""
_PAYLOAD_FORMATS = {
    **dict.fromkeys((RUN_STEP, IDLE_STEP, VACUUM_ON, VACUUM_OFF, SEAL_BREAK, MOTION_END), ""),
    MOTION: "2dI", SET_POSE: "i7d", REMOVE: "i",
}  # fmt: skip
"""Formats for `struct` of the arguments of each kind; the format of JOINT_TARGETS depends on the arm."""


class Command(NamedTuple):
    """One command in a log.

    Attributes:
        kind: Kind of the command, for example `RUN_STEP`.
        numbers: Arguments of the command.
        states: States of the joints at the samples of a motion, as arrays `(N, n)`; None for other kinds.
        end: Offset of the end of the command in the file [byte].
    """

    kind: int
    numbers: tuple[float, ...]
    states: JointState | None
    end: int


class CommandLog(LogFile):
    """Appends commands to a file, each before its execution.

    Args:
        path: Path of the file, or None to record nothing.
        joint_count: Number of joints of the arm.
        resume: True to append to an existing file, from which an incomplete last command is removed.

    Raises:
        InputError: The file cannot be written, or is no log.
    """

    def __init__(self, path: Path | None = None, joint_count: int = 0, *, resume: bool = False) -> None:
        header = FILE_SIGNATURE + f"{FORMAT_VERSION} joints {joint_count}\n".encode()
        self._length = 0
        if path and resume:
            self._length = max((command.end for command in read_commands(path)), default=len(header))
        super().__init__(path, "the log of the world", self._length)
        if not resume:
            self._append(header)

    def append(self, kind: int, *numbers: float, samples: bytes = b"") -> None:
        """Append a command, for a motion with the bytes of its `samples`."""
        payload_format = f"{len(numbers)}d" if kind == JOINT_TARGETS else _PAYLOAD_FORMATS[kind]
        self._append(bytes([kind]) + struct.pack(f"<{payload_format}", *numbers) + samples)

    def append_motion(self, motion: Trajectory) -> None:
        """Append the start of a motion with its states, so that a resumed run can brake along its path."""
        states = np.hstack(motion.samples)
        numbers = motion.duration, motion.guarded_start_time, len(states)
        self.append(MOTION, *numbers, samples=states.astype("<f8").tobytes())

    def _append(self, data: bytes) -> None:
        self.write(data, self._length)
        self._length += len(data)


def is_command_log(path: Path) -> bool:
    """Return True if a file is the command log of a simulated world.

    Raises:
        InputError: The file cannot be read.
    """
    return _read_content(path).startswith(FILE_SIGNATURE)


def read_commands(path: Path) -> Iterator[Command]:
    """Yield the commands of a log in order, without an incomplete last command.

    Raises:
        InputError: The file cannot be read, or is no valid log.
    """
    data = _read_content(path)
    if not data.startswith(FILE_SIGNATURE):
        signature = FILE_SIGNATURE.decode().strip()
        raise InputError(f'"{path}" is no log of a world: it does not begin with {signature!r}')
    header, _, _ = data.partition(b"\n")
    version, *joint_words = header.removeprefix(FILE_SIGNATURE).split()
    if version != str(FORMAT_VERSION).encode() or joint_words[:1] != [b"joints"]:
        raise InputError(
            f'the log of the world "{path}" has version {version.decode(errors="replace")}; this program '
            f"reads version {FORMAT_VERSION}; run the mission again"
        )
    joint_count = int(joint_words[1]) if len(joint_words) == 2 and joint_words[1].isdigit() else 0
    if not 0 < joint_count <= MAX_JOINT_COUNT:
        raise InputError(f'the log of the world "{path}" does not state its number of joints; it was changed')
    offset = len(header) + 1
    formats, state_size = {**_PAYLOAD_FORMATS, JOINT_TARGETS: f"{1 + joint_count}d"}, 3 * joint_count
    while offset < len(data):
        kind, command_offset = data[offset], offset
        if kind not in formats:
            if not data[offset:].strip(b"\0"):
                return  # a power failure left the last blocks empty
            raise _make_damage_error(path, command_offset)
        payload = struct.Struct(f"<{formats[kind]}")
        if offset + 1 + payload.size > len(data):
            return
        numbers = payload.unpack_from(data, offset + 1)
        offset += 1 + payload.size
        states = None
        if kind == MOTION:
            number_count = state_size * int(numbers[-1])
            if offset + 8 * number_count > len(data):
                return
            samples = np.frombuffer(data, "<f8", number_count, offset).reshape(-1, state_size)
            states = JointState(*np.hsplit(samples, 3))
            offset += 8 * number_count
        # The second number of a motion, the start time of the guarded part, is infinite without this part.
        finite_numbers = (numbers[0], *np.ravel(states)) if states else numbers
        if not all(map(math.isfinite, finite_numbers)):
            raise _make_damage_error(path, command_offset)
        yield Command(kind, numbers, states, offset)


def _make_damage_error(path: Path, offset: int) -> InputError:
    """Return the error for a log without a valid command at an offset [byte]."""
    return InputError(
        f'the log of the world "{path}" is damaged at byte {offset}: somebody changed it after the run, '
        "or the disk lost a part of it; restore a copy"
    )


def _read_content(path: Path) -> bytes:
    consequence = "without it a simulated run can neither be resumed nor filmed"
    with explain_os_errors(InputError, f'cannot read the log of the world "{path}"', consequence):
        return path.read_bytes()
