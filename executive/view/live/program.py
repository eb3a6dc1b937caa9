"""Server process of the live page: receives messages from the run, and sends commands to the run."""

from __future__ import annotations

import asyncio
import os
import socket
import sys
import tempfile
import threading
from multiprocessing.connection import Connection
from pathlib import Path

from aiohttp import web

from executive.view.live.messages import Message, SceneChange
from executive.view.live.page_state import PageState
from executive.view.live.scene_proxy import SceneProxy
from executive.view.live.server import Server


def main() -> None:
    """Serve the page until the run ends; the arguments are descriptors of a socket and of a connection."""
    listener, connection = socket.socket(fileno=int(sys.argv[1])), Connection(int(sys.argv[2]))
    with tempfile.TemporaryDirectory(prefix="executive-") as folder:
        asyncio.run(_serve(listener, Path(folder) / "scene", connection))
    # Exit without the clean-up of libraries, because the run waits for this process.
    os._exit(0)


async def _serve(listener: socket.socket, scene_socket: Path, connection: Connection) -> None:
    """Serve the page, and apply batches of messages from the run; the first batch has the token."""
    loop, input_ended = asyncio.get_running_loop(), asyncio.Event()
    (token, port), *first_messages = connection.recv()
    page_state, scene_proxy = PageState(), SceneProxy(scene_socket)
    server = Server(page_state, scene_proxy, connection.send, token, port)

    def apply_batch(batch: list[Message]) -> None:
        for message in batch:
            if not isinstance(message, SceneChange):
                page_state.apply(message)
            elif message.shapes is not None:
                scene_proxy.set_shapes(message.shapes)
            elif message.body_poses is not None:
                scene_proxy.set_body_poses(message.body_poses)

    def read_batches() -> None:
        try:
            while (batch := connection.recv()) is not None:
                loop.call_soon_threadsafe(apply_batch, batch)
        except (EOFError, OSError):
            pass
        finally:
            # If the run was killed, the input may end in the middle of a message.
            loop.call_soon_threadsafe(input_ended.set)

    apply_batch(first_messages)
    runner = web.AppRunner(server.app, access_log=None)
    await runner.setup()
    await web.SockSite(runner, listener).start()
    sender = asyncio.create_task(server.send_periodically())
    threading.Thread(target=read_batches, daemon=True).start()
    await input_ended.wait()
    sender.cancel()
    await server.close()
