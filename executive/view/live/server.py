"""Server of the live page: access control, files, messages to browsers, and commands from browsers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import Callable
from importlib.resources import files

from aiohttp import WSMsgType, web
from aiohttp.typedefs import Handler

from executive.view.live.page_state import PageCommand, PageState
from executive.view.live.scene_proxy import SceneProxy

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
    "": ("live/page.html", "text/html"),
    "page.js": ("live/page.js", "text/javascript"),
    "page.css": ("live/page.css", "text/css"),
    "colours.css": ("colours.css", "text/css"),
}
"""Path in `executive/view` and content type of each served file, by the last part of its address."""


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
        text = files("executive.view").joinpath(file).read_text(encoding="utf-8")
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
