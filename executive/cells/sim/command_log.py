"""Log of the commands to a simulated world, from which the world can be rebuilt.

Snapshots of PyBullet lose constraints and motor targets. Commands are deterministic: from the same initial
world, the same commands produce a bitwise identical world. After a header, the file contains one JSON list
per command: its kind and its arguments.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from executive.cells.log_file import LogFile
from executive.errors import InputError, explain_os_errors
from executive.motion.trajectory import Trajectory

FILE_HEADER = b"executive world 3\n"
"""First line of every log, with the version of the format."""

RUN_STEP = "step"
"""Kind of a physics step inside of a control step of the run."""
IDLE_STEP = "idle"
"""Kind of a physics step outside of the control steps."""
JOINT_TARGETS = "joints"
"""Kind of new joint targets; the arguments are the time in the motion [s] and the joint positions [rad]."""
MOTION = "motion"
"""Kind of the start of a motion; the arguments are its duration [s] and its samples as base64."""
MOTION_END = "rest"
VACUUM_ON = "vacuum on"
VACUUM_OFF = "vacuum off"
SEAL_BREAK = "seal break"
SET_POSE = "pose"
"""Kind of a new pose of an object; the arguments are its body, its position [m] and its quaternion."""
REMOVE = "remove"
"""Kind of the removal of an object; the argument is its body."""


class Command(NamedTuple):
    """One command in a log: its kind, for example `RUN_STEP`, and its arguments."""

    kind: str
    arguments: list[Any]


class CommandLog(LogFile):
    """Appends commands to a file, each before its execution.

    Args:
        path: Path of the file, or None to record nothing.
        resume: True to append to an existing file, from which an incomplete last command is removed.

    Raises:
        InputError: The file cannot be written, or is no log.
    """

    def __init__(self, path: Path | None = None, *, resume: bool = False) -> None:
        self._length = len(_read_complete_lines(path)) if path and resume else 0
        super().__init__(path, "the log of the world", self._length)
        if not resume:
            self._append(FILE_HEADER)

    def append(self, kind: str, *arguments: float | str) -> None:
        """Append a command."""
        self._append(json.dumps([kind, *arguments]).encode() + b"\n")

    def append_motion(self, motion: Trajectory) -> None:
        """Append the start of a motion with its states, so that a resumed run can brake along its path."""
        samples = np.stack(motion.samples).astype("<f8").tobytes()
        self.append(MOTION, motion.duration, base64.b64encode(samples).decode())

    def _append(self, data: bytes) -> None:
        self.write(data, self._length)
        self._length += len(data)


def read_commands(path: Path) -> Iterator[Command]:
    """Yield the commands of a log in order, without an incomplete last command.

    Raises:
        InputError: The file cannot be read, or is no valid log.
    """
    for number, line in enumerate(_read_complete_lines(path).split(b"\n")[1:-1], start=2):
        try:
            kind, *arguments = json.loads(line)
        except (ValueError, TypeError, RecursionError) as error:
            problem = f'the log of the world "{path}" is damaged in line {number}: {error}'
            cause = "somebody changed it after the run, or the disk lost a part of it"
            raise InputError(f"{problem}; {cause}; restore a copy") from error
        yield Command(kind, arguments)


def _read_complete_lines(path: Path) -> bytes:
    """Return the content of a log up to its last line feed."""
    consequence = "without it a simulated run can neither be resumed nor shown in a video"
    with explain_os_errors(InputError, f'cannot read the log of the world "{path}"', consequence):
        content = path.read_bytes()
    if not content.startswith(FILE_HEADER):
        header = FILE_HEADER.decode().strip()
        raise InputError(f'"{path}" is no log of a world: it does not begin with "{header}"')
    # A power failure may leave zero bytes at the end of the file.
    return content[: content.rfind(b"\n") + 1]
