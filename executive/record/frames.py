"""The pictures behind the decisions: one file per choice, with every box that was on offer."""

from __future__ import annotations

import contextlib
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from executive.events import Event
from executive.record.overlay import Picture

KEPT = 8
"""Looks remembered: a decision may rest on an earlier one than the last."""

PATIENCE = 30.0
"""Longest wait for the last picture at the end of a run [s]."""


class Frames:
    """Saves `<tick>_<item>.jpg` for every decision, drawn by a process of its own.

    Importing supervision takes 1.3 to 1.5 s and a picture 2 ms (two cores of an AMD EPYC); a run with
    five objects has 8 s in all. In a process beside it, the pictures cost the tick thread 0.05 ms each
    and are ready when the run ends.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._looks: dict[int, tuple[Any, Sequence[Mapping[str, Any]]]] = {}
        self._places: dict[str, Sequence[float]] = {}
        self._pictures: queue.Queue[Picture | None] = queue.Queue()
        self._sender: threading.Thread | None = None
        self.problem = ""
        """Why pictures are missing, or "" where none is."""

    def __call__(self, event: Event) -> None:
        """Remember a look; at a decision, have the frame it rests on drawn."""
        if event.kind == "look" and event.data.get("frame_object") is not None:
            frame = event.data["frame_object"]
            self._looks[frame.id] = (frame, event.data.get("found", ()))
            while len(self._looks) > KEPT:
                del self._looks[next(iter(self._looks))]
        elif event.kind == "item" and event.data.get("position") is not None:
            self._places[event.data["item"]] = event.data["position"]
        elif event.kind == "decision" and event.data.get("frame") in self._looks:
            frame, found = self._looks[event.data["frame"]]
            self._draw(self._picture(event, frame.image, found))

    def close(self) -> None:
        """Return once every picture is drawn; `problem` says if some are not."""
        if self._sender is None:
            return
        self._pictures.put(None)
        self._sender.join(PATIENCE)
        if self._sender.is_alive():
            self.problem = f"pictures are still being drawn {PATIENCE:.0f} s after the run"
        self._sender = None

    def _picture(self, event: Event, image: Any, found: Sequence[Mapping[str, Any]]) -> Picture:
        item = str(event.data.get("item", ""))
        chosen = _chosen(event.data, found, event.data.get("position", self._places.get(item)))
        captions = [f"{box['label']} {box['confidence']:.2f}" for box in found]
        if chosen is not None and item:
            captions[chosen] = f"{item} {found[chosen]['confidence']:.2f}"
        path = self._folder / f"{event.tick:06d}_{item or 'none'}.jpg"
        return Picture(path, image, [tuple(box["box"]) for box in found], captions, chosen)

    def _draw(self, picture: Picture) -> None:
        if self._sender is None:
            self._sender = threading.Thread(target=self._send, name="frames", daemon=True)
            self._sender.start()
        self._pictures.put(picture)

    def _send(self) -> None:
        """Feed the drawing process until there is nothing more to draw; note what went wrong."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            # A file takes what the process says: a pipe that nobody reads could fill up and stop it.
            with tempfile.TemporaryFile() as said:
                drawer = subprocess.Popen(
                    [sys.executable, "-m", "executive.record.overlay"],
                    stdin=subprocess.PIPE, stdout=said, stderr=said,
                    # Out of reach of Ctrl-C: the pictures of a halted run are wanted all the more.
                    start_new_session=True,
                )  # fmt: skip
                # If it ends early, its exit status and last words tell why, below.
                with contextlib.suppress(BrokenPipeError):
                    self._feed(drawer)
                if drawer.wait() != 0:
                    said.seek(0)
                    words = said.read().decode(errors="replace").strip().splitlines()
                    self.problem = f"not every picture was drawn: {words[-1] if words else 'the drawer died'}"
        except OSError as error:
            self.problem = f"no pictures were drawn: {(error.strerror or str(error)).lower()}"

    def _feed(self, drawer: subprocess.Popen[bytes]) -> None:
        assert drawer.stdin is not None
        with drawer.stdin as pipe:
            while (picture := self._pictures.get()) is not None:
                pickle.dump(picture, pipe, protocol=pickle.HIGHEST_PROTOCOL)
                pipe.flush()


def _chosen(
    decision: Mapping[str, Any], found: Sequence[Mapping[str, Any]], place: Sequence[float] | None
) -> int | None:
    """Return the number of the detection that was decided for, or None if it cannot be told.

    It is the one where the item was seen; an item's class is a matter of many looks, so the label of
    this one does not have to agree.
    """
    located = [number for number, box in enumerate(found) if box.get("position") is not None]
    if place is not None and located:
        return min(located, key=lambda n: float(np.linalg.norm(np.subtract(found[n]["position"], place))))
    alike = [number for number, box in enumerate(found) if box["label"] == decision.get("label")]
    return alike[0] if len(alike) == 1 else None
