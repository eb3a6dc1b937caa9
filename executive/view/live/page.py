"""Live page: a view that sends messages to the process of the page, and runs its commands."""

from __future__ import annotations

import contextlib
import json
import pickle
import queue
import secrets
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec

from executive.cell.frame import Frame, FrameCaptured
from executive.cell.visuals import Visuals
from executive.errors import InputError
from executive.events import FrameSearched, InputRead, TimedEvent
from executive.mission.outline import outline
from executive.processes import build_command
from executive.record.result import Result
from executive.run.run import Run
from executive.view.live.messages import (
    CameraImage,
    Change,
    Message,
    Outcome,
    PageCommand,
    SceneChange,
    encode_poses,
)
from executive.view.tree.svg import NodeNote, draw_svg

LOOPBACK = "127.0.0.1"
POSE_PERIOD = 1 / 10
"""Period at which poses are sent while a browser shows the page [s]."""
CPU_RENDERING_POSE_PERIOD = 2.5
"""Period at which poses are sent if a browser renders on the CPU, which the run needs [s]."""
BATCH_TIME = 0.03
"""Time for which messages are collected before they are sent [s]."""
SHUTDOWN_TIMEOUT = 3.0
"""Longest wait for the end of the page's server [s]."""
MAX_QUEUED_MESSAGES = 32
"""Queue length above which images [1 MB] and poses are dropped."""
REQUIRED_PACKAGES = ("aiohttp", "trimesh", "viser")


class LivePage:
    """Shows a run in browsers that open `address`, and runs their commands; implements `View`.

    While no browser shows the page, only events are sent, which are small. After an error of the page the run
    goes on without it.

    Attributes:
        address: Address of the page; every user who knows it can watch and control the run.

    Raises:
        InputError: A package in `REQUIRED_PACKAGES` is not installed.
    """

    def __init__(self) -> None:
        if missing := [name for name in REQUIRED_PACKAGES if find_spec(name) is None]:
            raise InputError(
                f"--view needs {', '.join(missing)}; install the extra: uv sync --extra view, "
                'or pip install "executive[view]"'
            )
        token = secrets.token_urlsafe(24)
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the page)
        with socket.create_server((LOOPBACK, 0)) as listener:
            port = listener.getsockname()[1]
            self.address = f"http://{LOOPBACK}:{port}/{token}/"
            self._server = subprocess.Popen(
                build_command("executive.view.live", str(listener.fileno())),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
                pass_fds=[listener.fileno()],
                # In a session of its own the server gets no Ctrl-C: it must still show the result of the run.
                start_new_session=True,
            )  # fmt: skip
        self._queue: queue.SimpleQueue[tuple[str, int] | Message | None] = queue.SimpleQueue()
        self._run: Run | None = None
        self._visuals: Visuals | None = None
        self._is_closed = False
        self._watchers = 0
        self._next_poses_at = 0.0
        self._period = POSE_PERIOD
        self._paused = False
        self._last_frame: Frame | None = None
        self._last_look: CameraImage | None = None
        self.problem = ""
        """Description of the first error of the page, or ""."""
        # Every user of the machine can read the arguments of a process: the token is sent instead.
        self._queue.put((token, port))
        self._threads = [
            threading.Thread(target=work, name="page", daemon=True) for work in (self._send, self._listen)
        ]
        for thread in self._threads:
            thread.start()

    def open(self, run: Run) -> None:
        """Show the tree and the scene of a run, and begin to send its state."""
        nodes = outline(run.root)
        mission = run.mission
        self._run = run
        with self._errors_noted():
            self._visuals = run.workcell.visuals()
        # Every node has a line for its counts.
        blank = {node.path: NodeNote("", ("",)) for node in nodes}
        shapes = tuple(self._visuals.shapes) if self._visuals is not None else ()
        self._enqueue(SceneChange(shapes=shapes))
        self._enqueue(Change(tree=draw_svg(nodes, mission, blank)))
        run.control.call_between_ticks(self._send_state)
        self._send_state()

    def __call__(self, timed: TimedEvent) -> None:
        """Send an event that changes the page."""
        event = timed.event
        with self._errors_noted():
            if isinstance(event, FrameCaptured):
                # The page does not show the depth, which is three times as large as the rest.
                self._last_frame = replace(event.frame, depth=None)
            elif isinstance(event, FrameSearched) and self._last_frame is not None:
                self._last_look = CameraImage(self._last_frame, event)
                if self._watchers and self._is_queue_short:
                    self._enqueue(self._last_look)
            elif not isinstance(event, InputRead):
                self._enqueue(timed)

    def close(self) -> None:
        """Do nothing: the page stays open until `finish`."""

    def note(self, sentence: str) -> None:
        """Show a sentence about the record."""
        self._enqueue(Change(note=sentence))

    def finish(self, result: Result | None = None, report: str = "") -> None:
        """Show the result of the run, and end the server; a second call does nothing."""
        if not self._threads:
            return
        if result is not None:
            sentence = result.message if result.story is None else result.story.verdict
            self._enqueue(Change(result=Outcome(result.status, sentence, result.run, report)))
        self._queue.put(None)
        try:
            if self._server.wait(SHUTDOWN_TIMEOUT) != 0:
                self.problem = self.problem or f"the page ended before the run: {self._last_error()}"
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
        for thread in self._threads:
            thread.join()
        self._threads = []
        self._errors.close()

    def _send_state(self) -> None:
        """Send the state of control and the poses if they are due; called between two ticks."""
        now = time.monotonic()
        if now < self._next_poses_at or self._run is None:
            return
        self._next_poses_at = now + self._period
        with self._errors_noted():
            if self._run.control.is_paused != self._paused:
                self._paused = not self._paused
                self._enqueue(Change(paused=self._paused))
            if self._watchers and self._is_queue_short and self._visuals is not None:
                self._enqueue(Change(clock=self._run.now))
                self._enqueue(SceneChange(bodies=encode_poses(self._visuals.poses())))

    @property
    def _is_queue_short(self) -> bool:
        return self._queue.qsize() < MAX_QUEUED_MESSAGES

    def _enqueue(self, message: Message) -> None:
        if not self._is_closed:
            self._queue.put(message)

    @contextlib.contextmanager
    def _errors_noted(self) -> Iterator[None]:
        """Note an exception as the problem of the page, so that the run continues."""
        try:
            yield
        except Exception as error:
            self.problem = self.problem or f"not all was shown on the page: {type(error).__name__}: {error}"

    def _send(self) -> None:
        """Send queued messages in batches until the end marker None."""
        assert self._server.stdin is not None
        over = False
        with contextlib.suppress(BrokenPipeError), self._server.stdin as pipe:
            while not over:
                batch = [self._queue.get()]
                while not self._queue.empty():
                    batch.append(self._queue.get())
                over = None in batch
                pickle.dump(
                    [message for message in batch if message is not None], pipe, pickle.HIGHEST_PROTOCOL
                )
                pipe.flush()
                if not over:
                    time.sleep(BATCH_TIME)
        self._is_closed = True

    def _last_error(self) -> str:
        """Return the last line of the server's error output, or its exit status."""
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit status {self._server.returncode}"

    def _listen(self) -> None:
        """Run the commands of the page until its server ends."""
        assert self._server.stdout is not None
        for line in self._server.stdout:
            with self._errors_noted():
                self._run_command(PageCommand(**json.loads(line)))
        self._watchers, self._is_closed = 0, True

    def _run_command(self, command: PageCommand) -> None:
        control = None if self._run is None else self._run.control
        if command.do == "watched":
            self._watchers = command.watchers
            self._period = CPU_RENDERING_POSE_PERIOD if command.is_sparing else POSE_PERIOD
            if self._watchers and self._last_look is not None:
                self._enqueue(self._last_look)
        elif control is not None and command.do == "request":
            control.add_request(command.word)
        elif control is not None:
            getattr(control, command.do)()
