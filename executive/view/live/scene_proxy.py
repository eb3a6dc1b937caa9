"""Proxy between the server of the page and the server of the scene, which starts at the first request."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import aiohttp
from aiohttp import WSMsgType, web

from executive.cell.visuals import Shape

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


class SceneProxy:
    """Stores shapes and poses until the scene exists, and forwards requests to the server of the scene.

    Args:
        path: Unix socket of the server of the scene.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._shapes: asyncio.Future[Sequence[Shape]] = asyncio.get_running_loop().create_future()
        self._body_poses: Mapping[str, Sequence[float]] = {}
        self._scene: LiveScene | None = None
        self._start_lock = asyncio.Lock()

    def set_shapes(self, shapes: Sequence[Shape]) -> None:
        """Set the shapes of the scene, without which the server of the scene does not start."""
        self._shapes.set_result(shapes)

    def set_body_poses(self, poses: Mapping[str, Sequence[float]]) -> None:
        """Set the poses of bodies by name: position [m] and quaternion (w, x, y, z)."""
        self._body_poses = poses
        if self._scene is not None:
            self._scene.set_body_poses(poses)

    async def forward_file(self, request: web.Request) -> web.Response:
        """Forward the request for a file to the server of the scene, and return the response."""
        async with await self.open_session() as session:
            answer = await session.get(f"http://scene/{request.match_info['file']}")
            return web.Response(
                status=answer.status,
                body=await answer.read(),
                content_type=answer.content_type,
                headers={"Content-Security-Policy": CONTENT_POLICY},
            )

    async def forward_messages(self, request: web.Request) -> web.WebSocketResponse:
        """Forward WebSocket messages between browser and scene until one of the two connections ends."""
        header = request.headers.get("Sec-WebSocket-Protocol", "")
        protocols = [name.strip() for name in header.split(",") if name.strip()]
        browser = web.WebSocketResponse(protocols=protocols, max_msg_size=MAX_MESSAGE_SIZE)
        await browser.prepare(request)
        async with (
            await self.open_session() as session,
            session.ws_connect("http://scene/", protocols=protocols, max_msg_size=MAX_MESSAGE_SIZE) as scene,
        ):
            tasks = [
                asyncio.create_task(_forward(browser, scene)),
                asyncio.create_task(_forward(scene, browser)),
            ]
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()
        await browser.close()
        return browser

    async def open_session(self) -> aiohttp.ClientSession:
        """Return a session with the server of the scene; the first call starts it, once shapes are set."""
        shapes = await asyncio.shield(self._shapes)
        async with self._start_lock:
            if self._scene is None:
                # The start takes 1.5 s (imports and meshes); in a thread it does not block other requests.
                self._scene = await asyncio.to_thread(_make_scene, self._path, shapes)
                self._scene.set_body_poses(self._body_poses)
        return aiohttp.ClientSession(connector=aiohttp.UnixConnector(path=str(self._path)))


def _make_scene(path: Path, shapes: Sequence[Shape]) -> LiveScene:
    from executive.view.live.live_scene import LiveScene

    return LiveScene(path, shapes)


async def _forward(source: Connection, target: Connection) -> None:
    async for message in source:
        if message.type is WSMsgType.BINARY:
            await target.send_bytes(message.data)
        elif message.type is WSMsgType.TEXT:
            await target.send_str(message.data)
