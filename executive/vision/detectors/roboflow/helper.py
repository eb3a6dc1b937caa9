"""The helper process seen from the detector: always there, whatever happens to it."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import executive
from executive.errors import Fault, Unavailable
from executive.programs import program
from executive.vision.detectors.roboflow.key import ApiKey
from executive.vision.detectors.roboflow.process import Process

PROGRAM = "executive.vision.detectors.roboflow"
STARTING = 30.0
"""Longest time that it may take to import inference-sdk [s]; measured: 2 s, and 6 s with the cores shared."""


class NoAnswer(Exception):
    """The time for an answer is over.

    Attributes:
        repeats: Why the server has been asked again meanwhile: statuses of HTTP, None for no connection.
    """

    def __init__(self, repeats: Sequence[int | None]) -> None:
        super().__init__()
        self.repeats = tuple(repeats)


class Helper:
    """Runs inference-sdk in a process of its own, from now until it is closed.

    Whoever asks waits no longer than wanted; a process that has not answered by then is killed, and
    the next one is on its way. One thread asks; another may stop it.

    Args:
        setup: Which server and model, as the program wants it.
        key: What it authenticates itself with.
    """

    def __init__(self, setup: Mapping[str, Any], key: ApiKey) -> None:
        self._command = program(PROGRAM, json.dumps(setup))
        self._key = key
        self._guard = threading.Lock()
        self._stopped = False
        self._process: Process | None = None
        self._not_started = ""
        self._unready_until = 0.0
        self._ready = False
        self._start()

    def wait_until_ready(self) -> None:
        """Return once the process has imported what it needs.

        Raises:
            Unavailable: It could not be started, or takes too long.
            Fault: It ended by itself.
        """
        if self._process is None:
            self._start()
        if self._process is None:
            raise Unavailable(f"its helper process is not running: {self._not_started}")
        if self._ready:
            return
        try:
            message = self._converse(b"", self._unready_until)
        except TimeoutError:
            raise Unavailable(f"its helper process was not ready within {STARTING:.0f} s") from None
        if "unusable" in message:
            self._end()
            raise Unavailable(
                f"inference-sdk cannot be used: {message['unusable']}; `executive doctor` checks packages"
            )
        self._ready = True

    def ask(self, image: NDArray[np.uint8], until: float) -> Mapping[str, Any]:
        """Return the `answer` to an image, or a `failure` with what was `said`; ready it must be.

        Args:
            image: `(H, W, 3)` RGB.
            until: When to give up, by `time.monotonic` [s].

        Raises:
            NoAnswer: There was none by then.
            Unavailable: The process was killed from outside.
            Fault: It ended by itself.
        """
        height, width = image.shape[:2]
        data = json.dumps({"width": width, "height": height}).encode() + b"\n" + image.tobytes()
        repeats: list[int | None] = []
        while True:
            try:
                message = self._converse(data, until)
            except TimeoutError:
                raise NoAnswer(repeats) from None
            if "again" not in message:
                return message
            repeats.append(message["again"])
            data = b""

    def stop(self) -> None:
        """End the process at once; whoever waits for it is told that it is unavailable."""
        with self._guard:
            self._stopped = True
            if self._process is not None:
                self._process.kill()

    def close(self) -> None:
        """Give everything back; nobody may be asking any more."""
        self.stop()
        self._end()

    def _converse(self, data: bytes, until: float) -> Mapping[str, Any]:
        """Return the next message; without one there is a new process when this raises."""
        process = self._process
        assert process is not None
        try:
            line = process.converse(data, until)
        except TimeoutError:
            self._end()
            self._start()
            raise
        except EOFError:
            status = process.end()
            words = self._key.hidden_in(process.last_words)
            self._end()
            self._start()
            if status < 0:
                raise Unavailable(f"its helper process was ended by signal {-status}") from None
            raise Fault(f"the program {PROGRAM} ended with status {status}: {words}") from None
        try:
            message: Mapping[str, Any] = json.loads(self._key.hidden_in(line.decode()))
        except RecursionError:
            # What the helper could just read and write again may be too deep for this stack.
            return {"failure": "garbled", "said": "it is nested too deeply"}
        return message

    def _start(self) -> None:
        """Start a process, unless that is over; it gets ready while others work."""
        with self._guard:
            if self._stopped:
                self._not_started = "the detector is closed"
                return
            try:
                self._process = Process(
                    self._command,
                    self._key.environment,
                    # -m looks for modules here first: in the user's folder it could find others.
                    Path(executive.__file__).parent.parent,
                )
            except OSError as error:
                self._not_started = (error.strerror or str(error)).lower()
                return
            self._unready_until = time.monotonic() + STARTING
            self._ready = False

    def _end(self) -> None:
        with self._guard:
            process, self._process = self._process, None
            if process is not None:
                process.kill()
                process.close()
