"""Server of the live page: access control, files, messages to browsers and commands from browsers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import Awaitable, Callable
from importlib.resources import files

from aiohttp import WSMsgType, web

from executive.view.live.board import Board
from executive.view.live.messages import PageCommand
from executive.view.live.tunnel import Tunnel

MESSAGE_PERIOD = 1 / 8
"""Time between two messages to the browsers [s]."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    # The token is in the address: links and caches must not reveal it.
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
SHUTDOWN_TIMEOUT = 0.5
"""Longest wait for the browsers to receive the last message [s]."""
COMMANDS = ("pause", "resume", "step", "stop", "spare")
MAX_MESSAGE_SIZE = 4096
"""Largest message of a browser [bytes]."""
_FILES = {
    "": ("live/page.html", "text/html"),
    "page.js": ("live/page.js", "text/javascript"),
    "page.css": ("live/page.css", "text/css"),
    "colours.css": ("colours.css", "text/css"),
}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """Serves requests that contain the token and do not come from other pages.

    Args:
        board: State of the page.
        tunnel: Proxy to the scene.
        send_command: Receives the commands of watchers, and the number of watchers.
        token: First part of every address.
        port: Port of the server.
    """

    def __init__(
        self, board: Board, tunnel: Tunnel, send_command: Callable[[PageCommand], None], token: str, port: int
    ) -> None:
        self._board = board
        self._send_command = send_command
        self._token = token
        # Not `localhost`: this name may lead to another server, at [::1].
        self._host = f"127.0.0.1:{port}"
        self._watchers: dict[web.WebSocketResponse, bool] = {}
        self.app = web.Application(middlewares=[self._check_access])
        self.app.router.add_get("/{token}/live", self._serve_socket)
        self.app.router.add_get("/{token}/scene", tunnel.socket)
        self.app.router.add_get("/{token}/scene/{file:.*}", tunnel.page)
        self.app.router.add_get("/{token}/{file:.*}", self._serve_file)

    @web.middleware
    async def _check_access(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse a request without the token or from another page; a middleware of all handlers."""
        if problem := find_refusal(request, self._token, self._host):
            raise web.HTTPForbidden(text=f"{problem}\n", headers=HEADERS)
        response = await handler(request)
        if not response.prepared:
            for key, value in HEADERS.items():
                response.headers.setdefault(key, value)
        return response

    async def send_changes(self) -> None:
        """Send the changes of the page to all watchers."""
        changes = self._board.take_changes()
        if changes and self._watchers:
            text = json.dumps(changes)
            for watcher in list(self._watchers):
                with contextlib.suppress(ConnectionError):
                    await watcher.send_str(text)

    async def send_periodically(self) -> None:
        """Send the changes of the page once per `MESSAGE_PERIOD`, without end."""
        while True:
            await asyncio.sleep(MESSAGE_PERIOD)
            await self.send_changes()

    async def end(self) -> None:
        """Send the last changes, and close all connections."""
        await self.send_changes()
        closing = [asyncio.create_task(watcher.close()) for watcher in self._watchers]
        if closing:
            await asyncio.wait(closing, timeout=SHUTDOWN_TIMEOUT)

    async def _serve_file(self, request: web.Request) -> web.Response:
        name = request.match_info["file"]
        if name not in _FILES:
            raise web.HTTPNotFound(text="there is no such file\n")
        file, kind = _FILES[name]
        text = files("executive.view").joinpath(file).read_text(encoding="utf-8")
        return web.Response(text=text, content_type=kind, headers={"Content-Security-Policy": POLICY})

    async def _serve_socket(self, request: web.Request) -> web.WebSocketResponse:
        """Send a watcher the whole state, then the changes; receive commands."""
        socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE_SIZE, heartbeat=10)
        await socket.prepare(request)
        await socket.send_str(json.dumps(self._board.state))
        self._watchers[socket] = False
        self._report_watchers()
        try:
            async for message in socket:
                command = parse_command(message.data) if message.type is WSMsgType.TEXT else None
                if command is not None and command.do == "spare":
                    self._watchers[socket] = True
                    self._report_watchers()
                elif command is not None:
                    self._send_command(command)
        finally:
            del self._watchers[socket]
            self._report_watchers()
        return socket

    def _report_watchers(self) -> None:
        """Report the number of watchers to the run, and whether a browser renders on the CPU."""
        sparing = any(self._watchers.values())
        self._send_command(PageCommand("watched", watchers=len(self._watchers), is_sparing=sparing))


def find_refusal(request: web.Request, token: str, host: str) -> str:
    """Return the reason to refuse a request to the server with this token and host, or ""."""
    # Another site may point its own host name to this machine: only the address is accepted.
    if request.headers.get("Host") != host:
        return "the page must be opened by the address of this machine"
    given, _, _ = request.path.removeprefix("/").partition("/")
    if not secrets.compare_digest(given.encode(errors="replace"), token.encode()):
        return "the address lacks the token of this run; take it from the terminal that the run is in"
    origin = request.headers.get("Origin")
    if origin is not None and origin != f"http://{host}":
        return "another page may neither read nor control this run"
    # Browsers send the origin of every socket that a page opens.
    if origin is None and request.headers.get("Upgrade", "").lower() == "websocket":
        return "a connection must name the origin of its page"
    return ""


def parse_command(text: str) -> PageCommand | None:
    """Return the command in a message from a browser, or None if the message is invalid."""
    try:
        command = json.loads(text)
    except ValueError:
        return None
    if not isinstance(command, dict):
        return None
    if command.get("do") in COMMANDS:
        return PageCommand(command["do"])
    if command.get("do") == "request" and isinstance(command.get("word"), str):
        return PageCommand("request", command["word"])
    return None
