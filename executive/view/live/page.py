"""Live page, as the run sees it: a view that hands on news, and does what is wanted."""

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

from executive.cell.frame import Frame, FrameTaken
from executive.cell.visuals import Visuals
from executive.errors import InputError
from executive.events import FrameSearched, InputRead, TimedEvent
from executive.mission.outline import outline
from executive.processes import program
from executive.record.result import Result
from executive.run.run import Run
from executive.view.live.messages import CameraImage, Change, Message, Outcome, SceneChange, Wish, places_of
from executive.view.tree.svg import Note, svg

LOOPBACK = "127.0.0.1"
PERIOD = 1 / 10
"""Time between two looks at where everything is, while somebody watches [s]."""
SPARING_PERIOD = 2.5
"""The same where a browser draws without a graphics card, on the processor that the run needs [s]."""
GATHER = 0.03
"""Time for which news is gathered, so that it costs the run less [s]."""
SHUTDOWN_TIMEOUT = 3.0
"""Longest wait for the end of the page's server [s]."""
MAX_QUEUED_NEWS = 32
"""Length of the queue beyond which images [1 MB] and poses are left out."""
NEEDS = ("aiohttp", "trimesh", "viser")


class LivePage:
    """Shows a run to whoever opens `address`, and hands on what they want of it; implements `View`.

    While nobody watches it is told only of events, which are small. Whatever goes wrong with it, the run goes
    on without it.

    Attributes:
        address: Of the page; whoever knows it can see and command the run.

    Raises:
        InputError: The packages it needs are not installed.
    """

    def __init__(self) -> None:
        if missing := [name for name in NEEDS if find_spec(name) is None]:
            raise InputError(
                f"--view needs {', '.join(missing)}; install the extra: uv sync --extra view, "
                'or pip install "executive[view]"'
            )
        token = secrets.token_urlsafe(24)
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the page)
        with socket.create_server((LOOPBACK, 0)) as listener:
            port = listener.getsockname()[1]
            self.address = f"http://{LOOPBACK}:{port}/{token}/"
            self._server = subprocess.Popen(
                program("executive.view.live", str(listener.fileno())),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said,
                pass_fds=[listener.fileno()],
                # Out of reach of Ctrl-C: it ends when its input does, and says first how the run ended.
                start_new_session=True,
            )  # fmt: skip
        self._queue: queue.SimpleQueue[tuple[str, int] | Message | None] = queue.SimpleQueue()
        self._run: Run | None = None
        self._visuals: Visuals | None = None
        self._gone = False
        self._watched = 0
        self._due = 0.0
        self._period = PERIOD
        self._paused = False
        self._taken: Frame | None = None
        self._last_look: CameraImage | None = None
        self.problem = ""
        """What went wrong with the page first, or ""."""
        # Not as an argument: those can be read by everybody on the machine.
        self._queue.put((token, port))
        self._threads = [
            threading.Thread(target=work, name="page", daemon=True) for work in (self._send, self._listen)
        ]
        for thread in self._threads:
            thread.start()

    def open(self, run: Run) -> None:
        """Begin to show a run."""
        nodes = outline(run.root)
        mission = run.mission
        self._run = run
        with self._harmless():
            self._visuals = run.workcell.visuals()
        # A line in every node for what became of it so far.
        blank = {node.path: Note("", ("",)) for node in nodes}
        shapes = tuple(self._visuals.shapes) if self._visuals is not None else ()
        self._tell(SceneChange(shapes=shapes))
        self._tell(Change(tree=svg(nodes, mission, blank)))
        run.control.between_ticks(self._look_around)
        self._look_around()

    def __call__(self, timed: TimedEvent) -> None:
        """Send an event that changes the page."""
        event = timed.event
        with self._harmless():
            if isinstance(event, FrameTaken):
                # Depth, which the page does not show, is three times as large as the rest.
                self._taken = replace(event.frame, depth=None)
            elif isinstance(event, FrameSearched) and self._taken is not None:
                self._last_look = CameraImage(self._taken, event)
                if self._watched and self._keeps_up:
                    self._tell(self._last_look)
            elif not isinstance(event, InputRead):
                self._tell(timed)

    def close(self) -> None:
        """Go on without new events; `finish` says how the run ended."""

    def note(self, sentence: str) -> None:
        """Show a sentence about the record."""
        self._tell(Change(note=sentence))

    def finish(self, result: Result | None = None, report: str = "") -> None:
        """Say how the run ended, and end the page; more calls do nothing."""
        if not self._threads:
            return
        if result is not None:
            sentence = result.message if result.story is None else result.story.verdict
            self._tell(Change(result=Outcome(result.status, sentence, result.run, report)))
        self._queue.put(None)
        try:
            if self._server.wait(SHUTDOWN_TIMEOUT) != 0:
                self.problem = self.problem or f"the page ended before the run: {self._last_words()}"
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
        for thread in self._threads:
            thread.join()
        self._threads = []
        self._said.close()

    def _look_around(self) -> None:
        """Tell, now and then, where everything is; called between two ticks."""
        now = time.monotonic()
        if now < self._due or self._run is None:
            return
        self._due = now + self._period
        with self._harmless():
            if self._run.control.paused != self._paused:
                self._paused = not self._paused
                self._tell(Change(paused=self._paused))
            if self._watched and self._keeps_up and self._visuals is not None:
                self._tell(Change(clock=self._run.now))
                self._tell(SceneChange(bodies=places_of(self._visuals.poses())))

    @property
    def _keeps_up(self) -> bool:
        return self._queue.qsize() < MAX_QUEUED_NEWS

    def _tell(self, message: Message) -> None:
        if not self._gone:
            self._queue.put(message)

    @contextlib.contextmanager
    def _harmless(self) -> Iterator[None]:
        """Keep what goes wrong from the run: a page is not worth a motion that is cut off."""
        try:
            yield
        except Exception as error:
            self.problem = self.problem or f"not all was shown on the page: {type(error).__name__}: {error}"

    def _send(self) -> None:
        """Hand on what there is to tell, until there is nothing more."""
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
                    time.sleep(GATHER)
        self._gone = True

    def _last_words(self) -> str:
        """Return why the server ended, as far as it said so."""
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit status {self._server.returncode}"

    def _listen(self) -> None:
        """Do what the page wants, until it ends."""
        assert self._server.stdout is not None
        for line in self._server.stdout:
            with self._harmless():
                self._do(Wish(**json.loads(line)))
        self._watched, self._gone = 0, True

    def _do(self, wish: Wish) -> None:
        control = None if self._run is None else self._run.control
        if wish.do == "watched":
            self._watched = wish.watchers
            self._period = SPARING_PERIOD if wish.is_sparing else PERIOD
            if self._watched and self._last_look is not None:
                self._tell(self._last_look)
        elif control is not None and wish.do == "request":
            control.request(wish.word)
        elif control is not None:
            getattr(control, wish.do)()
