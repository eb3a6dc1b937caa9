"""Proxy that forwards requests of browsers to the scene server, and starts this server when needed."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import aiohttp
from aiohttp import WSMsgType, web

from executive.cell.workcell import Shape

if TYPE_CHECKING:
    from executive.view.live.live_scene import LiveScene

CONTENT_POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob:; frame-ancestors 'self'"
)
"""Content security policy of the page of viser, which must not load anything from other servers."""
MAX_MESSAGE_SIZE = 64 * 1024 * 1024
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
                headers={"Content-Security-Policy": CONTENT_POLICY},
            )  # fmt: skip

    async def forward_messages(self, request: web.Request) -> web.WebSocketResponse:
        """Forward WebSocket messages between browser and scene server until one connection ends."""
        header = request.headers.get("Sec-WebSocket-Protocol", "")
        protocols = [name.strip() for name in header.split(",") if name.strip()]
        browser = web.WebSocketResponse(protocols=protocols, max_msg_size=MAX_MESSAGE_SIZE)
        await browser.prepare(request)
        async with (
            await self.open_session() as session,
            session.ws_connect("http://scene/", protocols=protocols, max_msg_size=MAX_MESSAGE_SIZE) as scene,
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
