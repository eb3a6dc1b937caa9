"""Server process of the live page: reads messages from stdin, and writes commands to stdout."""

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

from executive.view.live.page import Message, PageCommand, PageState, SceneChange
from executive.view.live.server import SceneProxy, Server


def main() -> None:
    """Serve the page on the socket whose descriptor is the command-line argument, until stdin ends."""
    os.nice(5)  # The tick loop of the run has precedence.
    listener = socket.socket(fileno=int(sys.argv[1]))
    # The run reads commands from stdout, so text that libraries print is redirected to stderr.
    command_stream = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def write_command(command: PageCommand) -> None:
        command_stream.write(json.dumps(asdict(command)) + "\n")
        command_stream.flush()

    with tempfile.TemporaryDirectory(prefix="executive-") as folder:
        asyncio.run(_serve(listener, Path(folder) / "scene", write_command))
    # Exit without the clean-up of libraries, because the run waits for this process.
    os._exit(0)


async def _serve(
    listener: socket.socket, scene_socket: Path, write_command: Callable[[PageCommand], None]
) -> None:
    """Serve the page, and apply pickled batches of messages from stdin; the first batch has the token."""
    loop, input_ended = asyncio.get_running_loop(), asyncio.Event()
    (token, port), *first_messages = pickle.load(sys.stdin.buffer)
    page_state, scene_proxy = PageState(), SceneProxy(scene_socket)
    server = Server(page_state, scene_proxy, write_command, token, port)

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
            while True:
                loop.call_soon_threadsafe(apply_batch, pickle.load(sys.stdin.buffer))
        except EOFError:
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


if __name__ == "__main__":
    main()
