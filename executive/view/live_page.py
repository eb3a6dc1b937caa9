"""Live page: view of a run in browsers, with which a user watches and controls the run.

The page is served by another process, `live_server`, which gets messages and returns commands of browsers.
`PageState` is the state of the page in that process.
"""

from __future__ import annotations

import base64
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
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import cast

import numpy as np

from executive import events
from executive.cell.devices import Shape, Visuals
from executive.cell.frame import Frame, FrameCaptured
from executive.errors import InputError
from executive.events import FrameSearched, InputRead, TimedEvent
from executive.geometry import Pose
from executive.mission.outline import make_outline
from executive.plugins import DISTRIBUTION
from executive.processes import build_command
from executive.record.picture_recorder import encode_jpeg
from executive.record.result import Result
from executive.record.timeline import STATUS_TEXTS, Timeline
from executive.run.run import Run
from executive.view.drawing import NodeResult, make_svg

LOOPBACK = "127.0.0.1"
"""Network address at which the page is served."""
POSE_PERIOD = 1 / 10
"""Period at which poses are sent while a browser shows the page [s]."""
CPU_RENDERING_POSE_PERIOD = 2.5
"""Period at which poses are sent if a browser renders on the CPU and so slows down the run [s]."""
BATCH_PERIOD = 0.03
"""Period at which queued messages are sent in a batch [s]."""
SHUTDOWN_TIMEOUT = 3.0
"""Maximum time to wait for the end of the server process [s]."""
MAX_QUEUED_MESSAGES = 32
"""Length of the message queue at which images (about 1 MB each) and poses are dropped."""
REQUIRED_PACKAGES = ("aiohttp", "viser")
"""Optional dependencies of the project that the live page needs."""

OCCLUSION_DARKENING = 0.45
"""Fraction by which the brightness of pixels that the arm occludes is reduced: 0 not at all, 1 to black."""

ENDED_STATUSES = ("SUCCESS", "FAILURE", "INVALID")
"""Statuses of ended nodes; the page shows how often each node ended with each of them."""
SCENE_KEYS = ("shapes", "body_poses")
"""Fields of `PageChange` that belong to the scene, which `SceneProxy` serves."""
JsonObject = dict[str, object]
"""Values of a JSON object, by key."""
BodyPoses = Mapping[str, Sequence[float]]
"""Poses of all bodies by name: position [m] and quaternion (w, x, y, z), `(7,)`."""


@dataclass(frozen=True)
class PageChange:
    """Change of the page that no event of the run describes; None for unchanged values.

    Attributes:
        clock: Current time on the clock of the run [s].
        tree: Drawing of the tree as an SVG document.
        is_paused: True if the run is paused.
        note: Message about the record of the run.
        result: Outcome of the run: `status`, `message`, `run` directory, and file of the `report` or "".
        shapes: All shapes of the three-dimensional scene.
        body_poses: New poses of all bodies of the scene.
    """

    clock: float | None = None
    tree: str | None = None
    is_paused: bool | None = None
    note: str | None = None
    result: Mapping[str, str] | None = None
    shapes: Sequence[Shape] | None = None
    body_poses: BodyPoses | None = None


@dataclass(frozen=True)
class SearchedFrame:
    """Frame without its depth image, and the event with the detections in this frame."""

    frame: Frame
    search_event: FrameSearched


Message = TimedEvent | PageChange | SearchedFrame
"""Message from the run to the server of the page."""


@dataclass(frozen=True)
class PageCommand:
    """Command of a browser that shows the page, or a report of the server about the browsers.

    Attributes:
        name: `pause`, `resume`, `step`, `stop`, `request`, `empty_bins`; `render_on_cpu` if the browser
            renders on the CPU; `browsers` if the number of browsers changed.
        text: For `request`: the requested class, `rescan` or `quit`; for `empty_bins`: the bin.
        browser_count: For `browsers`: number of browsers.
        is_cpu_rendering: For `browsers`: True if a browser renders on the CPU, and so slows down the run.
    """

    name: str
    text: str = ""
    browser_count: int = 0
    is_cpu_rendering: bool = False


class LivePage:
    """View that shows a run in browsers, and runs the commands of the browsers.

    While no browser shows the page, images and poses are not sent. An error of the page does not affect the
    run.

    Attributes:
        address: Address of the page; every user who knows the address can watch and control the run.

    Raises:
        InputError: A package in `REQUIRED_PACKAGES` is not installed.
    """

    def __init__(self) -> None:
        if missing := [name for name in REQUIRED_PACKAGES if find_spec(name) is None]:
            advice = f'install the extra: uv sync --extra view, or pip install "{DISTRIBUTION}[view]"'
            raise InputError(f"--view needs {', '.join(missing)}; {advice}")
        token = secrets.token_urlsafe(24)
        self._error_file = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the page)
        with socket.create_server((LOOPBACK, 0)) as listener:
            port = listener.getsockname()[1]
            self.address = f"http://{LOOPBACK}:{port}/{token}/"
            self._server = subprocess.Popen(
                build_command("executive.view.live_server", str(listener.fileno())),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._error_file,
                pass_fds=[listener.fileno()],
                # In a separate session the server gets no Ctrl-C, and can still show the result of the run.
                start_new_session=True,
            )  # fmt: skip
        self._queue: queue.SimpleQueue[tuple[str, int] | Message | None] = queue.SimpleQueue()
        self._run: Run | None = None
        self._visuals: Visuals | None = None
        self._browser_count = 0
        self._next_pose_time = 0.0
        self._pose_period = POSE_PERIOD
        self._was_paused = False
        self._last_frame: Frame | None = None
        self._last_searched_frame: SearchedFrame | None = None
        self.problem = ""
        """Description of the first error of the page, or ""."""
        # The token is sent through the pipe, because every user of the machine can read process arguments.
        self._queue.put((token, port))
        self._threads = [
            threading.Thread(target=target, name="page", daemon=True)
            for target in (self._send_messages, self._read_commands)
        ]
        for thread in self._threads:
            thread.start()

    def open(self, run: Run) -> None:
        """Show the tree and the scene of a run, and start to send the state of the run."""
        nodes = make_outline(run.root)
        self._run = run
        with self._catch_errors():
            self._visuals = run.station.visuals()
        # In the empty line of each node, the page writes how often the node succeeded, failed and was halted.
        empty_results = {node.path: NodeResult("", ("",)) for node in nodes}
        shapes = tuple(self._visuals.shapes) if self._visuals is not None else ()
        self._enqueue(PageChange(tree=make_svg(nodes, run.mission, empty_results), shapes=shapes))
        run.control.call_between_ticks(self._send_state)
        self._send_state()

    def __call__(self, timed: TimedEvent) -> None:
        """Send an event that changes the page."""
        event = timed.event
        with self._catch_errors():
            if isinstance(event, FrameCaptured):
                # The page does not show the depth image, which is the largest part of a frame.
                self._last_frame = replace(event.frame, depth=None)
            elif isinstance(event, FrameSearched) and self._last_frame is not None:
                self._last_searched_frame = SearchedFrame(self._last_frame, event)
                if self._can_send_images:
                    self._enqueue(self._last_searched_frame)
            elif not isinstance(event, InputRead):
                self._enqueue(timed)

    def close(self) -> None:
        """Do nothing: the page stays open until `finish` is called."""

    def show_message(self, message: str) -> None:
        """Show a message about the record of the run."""
        self._enqueue(PageChange(note=message))

    def finish(self, result: Result | None = None, report_path: str = "") -> None:
        """Show the result of the run, and end the server; a second call does nothing."""
        if not self._threads:
            return
        if result is not None:
            outcome = {"status": result.status, "message": result.verdict, "run": result.run}
            self._enqueue(PageChange(result={**outcome, "report": report_path}))
        self._queue.put(None)
        try:
            if self._server.wait(SHUTDOWN_TIMEOUT) != 0:
                self._error_file.seek(0)
                lines = self._error_file.read().decode(errors="replace").strip().splitlines()
                cause = lines[-1] if lines else f"exit status {self._server.returncode}"
                self.problem = self.problem or f"the page ended before the run: {cause}"
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
        for thread in self._threads:
            thread.join()
        self._threads = []
        self._error_file.close()

    def _send_state(self) -> None:
        """Send pause state, time and poses once per pose period; called between the ticks of the run."""
        now = time.monotonic()
        if now < self._next_pose_time or self._run is None:
            return
        self._next_pose_time = now + self._pose_period
        with self._catch_errors():
            if self._run.control.is_paused != self._was_paused:
                self._was_paused = not self._was_paused
                self._enqueue(PageChange(is_paused=self._was_paused, clock=self._run.now))
            if self._can_send_images:
                poses = None if self._visuals is None else encode_poses(self._visuals.poses())
                self._enqueue(PageChange(clock=self._run.now, body_poses=poses))

    @property
    def _can_send_images(self) -> bool:
        """True if a browser shows the page and the queue is short enough for images and poses."""
        return self._browser_count > 0 and self._queue.qsize() < MAX_QUEUED_MESSAGES

    def _enqueue(self, message: Message) -> None:
        """Queue a message for the server, unless the server has ended."""
        if self._server.poll() is None:
            self._queue.put(message)

    @contextlib.contextmanager
    def _catch_errors(self) -> Iterator[None]:
        """Store an exception in `problem` instead of raising it, so that the run continues."""
        try:
            yield
        except Exception as error:
            self.problem = self.problem or f"the page is incomplete: {type(error).__name__}: {error}"

    def _send_messages(self) -> None:
        """Send the queued messages in batches, up to the end marker None."""
        assert self._server.stdin is not None
        is_last_batch = False
        with contextlib.suppress(BrokenPipeError), self._server.stdin as pipe:
            while not is_last_batch:
                batch = [self._queue.get()]
                while not self._queue.empty():
                    batch.append(self._queue.get())
                is_last_batch = None in batch
                pickle.dump(list(filter(None, batch)), pipe, pickle.HIGHEST_PROTOCOL)
                pipe.flush()
                if not is_last_batch:
                    time.sleep(BATCH_PERIOD)

    def _read_commands(self) -> None:
        """Run the commands that the server writes to stdout, until the server ends."""
        assert self._server.stdout is not None
        for line in self._server.stdout:
            with self._catch_errors():
                self._run_command(PageCommand(**json.loads(line)))
        self._browser_count = 0

    def _run_command(self, command: PageCommand) -> None:
        """Run a command of a browser; most command names are the names of methods of `RunControl`."""
        control = None if self._run is None else self._run.control
        if command.name == "browsers":
            self._browser_count = command.browser_count
            self._pose_period = CPU_RENDERING_POSE_PERIOD if command.is_cpu_rendering else POSE_PERIOD
            if self._browser_count and self._last_searched_frame is not None:
                self._enqueue(self._last_searched_frame)
        elif control is not None and command.name == "request":
            control.add_request(command.text)
        elif control is not None and command.name == "empty_bins":
            control.empty_bins(command.text)
        elif control is not None:
            getattr(control, command.name)()


def encode_poses(poses: Mapping[str, Pose]) -> BodyPoses:
    """Return positions [m] and quaternions of bodies by name; reorder (x, y, z, w) to (w, x, y, z)."""
    return {
        name: (*X_WB.position.tolist(), *np.roll(X_WB.quaternion, 1).tolist()) for name, X_WB in poses.items()
    }


class PageState:
    """State of the live page, updated by the messages of a run.

    Attributes:
        values: All values for `page.js` by key: nodes by path, items by name, and other values.
    """

    def __init__(self) -> None:
        self.values: JsonObject = {"is_paused": False, "has_ended": False, "nodes": {}, "items": {}}
        self._changes: JsonObject = {}
        self._timeline = Timeline(has_history=False)

    def apply(self, message: Message) -> None:
        """Update the state of the page for a message of the run."""
        match message:
            case events.TimedEvent():
                self._timeline(message)
                self._set_values(clock=message.clock)
                self._apply_event(message.event)
            case SearchedFrame():
                self._set_values(look=_encode_searched_frame(message))
            case PageChange():
                changes = vars(message).items()
                values = {key: value for key, value in changes if value is not None and key not in SCENE_KEYS}
                self._set_values(**values)

    def take_changes(self) -> JsonObject:
        """Return the values that changed since the last call, by key."""
        changes = self._changes
        self._changes = {}
        return changes

    def _apply_event(self, event: events.Event) -> None:
        match event:
            case events.NodeStarted(node) | events.NodeEnded(node):
                activation = self._timeline.activation_by_path[node]
                end_counts = self._timeline.end_counts.get(node, Counter())
                counts = {STATUS_TEXTS[status]: end_counts[status] for status in ENDED_STATUSES}
                entry = {"status": activation.status.lower(), "failure": activation.failure}
                self._set_entry("nodes", node, {**counts, **entry, "item": activation.item})
            case events.ItemChanged():
                self._set_entry("items", event.item, vars(event))
            case events.BinsEmptied():
                items = cast("JsonObject", self.values["items"])
                for name in items.keys() - self._timeline.items.changes.keys():
                    self._set_entry("items", name, None)
                    del items[name]
            case events.TargetSelected():
                self._set_values(decision=vars(event))
            case events.RunStarted():
                self._set_values(run={"mission": event.mission, "seed": event.seed})
            case events.OperatorAsked():
                self._set_values(choices=event.choices)
            case events.RequestGiven():
                self._set_values(choices=None)
            case events.RunEnded():
                self._set_values(choices=None, has_ended=True)

    def _set_values(self, **values: object) -> None:
        self.values |= values
        self._changes |= values

    def _set_entry(self, key: str, name: str, value: JsonObject | None) -> None:
        for values in (self.values, self._changes):
            entries = cast("JsonObject", values.setdefault(key, {}))
            entries[name] = value


def _encode_searched_frame(searched_frame: SearchedFrame) -> JsonObject:
    """Return the detections in a frame and its image as JPEG, darkened where the arm occludes the scene."""
    frame = searched_frame.frame
    image = frame.image.copy()
    if frame.visible is not None:
        occluded = ~frame.visible
        image[occluded] = (image[occluded] * (1 - OCCLUSION_DARKENING)).astype(np.uint8)
    height, width, _ = image.shape
    return {
        "source": "data:image/jpeg;base64," + base64.b64encode(encode_jpeg(image)).decode(),
        "width": width, "height": height, "frame": frame.id, "camera": frame.camera,
        "detector": searched_frame.search_event.detector, "stamp": frame.stamp,
        "detections": list(map(vars, searched_frame.search_event.confident)),
    }  # fmt: skip
