"""Way through the page's own door to the server of the scene, which is started when somebody first looks."""

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
"""The scene's page is written by others: whatever it wants, it fetches nothing from elsewhere."""
MAX_MESSAGE = 64 * 1024 * 1024
"""Largest message of the scene [bytes]: meshes are large."""

Side = web.WebSocketResponse | aiohttp.ClientWebSocketResponse


class Tunnel:
    """Keeps what there is to be seen until there is a scene, and hands requests on to the scene.

    Args:
        path: The Unix socket that the scene listens on.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._shapes: asyncio.Future[Sequence[Shape]] = asyncio.get_running_loop().create_future()
        self._bodies: Mapping[str, Sequence[float]] = {}
        self._scene: LiveScene | None = None
        self._building = asyncio.Lock()

    def show(self, shapes: Sequence[Shape]) -> None:
        """Take the shapes of the scene; it does not begin without them."""
        self._shapes.set_result(shapes)

    def move(self, bodies: Mapping[str, Sequence[float]]) -> None:
        """Put bodies where they are: position [m] and quaternion (w, x, y, z)."""
        self._bodies = bodies
        if self._scene is not None:
            self._scene.move(bodies)

    async def page(self, request: web.Request) -> web.Response:
        """Return a file of the scene's server."""
        async with await self.session() as session:
            answer = await session.get(f"http://scene/{request.match_info['file']}")
            return web.Response(
                status=answer.status,
                body=await answer.read(),
                content_type=answer.content_type,
                headers={"Content-Security-Policy": POLICY},
            )

    async def socket(self, request: web.Request) -> web.WebSocketResponse:
        """Hand messages on in both directions until one side ends."""
        wanted = request.headers.get("Sec-WebSocket-Protocol", "")
        protocols = [word.strip() for word in wanted.split(",") if word.strip()]
        here = web.WebSocketResponse(protocols=protocols, max_msg_size=MAX_MESSAGE)
        await here.prepare(request)
        async with (
            await self.session() as session,
            session.ws_connect("http://scene/", protocols=protocols, max_msg_size=MAX_MESSAGE) as there,
        ):
            ways = [asyncio.create_task(_carry(here, there)), asyncio.create_task(_carry(there, here))]
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            for way in ways:
                way.cancel()
        await here.close()
        return here

    async def session(self) -> aiohttp.ClientSession:
        """Return a session with the scene's server, once it is known what to show."""
        shapes = await asyncio.shield(self._shapes)
        async with self._building:
            if self._scene is None:
                # Half a second of imports and a second of meshes, during which others are served.
                self._scene = await asyncio.to_thread(_built, self._path, shapes)
                self._scene.move(self._bodies)
        return aiohttp.ClientSession(connector=aiohttp.UnixConnector(path=str(self._path)))


def _built(path: Path, shapes: Sequence[Shape]) -> LiveScene:
    from executive.view.live.scene import LiveScene

    return LiveScene(path, shapes)


async def _carry(source: Side, target: Side) -> None:
    async for message in source:
        if message.type is WSMsgType.BINARY:
            await target.send_bytes(message.data)
        elif message.type is WSMsgType.TEXT:
            await target.send_str(message.data)
