"""A process one can talk to without ever waiting for it longer than one wants to."""

from __future__ import annotations

import os
import selectors
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

CHUNK = 1 << 16
"""Bytes moved at once."""
WORDS = 2000
"""Bytes kept of what it says on its standard error."""
ENDING = 1.0
"""Longest time from the end of its output to its own [s]."""


class Process:
    """A child process that takes bytes and gives lines; out of reach of Ctrl-C.

    Raises:
        OSError: It could not be started.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str], folder: Path) -> None:
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0,
            env=environment, cwd=folder, start_new_session=True,
        )  # fmt: skip
        assert self._process.stdin and self._process.stdout and self._process.stderr
        self._in, self._out, self._err = self._process.stdin, self._process.stdout, self._process.stderr
        for pipe in (self._in, self._out, self._err):
            os.set_blocking(pipe.fileno(), False)
        self._said = b""
        self._words = b""

    @property
    def last_words(self) -> str:
        """The last line of its standard error that has been read so far, or ""."""
        lines = self._words.decode(errors="replace").strip().splitlines()
        return lines[-1].strip() if lines else ""

    def converse(self, data: bytes, until: float) -> bytes:
        """Give it `data` and return the next line that it says.

        Args:
            data: Anything, or nothing.
            until: When to give up, by `time.monotonic` [s].

        Raises:
            TimeoutError: It did not take the data or said no line by then.
            EOFError: It has ended.
        """
        unsent = memoryview(data)
        with selectors.DefaultSelector() as ready:
            ready.register(self._out, selectors.EVENT_READ)
            ready.register(self._err, selectors.EVENT_READ)
            if unsent:
                ready.register(self._in, selectors.EVENT_WRITE)
            while unsent or b"\n" not in self._said:
                left = until - time.monotonic()
                if left <= 0:
                    raise TimeoutError
                for key, _ in ready.select(left):
                    if key.fileobj is self._in:
                        unsent = unsent[self._give(unsent[:CHUNK]) :]
                        if not unsent:
                            ready.unregister(self._in)
                    elif key.fileobj is self._out:
                        self._hear()
                    elif not self._overhear():
                        ready.unregister(self._err)
        line, _, self._said = self._said.partition(b"\n")
        return line

    def kill(self) -> int:
        """End it at once, wherever it is, and return its exit status: below 0, the signal that ended it."""
        self._process.kill()
        return self._process.wait()

    def end(self) -> int:
        """Return the exit status of a process that has closed its output, and thus is at its end."""
        try:
            status = self._process.wait(ENDING)
        except subprocess.TimeoutExpired:
            status = self.kill()
        while self._overhear():
            pass
        return status

    def close(self) -> None:
        """Give the pipes back; nobody may be talking to it any more."""
        for pipe in (self._in, self._out, self._err):
            pipe.close()

    def _give(self, data: memoryview) -> int:
        """Return how much of `data` it took; all of it if it listens no more, which its output tells next."""
        try:
            return os.write(self._in.fileno(), data)
        except BlockingIOError:
            return 0
        except BrokenPipeError:
            return len(data)

    def _hear(self) -> None:
        chunk = os.read(self._out.fileno(), CHUNK)
        if not chunk:
            raise EOFError
        self._said += chunk

    def _overhear(self) -> bool:
        """Keep what it says on its standard error; return whether there can be more now."""
        try:
            chunk = os.read(self._err.fileno(), CHUNK)
        except BlockingIOError:
            return False
        self._words = (self._words + chunk)[-WORDS:]
        return bool(chunk)
