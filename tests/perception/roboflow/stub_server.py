"""A Roboflow inference server on the loopback: its three interfaces, and every way to fail."""

from __future__ import annotations

import base64
import contextlib
import gzip
import json
import socket
import threading
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import chain, repeat
from typing import Any

import cv2
import numpy as np

MODEL = "shapes/1"
WORKFLOW = "/acme/workflows/sorting"
"""Path of a workflow with the input `photo` and the output `boxes`."""

Spoil = Callable[[list[dict[str, Any]], dict[str, Any]], Any]
"""From what is there, and the answer around it, to the predictions that it says instead."""
Finds = Callable[[np.ndarray], Sequence[Mapping[str, Any]]]
"""From an RGB image to predictions as the server says them."""


class StubServer:
    """Answers as `finds` says, but for the looks that `faults` names.

    Args:
        finds: What an image shows.
        faults: From the number of a look (from 1) to the name of a fault, "" for none.
    """

    def __init__(self, finds: Finds, faults: Callable[[int], str] = lambda look: "") -> None:
        self.finds = finds
        self.faults = faults
        self.looks = 0
        self.delay = 0.0
        """Time before every answer to an image [s]."""
        self.asked: list[tuple[str, dict[str, str], bytes]] = []
        """Path, headers and body of every request."""
        self.loaded: set[str] = set()
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Listen, at the same address as before."""
        self.over = threading.Event()
        handler = type("Handler", (_Handler,), {"stub": self})
        self._server = ThreadingHTTPServer(("127.0.0.1", self.port), handler)
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True).start()

    def stop(self) -> None:
        """Refuse connections from now on; those that hang are dropped."""
        self.over.set()
        self._server.shutdown()
        self._server.server_close()


class _Handler(BaseHTTPRequestHandler):
    stub: StubServer

    def do_GET(self) -> None:
        self.stub.asked.append((self.path, dict(self.headers), b""))
        self._list_models()

    def _list_models(self) -> None:
        self._json({"models": [{"model_id": m, "task_type": "object-detection"} for m in self.stub.loaded]})

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.stub.asked.append((self.path, dict(self.headers), body))
        if self.path.startswith("/model/add"):
            self.stub.loaded.add(json.loads(body)["model_id"])
            self._list_models()
            return
        if self.path == WORKFLOW:
            data = json.loads(body)["inputs"]["photo"]["value"]
        else:
            data = json.loads(body)["image"]["value"] if self.path.startswith("/infer/") else body.decode()
        bgr = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
        with contextlib.suppress(OSError):  # Nobody may be listening any more.
            self._answer(np.ascontiguousarray(bgr[..., ::-1]))

    def _answer(self, image: np.ndarray) -> None:
        self.stub.looks += 1
        self.stub.over.wait(self.stub.delay)
        fault = self.stub.faults(self.stub.looks)
        height, width = image.shape[:2]
        found = [dict(prediction) for prediction in self.stub.finds(image)]
        answer = {"inference_id": "1", "time": 0.01, "image": {"width": width, "height": height}}
        if fault == "hang":
            self.stub.over.wait()
        elif fault == "stop":
            threading.Thread(target=self.stub.stop).start()
            self.stub.over.wait()
        elif fault.isdecimal():
            # A server may say anything: this one tells the key that it was given.
            key = self.headers.get("Authorization", "").removeprefix("Bearer ")
            self._json({"message": f"key {key} is no good"}, int(fault))
        elif fault in FLOODS:
            self._flood(*FLOODS[fault])
        elif fault in BODIES:
            self._send(BODIES[fault].encode(), "text/html" if fault == "html" else "application/json")
        else:
            spoilt = SPOILT[fault](found, answer) if fault else found
            self._json(self._messages({**answer, "predictions": spoilt}))

    def _messages(self, answer: dict[str, Any]) -> dict[str, Any]:
        """Return the answer of a model, or the answer of a workflow with it."""
        if self.path != WORKFLOW:
            return answer
        boxes = {"image": answer["image"], "predictions": answer["predictions"]}
        if not answer["predictions"]:
            boxes["image"] = {"width": None, "height": None}
        # A picture is larger than anything that the detector hands on.
        picture = {"type": "base64", "value": "A" * (2 << 20)}
        return {"outputs": [{"picture": picture, "boxes": boxes}], "profiler_trace": []}

    def _flood(self, status: int, headers: Mapping[str, str], parts: Callable[[], Iterator[bytes]]) -> None:
        """Send headers and every part of a body for as long as somebody listens."""
        self.send_response(status)
        for header in headers.items():
            self.send_header(*header)
        self.end_headers()
        for part in parts():
            self.wfile.write(part)
            self.stub.over.wait(0.1 if len(part) < 4 else 0.0)

    def _json(self, answer: Any, status: int = 200) -> None:
        self._send(json.dumps(answer).encode(), "application/json", status)

    def _send(self, body: bytes, kind: str, status: int = 200) -> None:
        self._flood(status, {"Content-Type": kind, "Content-Length": str(len(body))}, lambda: iter([body]))

    def log_message(self, format: str, *args: Any) -> None:
        """Keep quiet."""


def _all(**values: Any) -> Spoil:
    """Return what puts other values into every prediction; into one where there are none."""
    some = {"x": 9.0, "y": 9.0, "width": 6.0, "height": 6.0, "confidence": 0.9, "class": "cube"}
    return lambda found, answer: [{**one, **values} for one in found or [some]]


def _other_size(found: list[dict[str, Any]], answer: dict[str, Any]) -> Any:
    answer["image"] = {"width": 1, "height": 1}
    return found


PACKER = zlib.compressobj(wbits=31)
START, BLOCK = (PACKER.compress(b" " * (1 << 20)) + PACKER.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
"""Start of a compressed body, and a block that can be repeated, of 1 MB of blanks each."""
BOMB = START + BLOCK * 1000
GZIP = {"Content-Encoding": "gzip"}
FLOODS: dict[str, tuple[int, dict[str, str], Callable[[], Iterator[bytes]]]] = {
    "oversized": (200, {"Content-Length": "3000000000"}, lambda: repeat(b" " * (1 << 20))),
    "chunks": (200, {"Transfer-Encoding": "chunked"}, lambda: repeat(b"10000\r\n" + b" " * 65536 + b"\r\n")),
    "chunk size": (200, {"Transfer-Encoding": "chunked"}, lambda: repeat(b"1;" + b"x" * (1 << 20))),
    "drip": (200, {"Content-Length": "3000000000"}, lambda: repeat(b" ")),
    "bomb": (200, GZIP, lambda: iter([BOMB])),
    "double bomb": (200, {"Content-Encoding": "gzip, gzip"}, lambda: iter([gzip.compress(BOMB)])),
    "truncated": (200, {"Content-Length": "3000000000"}, lambda: iter([b'{"predictions": []}'])),
    "many values": (200, {}, lambda: chain([b"["], repeat(b"[]," * (1 << 18), 10), [b"0]"])),
    "gzip": (200, GZIP, lambda: iter([gzip.compress(b'{"predictions": []}')])),
    "redirect": (307, {"Location": "http://127.0.0.1:9/infer", "Content-Length": "0"}, lambda: iter(())),
}
"""Status, headers and parts of the body of answers that are too long, in one way or another."""

BODIES = {
    "broken json": '{"predictions": [{"x": 1',
    "html": "<html><body>Please log in to the network.</body></html>",
    "null": "null",
    "foo": '{"foo": 1}',
    "deep": "[" * 100_000,
}
"""Bodies of answers that are none."""

SPOILT: Mapping[str, Spoil] = {
    "nan": _all(x=float("nan")),
    "huge": _all(width=1e6, height=1e6),
    "endless": lambda found, answer: _all()(found, answer) * 400,
    "other size": _other_size,
    "doubtful": _all(confidence=0.2),
    "strangers": lambda found, answer: [*found, *_all(**{"class": "banana"})(found, answer)],
}
"""Faults of an answer that can be read."""
