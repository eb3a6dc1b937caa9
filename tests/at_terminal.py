"""Commands as a person calls them at a terminal, as a pipe does, and in the process of a test."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from click.testing import CliRunner, Result

from executive.cli.main import main

COLOUR = re.compile(r"\x1b\[[\d;]*3\d[\d;]*m")
"""Sets the colour of letters; bold and dim are none."""


@dataclass(frozen=True)
class Called:
    """How a command ended, and what it wrote to the terminal or pipe that is its standard error."""

    code: int
    stderr: str


def invoke(*words: object) -> Result:
    """Call `executive` in this process."""
    return CliRunner().invoke(main, [str(word) for word in words])


def call(*words: str, folder: Path, terminal: bool, **environment: str) -> Called:
    """Call `executive` in a folder, its standard error a terminal or a pipe."""
    inner = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR")}
    reader, writer = pty.openpty() if terminal else os.pipe()
    command = subprocess.Popen(
        [sys.executable, "-m", "executive.cli.main", *words], cwd=folder, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=writer, env={**inner, "TERM": "xterm-256color", **environment},
    )  # fmt: skip
    os.close(writer)
    written = b""
    while part := _read(reader):
        written += part
    os.close(reader)
    return Called(command.wait(), written.decode())


def _read(reader: int) -> bytes:
    try:
        return os.read(reader, 65536)
    except OSError:  # So a terminal ends that nobody writes to any more.
        return b""
