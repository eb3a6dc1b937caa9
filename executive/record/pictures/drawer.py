"""The process that draws, seen from the run."""

from __future__ import annotations

import contextlib
import pickle
import queue
import subprocess
import tempfile
import threading
from pathlib import Path

from executive.programs import program
from executive.record.pictures.scene import Scene

WAITING = 64
"""Pictures that may wait for the process [about 1.2 MB each]; beyond that they are dropped."""

PATIENCE = 30.0
"""Longest wait for the last picture at the end of a run [s]."""


class Drawer:
    """Has scenes drawn to files by a process of its own, which starts with the first one.

    Importing supervision takes 1.3 to 1.5 s and a picture 8 ms (two cores of an AMD EPYC); a run with
    five objects has 8 s in all. In a process beside it, the pictures cost the tick thread next to nothing
    and are ready when the run ends.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._waiting: queue.Queue[tuple[Path, Scene] | None] = queue.Queue()
        self._sender: threading.Thread | None = None
        self.problem = ""
        """Why pictures are missing, or "" where none is."""

    def draw(self, name: str, scene: Scene) -> bool:
        """Have `scene` drawn to the file `name` of the folder; False if too many wait already."""
        if self._waiting.qsize() >= WAITING:
            return False
        if self._sender is None:
            self._sender = threading.Thread(target=self._send, name="pictures", daemon=True)
            self._sender.start()
        self._waiting.put((self._folder / name, scene))
        return True

    def close(self) -> None:
        """Return once every picture is drawn; `problem` says if some are not."""
        if self._sender is None:
            return
        self._waiting.put(None)
        self._sender.join(PATIENCE)
        if self._sender.is_alive():
            self.problem = f"pictures are still being drawn {PATIENCE:.0f} s after the run"
        self._sender = None

    def _send(self) -> None:
        """Feed the process until there is nothing more to draw; note what went wrong."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            # A file takes what the process says: a pipe that nobody reads could fill up and stop it.
            with tempfile.TemporaryFile() as said:
                process = subprocess.Popen(
                    program("executive.record.pictures"),
                    stdin=subprocess.PIPE, stdout=said, stderr=said,
                    # Out of reach of Ctrl-C: the pictures of a halted run are wanted all the more.
                    start_new_session=True,
                )  # fmt: skip
                # If it ends early, its exit status and last words tell why, below.
                with contextlib.suppress(BrokenPipeError):
                    self._feed(process)
                if process.wait() != 0:
                    said.seek(0)
                    words = said.read().decode(errors="replace").strip().splitlines()
                    self.problem = f"not every picture was drawn: {words[-1] if words else 'the drawer died'}"
        except OSError as error:
            self.problem = f"no pictures were drawn: {(error.strerror or str(error)).lower()}"

    def _feed(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        with process.stdin as pipe:
            while (picture := self._waiting.get()) is not None:
                pickle.dump(picture, pipe, protocol=pickle.HIGHEST_PROTOCOL)
                pipe.flush()
