"""Whether the simulator can draw, by what, and how fast."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from executive.cli.doctor.finding import Finding
from executive.programs import program

LONGEST = 30.0
"""Time after which nobody waits for a picture any longer [s]."""


@dataclass(frozen=True)
class Drawing:
    """How a try to draw went.

    Attributes:
        milliseconds: What a frame of 640 x 480 pixels took, or None where none came.
        why: Why none came, or "".
    """

    milliseconds: float | None
    why: str = ""


def renderer(draw: Callable[[str], Drawing] | None = None) -> Iterator[Finding]:
    """Yield how fast TinyRenderer draws, and whether PyBullet's EGL plugin does."""
    tiny, egl = map(draw or drawn, ("tiny", "egl"))
    if tiny.milliseconds is None:
        yield Finding(
            "problem", "renderer", f"TinyRenderer draws nothing: {tiny.why}",
            "run `uv sync --reinstall-package pybullet`",
        )  # fmt: skip
    else:
        told = f"TinyRenderer, on the processor: {tiny.milliseconds:.0f} ms for 640x480 of the overhead cell"
        yield Finding("ok", "renderer", told)
    if egl.milliseconds is None:
        yield Finding("note", "egl", f"PyBullet's EGL plugin draws nothing: {egl.why}", "no cell needs it")
    else:
        told = "PyBullet's EGL plugin can be loaded and draws; no cell needs it"
        yield Finding("ok", "egl", told)


def drawn(way: str) -> Drawing:
    """Return how a try to draw went, by `tiny` or `egl`, in a process that a driver may take down."""
    module = f"{__package__}.drawing"
    try:
        ended = subprocess.run(
            program(module, way), capture_output=True, text=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired:
        return Drawing(None, f"no frame came in {LONGEST:.0f} s")
    return understood(ended.returncode, ended.stdout, ended.stderr)


def understood(code: int, printed: str, complained: str) -> Drawing:
    """Return what a process that was to draw has said; drivers print what they like around it."""
    told = [line for line in printed.splitlines() if line.startswith('{"milliseconds"')]
    if told:
        return Drawing(float(json.loads(told[-1])["milliseconds"]))
    if code < 0:
        return Drawing(None, f"its process was ended by {signal.Signals(-code).name}")
    *_, last = ["it says nothing", *filter(str.strip, complained.splitlines())]
    return Drawing(None, f"its process ended with {code}: {last.strip()}")
