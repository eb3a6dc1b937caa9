"""Progress messages of commands, on stderr."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)

from executive.cli.streams import open_unescaped_stderr

LINE_PERIOD = 10.0
"""Minimum time between two progress lines if stderr is not a terminal [s]."""


@contextmanager
def show_progress(
    description: str, *, quiet: bool = False, print_lines: bool = False, has_rate: bool = False
) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with the remaining time if stderr is a terminal; yield the update function.

    The arguments of the update function are the numbers of completed parts and of all parts of the work.

    Args:
        description: Name of the work, beside the bar.
        quiet: True to show nothing.
        print_lines: True to print a line per `LINE_PERIOD` if stderr is not a terminal.
        has_rate: True to show the number of completed parts per minute.
    """
    console = Console(file=open_unescaped_stderr())
    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()]
    columns += [TextColumn("{task.fields[rate]}")] if has_rate else []
    is_hidden = quiet or not console.is_interactive
    if print_lines and not quiet and is_hidden:
        yield _make_line_printer(description, has_rate=has_rate)
        return
    # The remaining time is estimated from all completed parts, because a part may take minutes.
    columns.append(TimeRemainingColumn())
    with Progress(*columns, console=console, disable=is_hidden, speed_estimate_period=math.inf) as progress:
        task, start_time = progress.add_task(description, total=None, rate=""), time.monotonic()

        def update(completed: int, total: int) -> None:
            rate = _format_rate(completed, start_time)
            progress.update(task, completed=completed, total=total, rate=rate)

        yield update


def _format_rate(completed: int, start_time: float) -> str:
    """Return the number of parts completed per minute since `start_time` (of `time.monotonic`) as text."""
    return f"{60 * completed / max(time.monotonic() - start_time, 1e-9):.1f} per minute"


def _make_line_printer(description: str, *, has_rate: bool) -> Callable[[int, int], None]:
    """Return an update function that prints at most one line per `LINE_PERIOD`."""
    start_time = last_print_time = time.monotonic()

    def update(completed: int, total: int) -> None:
        nonlocal last_print_time
        now = time.monotonic()
        if completed and now - last_print_time >= LINE_PERIOD:
            last_print_time = now
            remaining_time = (now - start_time) / completed * (total - completed)
            rate = f", {_format_rate(completed, start_time)}" if has_rate else ""
            remaining = f"about {remaining_time:.0f} s left"
            click.echo(f"{description}: {completed} of {total}{rate}, {remaining}", err=True)

    return update


def report_polygons(folder: Path) -> None:
    """Print a note if labels in a dataset folder are polygons, of which only the bounding boxes are used."""
    from executive.training.samples import Samples

    if count := Samples(folder).polygon_count:
        click.echo(f"note: {count} polygons in {folder} are replaced by their bounding boxes", err=True)


def print_halt() -> None:
    """Print the consequences of the received Ctrl-C or SIGTERM."""
    click.echo("halting: no new runs start; current runs halt; press Ctrl-C again to quit at once", err=True)
