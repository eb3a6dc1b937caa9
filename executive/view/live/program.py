"""Server program of the live page: it reads messages from stdin and writes commands to stdout."""

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
from executive.view.live.messages import Message, PageCommand, SceneChange
from executive.view.live.server import Server
from executive.view.live.tunnel import Tunnel


def main() -> None:
    """Serve until standard input ends."""
    listener = socket.socket(fileno=int(sys.argv[1]))
    # The run reads commands from stdout: text that libraries print goes to stderr.
    commands = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def write_command(command: PageCommand) -> None:
        commands.write(json.dumps(asdict(command)) + "\n")
        commands.flush()

    with tempfile.TemporaryDirectory(prefix="executive-") as folder:
        asyncio.run(_serve(listener, Path(folder) / "scene", write_command))
    # The run waits for this process, which has nothing left to clean up.
    os._exit(0)


async def _serve(listener: socket.socket, path: Path, write_command: Callable[[PageCommand], None]) -> None:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    (token, port), *first_messages = pickle.load(sys.stdin.buffer)
    board, tunnel = Board(), Tunnel(path)
    server = Server(board, tunnel, write_command, token, port)

    def apply_batch(batch: list[Message]) -> None:
        for message in batch:
            if not isinstance(message, SceneChange):
                board.apply(message)
            elif message.shapes is not None:
                tunnel.show(message.shapes)
            elif message.bodies is not None:
                tunnel.move(message.bodies)

    def read_batches() -> None:
        try:
            while True:
                loop.call_soon_threadsafe(apply_batch, pickle.load(sys.stdin.buffer))
        except EOFError:
            pass
        finally:
            # The input also ends if the run was killed, even in the middle of a message.
            loop.call_soon_threadsafe(ended.set)

    apply_batch(first_messages)
    runner = web.AppRunner(server.app, access_log=None)
    await runner.setup()
    await web.SockSite(runner, listener).start()
    sending = asyncio.create_task(server.send_periodically())
    threading.Thread(target=read_batches, daemon=True).start()
    await ended.wait()
    sending.cancel()
    await server.end()
