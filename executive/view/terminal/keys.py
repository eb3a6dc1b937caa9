"""Keys of the terminal in which a run is watched: pause, go on, take one step."""

from __future__ import annotations

import os
import select
import termios
import threading
import tty
from typing import Any

from executive.run.run_control import RunControl

SLICE = 0.1
"""Longest time until a key is no longer waited for [s]."""
PAUSE, STEP = "p ", "s"
HELP = "p pause, s step, Ctrl-C stop"
HELP_PAUSED = "paused: p go on, s step, Ctrl-C stop"


class Keys:
    """Reads keys in a thread of its own, without waiting for the end of a line; Ctrl-C stays a signal.

    Args:
        file: The terminal's file descriptor.
        control: The run's.
    """

    def __init__(self, file: int, control: RunControl) -> None:
        self._file = file
        self._control = control
        self._lines: list[Any] | None = None
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def listen(self) -> None:
        """Take the keyboard; it does nothing where it has it."""
        if self._thread is not None:
            return
        self._lines = termios.tcgetattr(self._file)
        tty.setcbreak(self._file)
        self._over.clear()
        self._thread = threading.Thread(target=self._read, name="keys", daemon=True)
        self._thread.start()

    def leave(self) -> None:
        """Give the keyboard back, as it was, to whoever wants to read lines."""
        if self._thread is None:
            return
        self._over.set()
        self._thread.join()
        self._thread = None
        assert self._lines is not None
        termios.tcsetattr(self._file, termios.TCSADRAIN, self._lines)

    def _read(self) -> None:
        while not self._over.is_set():
            if select.select([self._file], [], [], SLICE)[0]:
                try:
                    key = os.read(self._file, 1).decode("ascii", "ignore")
                except OSError:  # The terminal was closed.
                    return
                if not key:
                    return
                self._do(key)

    def _do(self, key: str) -> None:
        if key in PAUSE:
            (self._control.resume if self._control.paused else self._control.pause)()
        elif key in STEP:
            self._control.step()
