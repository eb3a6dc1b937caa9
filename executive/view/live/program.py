"""Program that serves the live page: it reads news from its input and writes wishes to its output."""

from __future__ import annotations

import asyncio
import json
import os
import pickle
import socket
import sys
import tempfile
import threading
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from aiohttp import web

from executive.view.live.board import Board
from executive.view.live.messages import Message, SceneChange, Wish
from executive.view.live.server import Server
from executive.view.live.tunnel import Tunnel


def main() -> None:
    """Serve until standard input ends."""
    listener = socket.socket(fileno=int(sys.argv[1]))
    # Whatever a library prints is none of the run's business.
    wishes = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def say(wish: Wish) -> None:
        wishes.write(json.dumps(asdict(wish)) + "\n")
        wishes.flush()

    with tempfile.TemporaryDirectory(prefix="executive-") as folder:
        asyncio.run(_serve(listener, Path(folder) / "scene", say))
    # The run waits for this end, and there is nothing left that would be worth a farewell of its own.
    os._exit(0)


async def _serve(listener: socket.socket, path: Path, say: Callable[[Wish], None]) -> None:
    loop, over = asyncio.get_running_loop(), asyncio.Event()
    (token, port), *rest = pickle.load(sys.stdin.buffer)
    board, tunnel = Board(), Tunnel(path)
    server = Server(board, tunnel, say, token, port)

    def take(batch: list[Message]) -> None:
        for message in batch:
            if not isinstance(message, SceneChange):
                board.take(message)
            elif message.shapes is not None:
                tunnel.show(message.shapes)
            elif message.bodies is not None:
                tunnel.move(message.bodies)

    def listen() -> None:
        try:
            while True:
                loop.call_soon_threadsafe(take, pickle.load(sys.stdin.buffer))
        except EOFError:
            pass
        finally:
            # A run that was killed in the middle of a word is over, too.
            loop.call_soon_threadsafe(over.set)

    take(rest)
    runner = web.AppRunner(server.app, access_log=None)
    await runner.setup()
    await web.SockSite(runner, listener).start()
    telling = asyncio.create_task(server.keep_telling())
    threading.Thread(target=listen, daemon=True).start()
    await over.wait()
    telling.cancel()
    await server.end()
