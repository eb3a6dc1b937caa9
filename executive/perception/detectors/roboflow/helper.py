"""Helper process that runs inference-sdk, as the detector sees it: replaced whenever it gives no answer."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import executive
from executive.errors import Fault, Unavailable
from executive.perception.detectors.roboflow.key import ApiKey
from executive.processes import build_command

PROGRAM = "executive.perception.detectors.roboflow"
STARTUP_TIMEOUT = 30.0
"""Longest time to import inference-sdk [s]; measured: 2 s, and 6 s with the cores shared."""
EXIT_TIMEOUT = 1.0
"""Longest time from the end of the program's output to its own end [s]."""
MAX_STDERR = 2000
"""Bytes of the program's standard error in which its last line is sought."""


class NoAnswer(Exception):
    """The time for an answer is over.

    Attributes:
        repeats: Reasons for which the server has been asked again meanwhile: statuses of HTTP, None for no
            connection.
    """

    def __init__(self, repeats: Sequence[int | None]) -> None:
        super().__init__()
        self.repeats = tuple(repeats)


class Helper:
    """Runs inference-sdk in a process of its own, from now until it is closed.

    No call waits longer than it is allowed to: a process that has not answered by then is killed, and the
    next one is started. One thread asks; another one may stop the helper.

    Args:
        setup: Server and model, as the program wants them.
        key: Key by which the server knows its user.
    """

    def __init__(self, setup: Mapping[str, Any], key: ApiKey) -> None:
        self._command = build_command(PROGRAM, json.dumps(setup))
        self._key = key
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 It lives as long as the helper.
        self._guard = threading.Lock()
        self._is_stopped = False
        self._process: subprocess.Popen[bytes] | None = None
        self._problem = ""
        self._is_ready = False
        self._ready_by = 0.0
        self._start()

    def wait_until_ready(self) -> None:
        """Return once the process has imported its packages.

        Raises:
            Unavailable: It could not be started, or takes too long.
            Fault: It ended by itself.
        """
        if self._process is None:
            self._start()
        if self._process is None:
            raise Unavailable(f"its helper process is not running: {self._problem}")
        if self._is_ready:
            return
        try:
            message = self._converse(b"", self._ready_by)
        except TimeoutError:
            raise Unavailable(f"its helper process was not ready within {STARTUP_TIMEOUT:.0f} s") from None
        if "unusable" in message:
            self._end()
            raise Unavailable(
                f"inference-sdk cannot be used: {message['unusable']}; `executive doctor` checks packages"
            )
        self._is_ready = True

    def ask(self, image: NDArray[np.uint8], until: float) -> Mapping[str, Any]:
        """Return the `answer` to an image, or a `failure` with what was `said`; the process must be ready.

        Args:
            image: `(H, W, 3)` RGB.
            until: Time at which to give up, by `time.monotonic` [s].

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
        """End the process at once; a call under way raises `Unavailable`."""
        with self._guard:
            self._is_stopped = True
            if self._process is not None:
                _kill(self._process)

    def close(self) -> None:
        """Give everything back; no call may be under way."""
        self.stop()
        self._end()
        self._stderr.close()

    def _converse(self, data: bytes, until: float) -> Mapping[str, Any]:
        """Send `data` and return the next message; without one there is a new process when this raises."""
        process = self._process
        assert process is not None and process.stdin and process.stdout
        is_late = threading.Event()

        def give_up() -> None:
            is_late.set()
            _kill(process)

        # A killed process takes no data and says nothing more, so that neither call below waits for ever.
        timer = threading.Timer(max(until - time.monotonic(), 0.0), give_up)
        timer.start()
        try:
            with contextlib.suppress(BrokenPipeError):
                process.stdin.write(data)
                process.stdin.flush()
            line = process.stdout.readline()
        finally:
            timer.cancel()
            timer.join()
        if is_late.is_set():
            self._restart()
            raise TimeoutError
        if not line.endswith(b"\n"):
            self._raise_end(process)
        try:
            message: Mapping[str, Any] = json.loads(self._key.redact(line.decode()))
        except RecursionError:
            # The helper could just read and write it again; for this stack it may be too deep.
            return {"failure": "garbled", "said": "it is nested too deeply"}
        return message

    def _raise_end(self, process: subprocess.Popen[bytes]) -> None:
        """Replace a process that has closed its output, and raise the reason for its end."""
        try:
            status = process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            _kill(process)
            status = process.wait()
        self._stderr.seek(max(self._stderr.seek(0, os.SEEK_END) - MAX_STDERR, 0))
        lines = self._stderr.read().decode(errors="replace").strip().splitlines()
        self._restart()
        if status < 0:
            raise Unavailable(f"its helper process was ended by signal {-status}")
        last = self._key.redact(lines[-1].strip() if lines else "")
        raise Fault(f"the program {PROGRAM} ended with status {status}: {last}")

    def _restart(self) -> None:
        self._end()
        self._start()

    def _start(self) -> None:
        """Start a process, unless the helper is stopped; the process gets ready in the background."""
        with self._guard:
            if self._is_stopped:
                self._problem = "the detector is closed"
                return
            self._stderr.seek(0)
            self._stderr.truncate()
            try:
                self._process = subprocess.Popen(
                    self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._stderr,
                    env=self._key.environment,
                    # -m looks for modules here first: in the user's folder it could find others.
                    cwd=Path(executive.__file__).parent.parent,
                    start_new_session=True,  # Out of reach of Ctrl-C.
                )  # fmt: skip
            except OSError as error:
                self._problem = (error.strerror or str(error)).lower()
                return
            self._ready_by = time.monotonic() + STARTUP_TIMEOUT
            self._is_ready = False

    def _end(self) -> None:
        with self._guard:
            process, self._process = self._process, None
        if process is None:
            return
        _kill(process)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):  # Data that the process did not take.
                assert pipe is not None
                pipe.close()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a helper process and all processes that it started, which might hold its output open."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
