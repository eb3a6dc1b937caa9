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

from executive.cli.streams import open_unescaped_stderr

LINE_PERIOD = 10.0
"""Time between two lines about the progress of a command without a terminal [s]."""


@contextmanager
def bar(
    description: str, *, quiet: bool = False, print_lines: bool = False
) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with the remaining time, and yield an update function `(done, total)`.

    The bar is redrawn ten times per second. If stderr is not a terminal, there is no bar.

    Args:
        description: Name of the work.
        quiet: Show nothing.
        print_lines: Without a terminal, write a line every ten seconds.
    """
    console = Console(file=open_unescaped_stderr())
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    disable = quiet or not console.is_interactive
    if print_lines and not quiet and disable:
        yield _line_printer(description)
        return
    # Estimate the speed from all finished parts: in a shorter period, no part may finish.
    with Progress(*columns, console=console, disable=disable, speed_estimate_period=math.inf) as progress:
        number = progress.add_task(description, total=None)
        yield lambda done, total: progress.update(number, completed=done, total=total)


def _line_printer(description: str) -> Callable[[int, int], None]:
    """Return an update function `(done, total)` that prints a line at most every `LINE_PERIOD`."""
    start = shown = time.monotonic()

    def update(done: int, total: int) -> None:
        nonlocal shown
        now = time.monotonic()
        if done and now - shown >= LINE_PERIOD:
            shown = now
            left = (now - start) / done * (total - done)
            click.echo(f"{description}: {done} of {total}, about {left:.0f} s left", err=True)

    return update


def report_polygons(folder: Path) -> None:
    """Print how many boxes of labelled images are made from polygons, if any."""
    from executive.training.samples import Samples

    if count := Samples(folder).polygon_count:
        click.echo(f"note: {count} polygons in {folder} are used as boxes around them", err=True)


def print_halting() -> None:
    """Print that Ctrl-C or SIGTERM was received, and what happens next."""
    click.echo(
        "halting: no new runs start, and current runs are stopped; press Ctrl-C again to quit immediately",
        err=True,
    )
