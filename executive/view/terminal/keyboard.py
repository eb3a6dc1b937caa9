"""Keys that control a run from its terminal: pause, continue, and one step."""

from __future__ import annotations

import os
import select
import termios
import threading
import tty
from typing import Any

from executive.run.run_control import RunControl

POLL_PERIOD = 0.1
"""Maximum time until the reading thread notices that it must end [s]."""
PAUSE_KEYS, STEP_KEY = "p ", "s"
"""Keys that pause or continue a run, and key that runs one control step."""
HELP = "p pause, s step, Ctrl-C stop"
"""Text about the keys while the run is not paused."""
HELP_PAUSED = "paused: p continue, s step, Ctrl-C stop"
"""Text about the keys while the run is paused."""


class KeyReader:
    """Reads single keys of a terminal in a thread, and controls a run; Ctrl-C still sends a signal.

    Args:
        file: File descriptor of the terminal.
        control: Control of the run.
    """

    def __init__(self, file: int, control: RunControl) -> None:
        self._file = file
        self._control = control
        self._saved_attributes: list[Any] | None = None
        self._must_stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start to read keys, if the thread does not run yet."""
        if self._thread is not None:
            return
        self._saved_attributes = termios.tcgetattr(self._file)
        tty.setcbreak(self._file)
        self._must_stop.clear()
        self._thread = threading.Thread(target=self._read, name="keys", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread, and restore the line mode of the terminal."""
        if self._thread is None:
            return
        self._must_stop.set()
        self._thread.join()
        self._thread = None
        assert self._saved_attributes is not None
        termios.tcsetattr(self._file, termios.TCSADRAIN, self._saved_attributes)

    def _read(self) -> None:
        while not self._must_stop.is_set():
            if select.select([self._file], [], [], POLL_PERIOD)[0]:
                try:
                    key = os.read(self._file, 1).decode("ascii", "ignore")
                except OSError:  # The terminal was closed.
                    return
                if not key:
                    return
                self._handle_key(key)

    def _handle_key(self, key: str) -> None:
        if key in PAUSE_KEYS:
            (self._control.resume if self._control.is_paused else self._control.pause)()
        elif key == STEP_KEY:
            self._control.step()
