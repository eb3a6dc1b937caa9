"""Progress messages of commands, on stderr."""

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
"""Minimum time between two progress lines if stderr is not a terminal [s]."""


@contextmanager
def show_progress(
    description: str, *, quiet: bool = False, print_lines: bool = False
) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with the remaining time; the context is its update function `(done, total)`.

    The bar is redrawn ten times per second. If stderr is not a terminal, the bar is not shown.

    Args:
        description: Name of the work, beside the bar.
        quiet: True: show nothing.
        print_lines: True: if stderr is not a terminal, print a line every `LINE_PERIOD` instead.
    """
    console = Console(file=open_unescaped_stderr())
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    disable = quiet or not console.is_interactive
    if print_lines and not quiet and disable:
        yield _make_line_printer(description)
        return
    # The speed is estimated from all finished parts, because in a shorter period no part may finish.
    with Progress(*columns, console=console, disable=disable, speed_estimate_period=math.inf) as progress:
        task = progress.add_task(description, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _make_line_printer(description: str) -> Callable[[int, int], None]:
    """Return an update function `(done, total)` that prints a line at most every `LINE_PERIOD`."""
    start = last_line = time.monotonic()

    def update(done: int, total: int) -> None:
        nonlocal last_line
        now = time.monotonic()
        if done and now - last_line >= LINE_PERIOD:
            last_line = now
            remaining = (now - start) / done * (total - done)
            click.echo(f"{description}: {done} of {total}, about {remaining:.0f} s left", err=True)

    return update


def report_polygons(folder: Path) -> None:
    """Print the number of polygons in labelled images, if there are any, because only boxes are used."""
    from executive.training.samples import Samples

    if count := Samples(folder).polygon_count:
        click.echo(f"note: {count} polygons in {folder} are replaced by their bounding boxes", err=True)


def print_halt() -> None:
    """Print that Ctrl-C or SIGTERM was received, and its consequences."""
    click.echo(
        "halting: no new runs start, and current runs are halted; press Ctrl-C again to quit immediately",
        err=True,
    )
