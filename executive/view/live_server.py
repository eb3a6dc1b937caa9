"""Server of the live page, in a process of its own: 3-D scene, access, files and messages.

The server reads messages of the run from stdin, and writes commands of browsers to stdout. It listens on the
loopback address. Every request must come from the page itself and contain the secret token in the page
address, so that no other page can read or control the run.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import pickle
import secrets
import socket
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
from aiohttp import WSMsgType, web
from aiohttp.typedefs import Handler

from executive.cell.devices import Shape
from executive.view.live_page import LOOPBACK, Message, PageChange, PageCommand, PageState

SCENE_CONTENT_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob:; frame-ancestors 'self'"
)
"""Content security policy of the page of viser, which must not load anything from other servers."""
CAMERA_POSITION = (1.35, -0.68, 0.95)
"""Initial position of the virtual camera in the world frame [m]."""
CAMERA_TARGET = (0.33, 0.0, 0.2)
"""Point at which the virtual camera looks at first, in the world frame [m]."""
BACKGROUND = (243, 245, 248)
"""Colour of the background, RGB, 0 to 255."""
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
                self._scene = await asyncio.to_thread(LiveScene, self._socket_path, shapes)
                self._scene.set_body_poses(self._body_poses)
        return aiohttp.ClientSession(connector=aiohttp.UnixConnector(path=str(self._socket_path)))


class LiveScene:
    """Viser server that shows fixed shapes and shapes on moving bodies.

    The server opens only the Unix socket `socket_path`, because viser has no access control.
    """

    def __init__(self, socket_path: Path, shapes: Sequence[Shape]) -> None:
        # The imports of this class take 1 s, and only the first browser needs them.
        import viser

        _listen_on_unix_socket(socket_path)
        self._server = viser.ViserServer(host=LOOPBACK, port=0, verbose=False)
        self._bodies: dict[str, viser.FrameHandle] = {}
        scene = self._server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        # Browsers without a graphics card draw shadows and reflections slowly.
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light", intensity=1.6)
        scene.set_background_image(np.full((1, 1, 3), BACKGROUND, np.uint8))
        self._server.initial_camera.position = CAMERA_POSITION
        self._server.initial_camera.look_at = CAMERA_TARGET
        self._server.gui.configure_theme(control_width="small", show_logo=False, show_share_button=False)
        # The page has its own buttons instead of the control panel of viser.
        self._server.gui.main_panel.minimize()
        for number, shape in enumerate(shapes):
            if shape.body and shape.body not in self._bodies:
                self._bodies[shape.body] = scene.add_frame(_make_scene_path(shape.body), show_axes=False)
            parent = _make_scene_path(shape.body) if shape.body else "/fixed"
            self._add_shape(f"{parent}/{number}", shape)

    def set_body_poses(self, poses: Mapping[str, Sequence[float]]) -> None:
        """Set poses of bodies by name: position [m], quaternion (w, x, y, z); hide bodies without a pose."""
        with self._server.atomic():
            for name, frame in self._bodies.items():
                pose = poses.get(name)
                if frame.visible != (pose is not None):
                    frame.visible = pose is not None
                if pose is not None:
                    frame.position = np.array(pose[:3])
                    frame.wxyz = np.array(pose[3:])

    def _add_shape(self, path: str, shape: Shape) -> None:
        """Add a shape to the scene at `path`; the path without its last part is the path of the parent."""
        scene = self._server.scene
        radius = shape.size[0] / 2
        quaternion = np.roll(shape.X_BS.quaternion, 1)  # (x, y, z, w) becomes (w, x, y, z).
        options: dict[str, Any] = {
            "color": shape.colour, "position": shape.X_BS.position, "wxyz": quaternion,
        }  # fmt: skip
        if shape.kind == "box":
            scene.add_box(path, dimensions=shape.size, **options)
        elif shape.kind == "cylinder":
            scene.add_cylinder(path, radius=radius, height=shape.size[2], **options)
        elif shape.kind == "sphere":
            scene.add_icosphere(path, radius=radius, **options)
        else:
            import trimesh  # See `__init__`.

            mesh = trimesh.load_mesh(shape.file, process=False, skip_materials=True)
            vertices = np.asarray(mesh.vertices) * shape.size
            scene.add_mesh_simple(path, vertices, np.asarray(mesh.faces), **options)


def _listen_on_unix_socket(socket_path: Path) -> None:
    """Make viser, which has no option for a Unix socket, listen on a Unix socket in this process."""
    import websockets.asyncio.server  # See `LiveScene`.

    original_serve = websockets.asyncio.server.serve

    def serve_on_socket(handler: Any, _host: Any, _port: Any, **options: Any) -> Any:
        return original_serve(handler, unix=True, path=str(socket_path), **options)

    websockets.asyncio.server.serve = serve_on_socket  # type: ignore[assignment, misc]


def _make_scene_path(body: str) -> str:
    return "/bodies/" + body.replace(" ", "_").replace("/", "_")


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
        case {"name": "request" | "empty_bins" as name, "text": str(text)}:
            return PageCommand(name, text)
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
    threading.Thread(target=read_batches, daemon=True).start()
    while not input_ended.is_set():
        await server.send_changes()
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(input_ended.wait(), MESSAGE_PERIOD)
    await server.close()


if __name__ == "__main__":
    main()
