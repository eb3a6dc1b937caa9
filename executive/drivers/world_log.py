"""Log files from which the world of an interrupted run can be rebuilt.

Snapshots of PyBullet lose constraints and motor targets. Commands are deterministic: from the same initial
world, the same commands produce a bitwise identical world. A log of commands contains, after a header, one
JSON list per command: its kind and its arguments.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from executive.errors import Fault, InputError, describe_os_error, explain_os_errors
from executive.motion.trajectory import Trajectory
from executive.text.files import read_lines


class LogFile:
    """A file without a write buffer, so that a killed process loses no written data.

    Args:
        path: Path of the file.
        content_name: Name of the content, for the message of a fault.
        length: Length to which an existing file is truncated [byte], or None to keep its content.

    Raises:
        InputError: The file cannot be opened.
    """

    def __init__(self, path: Path, content_name: str, length: int | None = None) -> None:
        self._path = path
        self._content_name = content_name
        self._has_content = bool(length)
        self._file: int | None = None
        with explain_os_errors(InputError, f'cannot write "{path}"'):
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            if length is not None:
                os.ftruncate(self._file, length)

    def write(self, data: bytes, offset: int) -> None:
        """Write all data at an offset in the file [byte]; do nothing if the file is closed.

        Raises:
            InputError: The disk does not accept the first data.
            Fault: The disk does not accept later data. Later calls do nothing, so that the run can still
                bring the arm to rest.
        """
        try:
            while data and self._file is not None:
                byte_count = os.pwrite(self._file, data, offset)
                data = data[byte_count:]
                offset += byte_count
        except OSError as error:
            self.close()
            error_class = Fault if self._has_content else InputError
            raise error_class(
                f'{self._content_name} "{self._path}" cannot be written: {describe_os_error(error)}; '
                "the run stops, because without this file it could not be resumed after an interruption"
            ) from error
        self._has_content = True

    def close(self) -> None:
        """Close the file; do nothing if it is closed."""
        file = self._file
        self._file = None
        if file is not None:
            os.close(file)


MAX_LINE_LENGTH = 10_000_000
"""Maximum length of a command in a log [byte]; a motion of a minute has 3 MB."""
FILE_HEADER = b"executive world 4\n"
"""First line of every log of commands, with the version of the format."""

RUN_STEP = "step"
"""Kind of a physics step that belongs to the run. The arguments are none, or the time in the motion [s] and
the joint positions [rad] to which the step moves the arm."""
IDLE_STEP = "idle"
"""Kind of a physics step that does not belong to the run."""
MOTION = "motion"
"""Kind of the start of a motion; the arguments are its duration [s] and its samples as base64."""
MOTION_END = "rest"
CAPTURE = "capture"
"""Kind of the capture of an image, whose noise depends on its number."""
CLOSE = "close"
OPEN = "open"
GRIP_LOST = "grip lost"
SET_POSE = "pose"
"""Kind of a new pose of an object; the arguments are its body, its position [m] and its quaternion."""
REMOVE = "remove"
"""Kind of the removal of an object; the argument is its body."""
FORGET = "forget"
"""Kind of the removal of an object that the end of the run does not count; the argument is its body."""


class Command(NamedTuple):
    """One command to a simulated world: its kind, for example `RUN_STEP`, and its arguments."""

    kind: str
    arguments: list[Any]


class CommandLog(LogFile):
    """Appends commands to a file, each before its execution.

    Args:
        path: Path of the file.
        resume: True to append to an existing file, from which an incomplete last command is removed.

    Raises:
        InputError: The file cannot be written, or is no log.
    """

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        self._length = sum(map(len, _read_complete_lines(path))) if resume else 0
        super().__init__(path, "the log of the world", self._length)
        if not resume:
            self._append(FILE_HEADER)

    def append(self, kind: str, *arguments: float | str) -> None:
        """Append a command."""
        self._append(json.dumps([kind, *arguments]).encode() + b"\n")

    def _append(self, data: bytes) -> None:
        self.write(data, self._length)
        self._length += len(data)


def encode_motion(motion: Trajectory) -> tuple[float, str]:
    """Return the arguments of `MOTION`: a resumed run brakes along the path of the states of the motion."""
    samples = np.stack(motion.samples).astype("<f8").tobytes()
    return motion.duration, base64.b64encode(samples).decode()


def read_commands(path: Path) -> Iterator[Command]:
    """Yield the commands of a log in order, without an incomplete last command.

    Raises:
        InputError: The file cannot be read, or is no valid log.
    """
    for number, line in enumerate(_read_complete_lines(path), start=1):
        if number == 1:
            continue
        try:
            kind, *arguments = json.loads(line)
        except (ValueError, TypeError, RecursionError) as error:
            raise InputError(
                f'the log of the world "{path}" is damaged in line {number}: {error}; somebody changed it '
                "after the run, or the disk lost a part of it; restore a copy"
            ) from error
        yield Command(kind, arguments)


def _read_complete_lines(path: Path) -> Iterator[bytes]:
    """Yield the header and the complete lines of a log."""
    lines = read_lines(path, MAX_LINE_LENGTH)
    if next(lines, b"") != FILE_HEADER:
        header = FILE_HEADER.decode().strip()
        raise InputError(f'"{path}" is no log of a world: it does not begin with "{header}"')
    yield FILE_HEADER
    # A power failure may leave zero bytes at the end of the file.
    yield from (line for line in lines if line.endswith(b"\n"))
