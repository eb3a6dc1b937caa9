"""Who may see and command a run: whoever knows the token in the page's address, from that page only."""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable

from aiohttp import web
from aiohttp.typedefs import Middleware

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

HEADERS = {
    # The token is in the address: it must not leave with a link, nor stay in a cache.
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Guard:
    """Refuses every request that is not of the page itself.

    Args:
        token: What the address must begin with.
        port: The server's.
    """

    def __init__(self, token: str, port: int) -> None:
        self._token = token
        # By no other name: what answers to `localhost` may be somebody else's server, at [::1].
        self._host = f"127.0.0.1:{port}"

    def middleware(self) -> Middleware:
        """Return what stands before every handler."""

        @web.middleware
        async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
            if problem := self.problem(request):
                raise web.HTTPForbidden(text=f"{problem}\n", headers=HEADERS)
            response = await handler(request)
            if not response.prepared:
                for key, value in HEADERS.items():
                    response.headers.setdefault(key, value)
            return response

        return guarded

    def problem(self, request: web.Request) -> str:
        """Return why a request is refused, or ""."""
        # A name that leads here is not enough: a foreign site may let its own name lead to this machine.
        if request.headers.get("Host") != self._host:
            return "this page goes by the address of this machine only"
        token, _, _ = request.path.removeprefix("/").partition("/")
        if not secrets.compare_digest(token.encode(errors="replace"), self._token.encode()):
            return "the address lacks the token of this run; take it from the terminal that the run is in"
        origin = request.headers.get("Origin")
        if origin is not None and origin != f"http://{self._host}":
            return "another page may neither see nor command this run"
        # Browsers say so for every socket that a page opens.
        if origin is None and request.headers.get("Upgrade", "").lower() == "websocket":
            return "a connection must say which page it is of"
        return ""
