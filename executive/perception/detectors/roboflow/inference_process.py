"""Helper process that runs inference-sdk and is replaced after a missed deadline; API key of the user."""

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
from executive.processes import build_command

KEY_VARIABLE = "ROBOFLOW_API_KEY"
"""Environment variable with the API key, the only source of the key."""
MIN_KEY_LENGTH = 8
"""Minimum length of a secret key; shorter keys are placeholders for servers that accept any key."""
REDACTED_KEY = "***"
"""Text that replaces the key in messages."""
PROGRAM = "executive.perception.detectors.roboflow"
"""Module that the helper process runs."""
STARTUP_TIMEOUT = 30.0
"""Maximum time for the import of inference-sdk [s]; measured: 2 s, and 6 s on shared cores."""
EXIT_TIMEOUT = 1.0
"""Maximum time between the end of the program's output and the exit of the program [s]."""
MAX_STDERR_SIZE = 2000
"""Maximum number of bytes at the end of the standard error that are read for an error message."""


class ApiKey:
    """API key from the environment; only the attribute `environment` contains the key as text."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self.environment = dict(environment)
        """Environment variables of the process that uses the key."""
        self._key = environment.get(KEY_VARIABLE, "").strip()

    @property
    def is_set(self) -> bool:
        """True if the environment contains a key."""
        return bool(self._key)

    def redact(self, text: str) -> str:
        """Return `text`, plain or JSON, without the key."""
        if len(self._key) < MIN_KEY_LENGTH:
            return text
        return text.replace(self._key, REDACTED_KEY).replace(json.dumps(self._key)[1:-1], REDACTED_KEY)

    def __repr__(self) -> str:
        return f"ApiKey({REDACTED_KEY if self.is_set else ''})"


class NoAnswer(Exception):
    """The server did not answer before the deadline.

    Attributes:
        retry_causes: HTTP statuses that caused retries before the deadline; None for no connection.
    """

    def __init__(self, retry_causes: Sequence[int | None]) -> None:
        super().__init__()
        self.retry_causes = tuple(retry_causes)


class InferenceProcess:
    """Helper process that runs inference-sdk; the constructor starts the process, and `close` ends it.

    If the process does not answer before the deadline of a call, the process is killed and replaced. One
    thread sends requests; another thread may call `stop`.

    Args:
        settings: Server, model or workflow, and minimum confidence, for the program.
        key: API key of the user.
    """

    def __init__(self, settings: Mapping[str, Any], key: ApiKey) -> None:
        self._command = build_command(PROGRAM, json.dumps(settings))
        self._key = key
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 `close` closes the file.
        self._lock = threading.Lock()
        self._is_stopped = False
        self._process: subprocess.Popen[bytes] | None = None
        self._is_ready = False
        self._startup_deadline = 0.0
        self._try_to_start()

    def wait_until_ready(self) -> None:
        """Wait until the process has imported inference-sdk.

        Raises:
            Unavailable: The process could not be started, or was not ready within `STARTUP_TIMEOUT`.
            Fault: The process exited.
        """
        if self._process is None:
            self._start()
        if self._is_ready:
            return
        try:
            message = self._send_and_receive(b"", self._startup_deadline)
        except TimeoutError:
            raise Unavailable(f"its helper process was not ready within {STARTUP_TIMEOUT:.0f} s") from None
        if "setup_error" in message:
            self._discard_process()
            problem = f"inference-sdk cannot be used: {message['setup_error']}"
            raise Unavailable(f"{problem}; `executive doctor` checks packages")
        self._is_ready = True

    def request(self, image: NDArray[np.uint8], deadline: float) -> Mapping[str, Any]:
        """Send an image to the ready process; return a mapping with `answer`, or with `failure` and `detail`.

        Args:
            image: `(H, W, 3)` RGB.
            deadline: Latest time of the answer, on the clock `time.monotonic` [s].

        Raises:
            NoAnswer: There was no answer before the deadline.
            Unavailable: Another process killed the helper process.
            Fault: The process exited.
        """
        height, width = image.shape[:2]
        data = json.dumps({"width": width, "height": height}).encode() + b"\n" + image.tobytes()
        retry_causes: list[int | None] = []
        while True:
            try:
                message = self._send_and_receive(data, deadline)
            except TimeoutError:
                raise NoAnswer(retry_causes) from None
            if "retry_status" not in message:
                return message
            retry_causes.append(message["retry_status"])
            data = b""

    def stop(self) -> None:
        """Kill the process; a concurrent call of `request` or `wait_until_ready` raises `Unavailable`."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                _kill(self._process)

    def close(self) -> None:
        """Release all resources; no other call may be active."""
        self.stop()
        self._discard_process()
        self._stderr.close()

    def _send_and_receive(self, data: bytes, deadline: float) -> Mapping[str, Any]:
        """Send `data` and return the next message of the process; replace a late or exited process."""
        process = self._process
        assert process is not None and process.stdin and process.stdout
        is_late = threading.Event()

        def kill_late_process() -> None:
            is_late.set()
            _kill(process)

        # A killed process closes its pipes, so that neither `write` nor `readline` below waits forever.
        timer = threading.Timer(max(deadline - time.monotonic(), 0.0), kill_late_process)
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
            self._raise_exit_error(process)
        try:
            message: Mapping[str, Any] = json.loads(self._key.redact(line.decode()))
        except RecursionError:
            # The parser of the helper process reaches its recursion limit later: fewer calls are active.
            return {"failure": "invalid", "detail": "the answer is nested too deeply"}
        return message

    def _raise_exit_error(self, process: subprocess.Popen[bytes]) -> None:
        """Replace a process that has closed its output, and raise an error with the cause of its exit."""
        try:
            status = process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            _kill(process)
            status = process.wait()
        self._stderr.seek(max(self._stderr.seek(0, os.SEEK_END) - MAX_STDERR_SIZE, 0))
        lines = self._stderr.read().decode(errors="replace").strip().splitlines()
        self._restart()
        if status < 0:
            raise Unavailable(f"its helper process was ended by signal {-status}")
        last_line = self._key.redact(lines[-1].strip() if lines else "")
        raise Fault(f"the program {PROGRAM} ended with status {status}: {last_line}")

    def _restart(self) -> None:
        self._discard_process()
        self._try_to_start()

    def _try_to_start(self) -> None:
        """Start a process in the background, if possible."""
        with contextlib.suppress(Unavailable):
            self._start()

    def _start(self) -> None:
        """Start a process in the background.

        Raises:
            Unavailable: The helper is stopped, or the process could not be started.
        """
        with self._lock:
            if self._is_stopped:
                raise Unavailable("its helper process is not running: the detector is closed")
            self._stderr.seek(0)
            self._stderr.truncate()
            try:
                self._process = subprocess.Popen(
                    self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._stderr,
                    env=self._key.environment,
                    # `-m` searches the working folder first; the user's folder could contain other modules.
                    cwd=Path(executive.__file__).parent.parent,
                    start_new_session=True,  # Ctrl-C does not interrupt the process.
                )  # fmt: skip
            except OSError as error:
                cause = (error.strerror or str(error)).lower()
                raise Unavailable(f"its helper process is not running: {cause}") from error
            self._startup_deadline = time.monotonic() + STARTUP_TIMEOUT
            self._is_ready = False

    def _discard_process(self) -> None:
        """Kill the process, if any, and close its pipes."""
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return
        _kill(process)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):  # Closing flushes unsent data, which fails for a dead process.
                assert pipe is not None
                pipe.close()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a helper process and all processes that it started, which might hold its output open."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
