"""Keys that control a run from the terminal: pause, continue, and one step."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import threading
import tty

from executive.run.run_control import RunControl

POLL_PERIOD = 0.1
"""Maximum time until the reading thread notices that it must end [s]."""
PAUSE_KEYS, STEP_KEY = (b"p", b" "), b"s"
"""Keys that pause or continue a run, and key that runs one control step."""
HELP = "p pause, s step, Ctrl-C stop"
"""Text about the keys while the run is not paused."""
HELP_PAUSED = "paused: p continue, s step, Ctrl-C stop"
"""Text about the keys while the run is paused."""


class KeyReader:
    """Thread that reads single keys from the file descriptor of a terminal, and controls a run."""

    def __init__(self, descriptor: int, control: RunControl) -> None:
        self.control = control
        self._descriptor = descriptor
        self._saved_attributes = termios.tcgetattr(descriptor)
        self._must_stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread unless it is running; Ctrl-C still sends a signal while the thread reads keys."""
        if self._thread is not None:
            return
        tty.setcbreak(self._descriptor)
        self._must_stop.clear()
        self._thread = threading.Thread(target=self._read_keys, name="keys", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread, and restore the line mode of the terminal."""
        if self._thread is None:
            return
        self._must_stop.set()
        self._thread.join()
        self._thread = None
        termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._saved_attributes)

    def _read_keys(self) -> None:
        """Handle keys until the thread must stop or the terminal is closed."""
        with contextlib.suppress(OSError):
            while not self._must_stop.is_set():
                if select.select([self._descriptor], [], [], POLL_PERIOD)[0]:
                    key = os.read(self._descriptor, 1)
                    if not key:
                        return
                    self._handle_key(key)

    def _handle_key(self, key: bytes) -> None:
        if key == STEP_KEY:
            self.control.step()
        elif key in PAUSE_KEYS and self.control.is_paused:
            self.control.resume()
        elif key in PAUSE_KEYS:
            self.control.pause()
