"""Server of the live page, in a process of its own: page state, 3-D scene, access, files and messages.

The server reads messages of the run from stdin, and writes commands of browsers to stdout. It listens on the
loopback address. Every request must come from the page itself and contain the secret token in the page
address, so that no other page can read or control the run.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import os
import pickle
import secrets
import socket
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, cast

import aiohttp
import numpy as np
from aiohttp import WSMsgType, web
from aiohttp.typedefs import Handler

from executive import events
from executive.cell.devices import Shape
from executive.record.picture_recorder import encode_jpeg
from executive.record.timeline import STATUS_TEXTS, Timeline
from executive.view.live_page import LOOPBACK, Message, PageChange, PageCommand, SearchedFrame

if TYPE_CHECKING:
    from executive.view.live_scene import LiveScene

OCCLUSION_DARKENING = 0.45
"""Fraction by which the brightness of pixels that the arm occludes is reduced: 0 not at all, 1 to black."""

ENDED_STATUSES = ("SUCCESS", "FAILURE", "INVALID")
"""Statuses of ended nodes; the page shows how often each node ended with each of them."""
SCENE_KEYS = ("shapes", "body_poses")
"""Fields of `PageChange` that belong to the scene, which `SceneProxy` serves."""

JsonObject = dict[str, object]
"""Values of a JSON object, by key."""


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

    def _set_entry(self, key: str, name: str, value: JsonObject) -> None:
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


SCENE_CONTENT_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob:; frame-ancestors 'self'"
)
"""Content security policy of the page of viser, which must not load anything from other servers."""
MAX_SCENE_MESSAGE_SIZE = 64 * 1024 * 1024
"""Maximum size of a message of the scene, which may contain a mesh [bytes]."""

Connection = web.WebSocketResponse | aiohttp.ClientWebSocketResponse
"""WebSocket connection with a browser or with the scene server."""


class SceneProxy:
    """Forwards requests to the socket of the scene server; stores shapes and poses before its start."""

    def __init__(self, socket_path: Path) -> None:
        self._socket_path = socket_path
        self._shapes: asyncio.Future[Sequence[Shape]] = asyncio.get_running_loop().create_future()
        self._body_poses: Mapping[str, Sequence[float]] = {}
        self._scene: LiveScene | None = None
        self._start_lock = asyncio.Lock()

    def apply(self, change: PageChange) -> None:
        """Apply a change; once the shapes are known, a request of a browser starts the scene server."""
        if change.shapes is not None:
            self._shapes.set_result(change.shapes)
        if change.body_poses is not None:
            self._body_poses = change.body_poses
            if self._scene is not None:
                self._scene.set_body_poses(self._body_poses)

    async def forward_file(self, request: web.Request) -> web.Response:
        """Forward the request for a file to the scene server, and return the response."""
        async with await self.open_session() as session:
            response = await session.get(f"http://scene/{request.match_info['file']}")
            return web.Response(
                status=response.status, body=await response.read(), content_type=response.content_type,
                headers={"Content-Security-Policy": SCENE_CONTENT_POLICY},
            )  # fmt: skip

    async def forward_messages(self, request: web.Request) -> web.WebSocketResponse:
        """Forward WebSocket messages between browser and scene server until one connection ends."""
        header = request.headers.get("Sec-WebSocket-Protocol", "")
        protocols = [name.strip() for name in header.split(",") if name.strip()]
        browser = web.WebSocketResponse(protocols=protocols, max_msg_size=MAX_SCENE_MESSAGE_SIZE)
        await browser.prepare(request)
        async with (
            await self.open_session() as session,
            session.ws_connect(
                "http://scene/", protocols=protocols, max_msg_size=MAX_SCENE_MESSAGE_SIZE
            ) as scene,
        ):
            tasks = [asyncio.create_task(_forward(*pair)) for pair in ((browser, scene), (scene, browser))]
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()
        await browser.close()
        return browser

    async def open_session(self) -> aiohttp.ClientSession:
        """Return a session with the scene server; wait for the shapes and start the server if necessary."""
        shapes = await asyncio.shield(self._shapes)
        async with self._start_lock:
            if self._scene is None:
                # The start takes 1.5 s (imports and meshes), which would block other requests.
                self._scene = await asyncio.to_thread(_start_scene_server, self._socket_path, shapes)
                self._scene.set_body_poses(self._body_poses)
        return aiohttp.ClientSession(connector=aiohttp.UnixConnector(path=str(self._socket_path)))


def _start_scene_server(socket_path: Path, shapes: Sequence[Shape]) -> LiveScene:
    # The import of viser and trimesh takes 1 s, and only the first browser needs them.
    from executive.view.live_scene import LiveScene

    return LiveScene(socket_path, shapes)


async def _forward(source: Connection, target: Connection) -> None:
    async for message in source:
        if message.type is WSMsgType.BINARY:
            await target.send_bytes(message.data)
        elif message.type is WSMsgType.TEXT:
            await target.send_str(message.data)


MESSAGE_PERIOD = 1 / 8
"""Period of the messages to the browsers [s]."""
CONTENT_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy of the page, which loads everything from this server."""
SECURITY_HEADERS = {
    # The address contains the token, which links and caches must not reveal.
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
"""Headers of every response."""
HEARTBEAT_PERIOD = 10.0
"""Period at which a WebSocket connection is tested [s]."""
SHUTDOWN_TIMEOUT = 0.5
"""Maximum time to wait until the browsers have received the last message [s]."""
COMMANDS = ("pause", "resume", "step", "stop", "render_on_cpu")
"""Commands of a browser that contain no text."""
MAX_MESSAGE_SIZE = 4096
"""Maximum size of a message of a browser [bytes]."""
_FILES = {
    "": ("live_page.html", "text/html"),
    "page.js": ("live_page.js", "text/javascript"),
    "page.css": ("live_page.css", "text/css"),
    "colours.css": ("colours.css", "text/css"),
}
"""Path in `executive/view/templates` and content type of each served file, by the end of its address."""


class Server:
    """Web server that answers the requests of the page; their paths start with the token.

    `send_command` receives the commands of browsers, and reports about the browsers.
    """

    def __init__(
        self, page_state: PageState, scene_proxy: SceneProxy, send_command: Callable[[PageCommand], None],
        token: str, port: int,
    ) -> None:  # fmt: skip
        self._page_state = page_state
        self._send_command = send_command
        self._token = token
        # The name `localhost` could lead to another server, at [::1].
        self._host = f"{LOOPBACK}:{port}"
        # The value is True for a browser that renders on the CPU.
        self._browsers: dict[web.WebSocketResponse, bool] = {}
        self.app = web.Application(middlewares=[self._check_access])
        self.app.router.add_get("/{token}/live", self._serve_browser)
        self.app.router.add_get("/{token}/scene", scene_proxy.forward_messages)
        self.app.router.add_get("/{token}/scene/{file:.*}", scene_proxy.forward_file)
        self.app.router.add_get("/{token}/{file:.*}", self._serve_file)

    @web.middleware
    async def _check_access(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse a request with an access error; otherwise handle the request and add `SECURITY_HEADERS`."""
        if problem := find_access_error(request, self._token, self._host):
            raise web.HTTPForbidden(text=f"{problem}\n", headers=SECURITY_HEADERS)
        response = await handler(request)
        if not response.prepared:
            response.headers.update(SECURITY_HEADERS)
        return response

    async def send_changes(self) -> None:
        """Send the changes of the page since the last call to all browsers."""
        changes = self._page_state.take_changes()
        if changes and self._browsers:
            text = json.dumps(changes)
            for browser in list(self._browsers):
                with contextlib.suppress(ConnectionError):
                    await browser.send_str(text)

    async def send_periodically(self) -> None:
        """Send the changes of the page once per `MESSAGE_PERIOD`, until the task is cancelled."""
        while True:
            await asyncio.sleep(MESSAGE_PERIOD)
            await self.send_changes()

    async def close(self) -> None:
        """Send the last changes, and close all connections."""
        await self.send_changes()
        close_tasks = [asyncio.create_task(browser.close()) for browser in self._browsers]
        if close_tasks:
            await asyncio.wait(close_tasks, timeout=SHUTDOWN_TIMEOUT)

    async def _serve_file(self, request: web.Request) -> web.Response:
        name = request.match_info["file"]
        if name not in _FILES:
            raise web.HTTPNotFound(text="there is no such file\n")
        file, content_type = _FILES[name]
        text = files("executive.view").joinpath("templates", file).read_text(encoding="utf-8")
        headers = {"Content-Security-Policy": CONTENT_POLICY}
        return web.Response(text=text, content_type=content_type, headers=headers)

    async def _serve_browser(self, request: web.Request) -> web.WebSocketResponse:
        """Send the state of the page to a browser, register it for changes, and receive its commands."""
        socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE_SIZE, heartbeat=HEARTBEAT_PERIOD)
        await socket.prepare(request)
        await socket.send_str(json.dumps(self._page_state.values))
        self._browsers[socket] = False
        self._report_browsers()
        try:
            async for message in socket:
                command = parse_command(message.data) if message.type is WSMsgType.TEXT else None
                if command is not None and command.name == "render_on_cpu":
                    self._browsers[socket] = True
                    self._report_browsers()
                elif command is not None:
                    self._send_command(command)
        finally:
            del self._browsers[socket]
            self._report_browsers()
        return socket

    def _report_browsers(self) -> None:
        """Report to the run how many browsers show the page, and whether a browser renders on the CPU."""
        self._send_command(PageCommand("browsers", "", len(self._browsers), any(self._browsers.values())))


def find_access_error(request: web.Request, token: str, host: str) -> str:
    """Return an error message for a request with a wrong host, token or origin; "" for other requests."""
    # A host name in place of the address may be an attack by DNS rebinding.
    if request.headers.get("Host") != host:
        return "the page must be opened by the address of this machine"
    given_token, _, _ = request.path.removeprefix("/").partition("/")
    if not secrets.compare_digest(given_token.encode(errors="replace"), token.encode()):
        return "the address lacks the token of this run; copy the address from the terminal of the run"
    origin = request.headers.get("Origin")
    if origin is not None and origin != f"http://{host}":
        return "another page may neither read nor control this run"
    # Every browser sends the origin of a page that opens a WebSocket.
    if origin is None and request.headers.get("Upgrade", "").lower() == "websocket":
        return "a WebSocket request must contain the origin of its page"
    return ""


def parse_command(text: str) -> PageCommand | None:
    """Return the command in a message from a browser, or None if the message is invalid."""
    try:
        command = json.loads(text)
    except ValueError:
        return None
    match command:
        case {"name": str(name)} if name in COMMANDS:
            return PageCommand(name)
        case {"name": "request", "text": str(text)}:
            return PageCommand("request", text)
    return None


def main() -> None:
    """Serve the page on the socket whose descriptor is the command-line argument, until stdin ends."""
    os.nice(5)  # The tick loop of the run has precedence.
    listener = socket.socket(fileno=int(sys.argv[1]))
    # The run reads commands from stdout, so text that libraries print is redirected to stderr.
    command_stream = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def write_command(command: PageCommand) -> None:
        command_stream.write(json.dumps(asdict(command)) + "\n")
        command_stream.flush()

    with tempfile.TemporaryDirectory(prefix="executive-") as folder:
        asyncio.run(_serve(listener, Path(folder) / "scene", write_command))
    # Exit without the clean-up of libraries, because the run waits for this process.
    os._exit(0)


async def _serve(
    listener: socket.socket, scene_socket: Path, write_command: Callable[[PageCommand], None]
) -> None:
    """Serve the page, and apply pickled batches of messages from stdin; the first batch has the token."""
    loop = asyncio.get_running_loop()
    input_ended = asyncio.Event()
    (token, port), *first_messages = pickle.load(sys.stdin.buffer)
    page_state = PageState()
    scene_proxy = SceneProxy(scene_socket)
    server = Server(page_state, scene_proxy, write_command, token, port)

    def apply_batch(batch: list[Message]) -> None:
        for message in batch:
            page_state.apply(message)
            if isinstance(message, PageChange):
                scene_proxy.apply(message)

    def read_batches() -> None:
        try:
            while True:
                loop.call_soon_threadsafe(apply_batch, pickle.load(sys.stdin.buffer))
        except EOFError:
            pass
        finally:
            # If the run was killed, the input may end in the middle of a message.
            loop.call_soon_threadsafe(input_ended.set)

    apply_batch(first_messages)
    runner = web.AppRunner(server.app, access_log=None)
    await runner.setup()
    await web.SockSite(runner, listener).start()
    sender = asyncio.create_task(server.send_periodically())
    threading.Thread(target=read_batches, daemon=True).start()
    await input_ended.wait()
    sender.cancel()
    await server.close()


if __name__ == "__main__":
    main()
