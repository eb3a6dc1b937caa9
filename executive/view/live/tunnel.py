"""A way through the page's own door to the server of the scene."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import aiohttp
from aiohttp import WSMsgType, web

POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob:; frame-ancestors 'self'"
)
"""The scene's page is somebody else's: whatever it wants, it fetches nothing from elsewhere."""
LARGEST = 64 * 1024 * 1024
"""Of a message [bytes]: meshes are large."""


class Tunnel:
    """Hands requests on to a server behind a Unix socket.

    Args:
        ready: Returns the socket once that server is there.
    """

    def __init__(self, ready: Callable[[], Awaitable[Path]]) -> None:
        self._ready = ready

    async def page(self, request: web.Request) -> web.Response:
        """Return a file of that server."""
        async with await self._session() as session:
            answer = await session.get(f"http://scene/{request.match_info['file']}")
            headers = {"Content-Security-Policy": POLICY}
            return web.Response(
                status=answer.status,
                body=await answer.read(),
                content_type=answer.content_type,
                headers=headers,
            )

    async def socket(self, request: web.Request) -> web.WebSocketResponse:
        """Hand messages on in both directions until one side ends."""
        wanted = request.headers.get("Sec-WebSocket-Protocol", "")
        protocols = [word.strip() for word in wanted.split(",") if word.strip()]
        here = web.WebSocketResponse(protocols=protocols, max_msg_size=LARGEST)
        await here.prepare(request)
        async with (
            await self._session() as session,
            session.ws_connect("http://scene/", protocols=protocols, max_msg_size=LARGEST) as there,
        ):
            ways = [asyncio.create_task(_carry(here, there)), asyncio.create_task(_carry(there, here))]
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            for way in ways:
                way.cancel()
        await here.close()
        return here

    async def _session(self) -> aiohttp.ClientSession:
        return aiohttp.ClientSession(connector=aiohttp.UnixConnector(path=str(await self._ready())))


Side = web.WebSocketResponse | aiohttp.ClientWebSocketResponse


async def _carry(source: Side, target: Side) -> None:
    async for message in source:
        if message.type is WSMsgType.BINARY:
            await target.send_bytes(message.data)
        elif message.type is WSMsgType.TEXT:
            await target.send_str(message.data)
