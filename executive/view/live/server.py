"""Server of the live page: access control, files, messages to browsers and commands from browsers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import Awaitable, Callable
from importlib.resources import files

from aiohttp import WSMsgType, web

from executive.view.live.messages import PageCommand
from executive.view.live.page_state import PageState
from executive.view.live.scene_proxy import SceneProxy

MESSAGE_PERIOD = 1 / 8
"""Period of the messages to the browsers [s]."""
CONTENT_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy of the page: everything comes from this server."""
SECURITY_HEADERS = {
    # The address contains the token, which links and caches must not reveal.
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
SHUTDOWN_TIMEOUT = 0.5
"""Maximum time to wait until the browsers have received the last message [s]."""
COMMANDS = ("pause", "resume", "step", "stop", "render_on_cpu")
"""Commands of a browser without a text."""
MAX_MESSAGE_SIZE = 4096
"""Maximum size of a message of a browser [bytes]."""
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
        page_state: State of the page.
        scene_proxy: Proxy to the server of the scene.
        send_command: Callback that receives the commands of watchers, and the number of watchers.
        token: First part of the path of every request.
        port: Port of the server.
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
        # Socket of each watcher, with True if the browser renders on the CPU.
        self._watchers: dict[web.WebSocketResponse, bool] = {}
        self.app = web.Application(middlewares=[self._check_access])
        self.app.router.add_get("/{token}/live", self._serve_watcher)
        self.app.router.add_get("/{token}/scene", scene_proxy.forward_messages)
        self.app.router.add_get("/{token}/scene/{file:.*}", scene_proxy.forward_file)
        self.app.router.add_get("/{token}/{file:.*}", self._serve_file)

    @web.middleware
    async def _check_access(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse a request without the token or from another page; called before every handler."""
        if problem := find_refusal(request, self._token, self._host):
            raise web.HTTPForbidden(text=f"{problem}\n", headers=SECURITY_HEADERS)
        response = await handler(request)
        if not response.prepared:
            for key, value in SECURITY_HEADERS.items():
                response.headers.setdefault(key, value)
        return response

    async def send_changes(self) -> None:
        """Send the changes of the page since the last call to all watchers."""
        changes = self._page_state.take_changes()
        if changes and self._watchers:
            text = json.dumps(changes)
            for watcher in list(self._watchers):
                with contextlib.suppress(ConnectionError):
                    await watcher.send_str(text)

    async def send_periodically(self) -> None:
        """Send the changes of the page once per `MESSAGE_PERIOD`, until the task is cancelled."""
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
        file, content_type = _FILES[name]
        text = files("executive.view").joinpath(file).read_text(encoding="utf-8")
        headers = {"Content-Security-Policy": CONTENT_POLICY}
        return web.Response(text=text, content_type=content_type, headers=headers)

    async def _serve_watcher(self, request: web.Request) -> web.WebSocketResponse:
        """Send the state of the page to a watcher, register it for changes, and receive its commands."""
        socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE_SIZE, heartbeat=10)
        await socket.prepare(request)
        await socket.send_str(json.dumps(self._page_state.values))
        self._watchers[socket] = False
        self._report_watchers()
        try:
            async for message in socket:
                command = parse_command(message.data) if message.type is WSMsgType.TEXT else None
                if command is not None and command.name == "render_on_cpu":
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
        is_cpu_rendering = any(self._watchers.values())
        self._send_command(PageCommand("watchers", "", len(self._watchers), is_cpu_rendering))


def find_refusal(request: web.Request, token: str, host: str) -> str:
    """Return an error message for a request without this token and host, or from another page; else ""."""
    # Another site may point its own host name to this machine, so host names are not accepted.
    if request.headers.get("Host") != host:
        return "the page must be opened by the address of this machine"
    given_token, _, _ = request.path.removeprefix("/").partition("/")
    if not secrets.compare_digest(given_token.encode(errors="replace"), token.encode()):
        return "the address lacks the token of this run; copy the address from the terminal of the run"
    origin = request.headers.get("Origin")
    if origin is not None and origin != f"http://{host}":
        return "another page may neither read nor control this run"
    # Browsers always send the origin of a page that opens a WebSocket.
    if origin is None and request.headers.get("Upgrade", "").lower() == "websocket":
        return "a WebSocket request must contain the origin of its page"
    return ""


def parse_command(text: str) -> PageCommand | None:
    """Return the command in a message from a browser, or None if the message is invalid."""
    try:
        command = json.loads(text)
    except ValueError:
        return None
    if not isinstance(command, dict):
        return None
    if command.get("name") in COMMANDS:
        return PageCommand(command["name"])
    if command.get("name") == "request" and isinstance(command.get("text"), str):
        return PageCommand("request", command["text"])
    return None
