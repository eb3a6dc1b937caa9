"""Server of the live page: access, files, messages to and from browsers, and proxy of the 3-D scene."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import aiohttp
from aiohttp import WSMsgType, web
from aiohttp.typedefs import Handler

from executive.cell.workcell import Shape
from executive.view.live.page import PageCommand, PageState

if TYPE_CHECKING:
    from executive.view.live.live_scene import LiveScene


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

    def set_shapes(self, shapes: Sequence[Shape]) -> None:
        """Set the shapes of the scene; the next or a waiting request of a browser starts the scene server."""
        self._shapes.set_result(shapes)

    def set_body_poses(self, poses: Mapping[str, Sequence[float]]) -> None:
        """Set the poses of bodies by name: position [m] and quaternion (w, x, y, z)."""
        self._body_poses = poses
        if self._scene is not None:
            self._scene.set_body_poses(poses)

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
            directions = (_forward(browser, scene), _forward(scene, browser))
            tasks = [asyncio.create_task(direction) for direction in directions]
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
    """Import viser and start the scene server."""
    from executive.view.live.live_scene import LiveScene

    return LiveScene(socket_path, shapes)


async def _forward(source: Connection, target: Connection) -> None:
    """Forward the messages from `source` to `target` until a connection ends."""
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
        self._host = f"127.0.0.1:{port}"
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
        """Return a file of the page."""
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
