"""Keys that control a run from its terminal: pause, continue, one step."""

from __future__ import annotations

import os
import select
import termios
import threading
import tty
from typing import Any

from executive.run.run_control import RunControl

POLL_PERIOD = 0.1
"""Longest time until the reading thread notices its end [s]."""
PAUSE, STEP = "p ", "s"
HELP = "p pause, s step, Ctrl-C stop"
HELP_PAUSED = "paused: p go on, s step, Ctrl-C stop"


class Keys:
    """Reads single keys in a thread; Ctrl-C stays a signal.

    Args:
        file: File descriptor of the terminal.
        control: Control of the run.
    """

    def __init__(self, file: int, control: RunControl) -> None:
        self._file = file
        self._control = control
        self._saved_attributes: list[Any] | None = None
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def listen(self) -> None:
        """Begin to read keys; do nothing if keys are already read."""
        if self._thread is not None:
            return
        self._saved_attributes = termios.tcgetattr(self._file)
        tty.setcbreak(self._file)
        self._stopped.clear()
        self._thread = threading.Thread(target=self._read, name="keys", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop reading keys, and restore the line mode of the terminal."""
        if self._thread is None:
            return
        self._stopped.set()
        self._thread.join()
        self._thread = None
        assert self._saved_attributes is not None
        termios.tcsetattr(self._file, termios.TCSADRAIN, self._saved_attributes)

    def _read(self) -> None:
        while not self._stopped.is_set():
            if select.select([self._file], [], [], POLL_PERIOD)[0]:
                try:
                    key = os.read(self._file, 1).decode("ascii", "ignore")
                except OSError:  # The terminal was closed.
                    return
                if not key:
                    return
                self._apply(key)

    def _apply(self, key: str) -> None:
        if key in PAUSE:
            (self._control.resume if self._control.is_paused else self._control.pause)()
        elif key in STEP:
            self._control.step()
