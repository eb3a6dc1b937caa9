"""Who writes a run's record: one process, for as long as it has the journal open."""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path

from executive.errors import InputError

LOCKS = Path("/proc/locks")
"""Where Linux lists who holds which lock."""


def lock(file: int, path: Path) -> None:
    """Make this process the only one that writes the open `file`, until it closes it or ends in any way.

    Raises:
        InputError: Another one, or another part of this process, writes it already.
        OSError: The file system has no locks.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = _holder(file)
        named, end = (f"process {holder}", f'"kill {holder}"') if holder else ("another process", "Ctrl-C")
        raise InputError(
            f'the run directory "{path.parent}" is in use: {named} writes its journal, and two runs cannot '
            f"share it; wait until that run has ended, or end it with {end}"
        ) from error


def _holder(file: int) -> int | None:
    """Return the number of the process that holds the lock on `file`, or None where nobody tells."""
    state = os.fstat(file)
    named = f"{os.major(state.st_dev):02x}:{os.minor(state.st_dev):02x}:{state.st_ino}"
    with contextlib.suppress(OSError):
        for line in LOCKS.read_text().splitlines():
            # 1: FLOCK  ADVISORY  WRITE 4711 fe:00:5309462 0 EOF
            fields = line.split()
            if fields[1:2] == ["FLOCK"] and fields[5] == named and int(fields[4]) > 0:
                return int(fields[4])
    return None
