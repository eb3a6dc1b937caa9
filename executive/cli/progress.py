"""Progress of a command, on stderr."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from executive.cli.streams import drawing_stream

LINE_PERIOD = 10.0
"""Time between two lines about the progress of a command without a terminal [s]."""


@contextmanager
def bar(what: str, *, quiet: bool = False, lines: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a bar with the time left, and yield a function that takes the numbers of done and of all parts.

    It is drawn ten times a second, and not at all where stderr is no terminal.

    Args:
        what: Name of the work.
        quiet: Show nothing.
        lines: Without a terminal, write a line every ten seconds.
    """
    console = Console(file=drawing_stream())
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    disable = quiet or not console.is_interactive
    if lines and not quiet and disable:
        yield _lines(what)
        return
    # The speed is that of all parts: none may end within a shorter time.
    with Progress(*columns, console=console, disable=disable, speed_estimate_period=math.inf) as progress:
        number = progress.add_task(what, total=None)
        yield lambda done, total: progress.update(number, completed=done, total=total)


def _lines(what: str) -> Callable[[int, int], None]:
    """Return a function that takes the numbers of done and of all parts, and now and then writes a line."""
    began = shown = time.monotonic()

    def update(done: int, total: int) -> None:
        nonlocal shown
        now = time.monotonic()
        if done and now - shown >= LINE_PERIOD:
            shown = now
            left = (now - began) / done * (total - done)
            click.echo(f"{what}: {done} of {total}, about {left:.0f} s left", err=True)

    return update


def report_polygons(folder: Path) -> None:
    """Say how many boxes of labelled images are made from polygons, if any."""
    from executive.vision.samples import Samples

    if count := Samples(folder).polygon_count:
        click.echo(f"note: {count} polygons in {folder} are used as boxes around them", err=True)


def say_halting() -> None:
    """Say that Ctrl-C or SIGTERM was heard, and what comes of it."""
    click.echo(
        "halting: no further run begins, and those under way are cut; once more ends at once", err=True
    )
