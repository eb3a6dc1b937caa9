"""Proxy from the page's server to the server of the scene, which starts with the first request."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import aiohttp
from aiohttp import WSMsgType, web

from executive.cell.visuals import Shape

if TYPE_CHECKING:
    from executive.view.live.scene import LiveScene

POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob:; frame-ancestors 'self'"
)
"""Content security policy: the page of viser must not load anything from other servers."""
MAX_MESSAGE_SIZE = 64 * 1024 * 1024
"""Largest message of the scene [bytes]: meshes are large."""

Connection = web.WebSocketResponse | aiohttp.ClientWebSocketResponse


class Tunnel:
    """Keeps shapes and poses until the scene exists, and forwards requests to the scene.

    Args:
        path: Unix socket of the scene.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._shapes: asyncio.Future[Sequence[Shape]] = asyncio.get_running_loop().create_future()
        self._bodies: Mapping[str, Sequence[float]] = {}
        self._scene: LiveScene | None = None
        self._building = asyncio.Lock()

    def show(self, shapes: Sequence[Shape]) -> None:
        """Set the shapes of the scene, which can start afterwards."""
        self._shapes.set_result(shapes)

    def move(self, bodies: Mapping[str, Sequence[float]]) -> None:
        """Set the poses of bodies: position [m] and quaternion (w, x, y, z)."""
        self._bodies = bodies
        if self._scene is not None:
            self._scene.move(bodies)

    async def page(self, request: web.Request) -> web.Response:
        """Forward the request of a file to the scene."""
        async with await self.session() as session:
            answer = await session.get(f"http://scene/{request.match_info['file']}")
            return web.Response(
                status=answer.status,
                body=await answer.read(),
                content_type=answer.content_type,
                headers={"Content-Security-Policy": POLICY},
            )

    async def socket(self, request: web.Request) -> web.WebSocketResponse:
        """Forward messages in both directions until one connection ends."""
        header = request.headers.get("Sec-WebSocket-Protocol", "")
        protocols = [word.strip() for word in header.split(",") if word.strip()]
        browser = web.WebSocketResponse(protocols=protocols, max_msg_size=MAX_MESSAGE_SIZE)
        await browser.prepare(request)
        async with (
            await self.session() as session,
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

    async def session(self) -> aiohttp.ClientSession:
        """Return a session with the scene's server; wait for the shapes, and start the server once."""
        shapes = await asyncio.shield(self._shapes)
        async with self._building:
            if self._scene is None:
                # The start takes 1.5 s (imports and meshes); in a thread it does not block other requests.
                self._scene = await asyncio.to_thread(_make_scene, self._path, shapes)
                self._scene.move(self._bodies)
        return aiohttp.ClientSession(connector=aiohttp.UnixConnector(path=str(self._path)))


def _make_scene(path: Path, shapes: Sequence[Shape]) -> LiveScene:
    from executive.view.live.scene import LiveScene

    return LiveScene(path, shapes)


async def _forward(source: Connection, target: Connection) -> None:
    async for message in source:
        if message.type is WSMsgType.BINARY:
            await target.send_bytes(message.data)
        elif message.type is WSMsgType.TEXT:
            await target.send_str(message.data)
