"""Progress messages of commands, on stderr."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import click
from rich import progress
from rich.console import Console, RenderableType
from rich.text import Text

from executive.cli.streams import open_unescaped_stderr

LINE_PERIOD = 10.0
"""Minimum time between two progress lines if stderr is not a terminal [s]."""


class RateColumn(progress.ProgressColumn):
    """Column of a progress bar with the number of completed parts per minute."""

    def render(self, task: progress.Task) -> Text:
        """Return the content of the column; empty before the first completed part."""
        return Text(f"{60 * task.speed:.1f} per minute" if task.speed else "")


@contextmanager
def show_progress(
    description: str, *, quiet: bool = False, print_lines: bool = False
) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with rate and remaining time if stderr is a terminal; yield the update function.

    The arguments of the update function are the numbers of completed parts and of all parts of the work.

    Args:
        description: Name of the work, beside the bar.
        quiet: True to show nothing.
        print_lines: True to print a line per `LINE_PERIOD` if stderr is not a terminal.
    """
    console = Console(file=open_unescaped_stderr())
    is_hidden = quiet or not console.is_interactive
    if print_lines and not quiet and is_hidden:
        yield _make_line_printer(description)
        return
    # The remaining time is estimated from all completed parts, because a part may take minutes.
    with progress.Progress(
        progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn(),
        RateColumn(), progress.TimeRemainingColumn(),
        console=console, disable=is_hidden, speed_estimate_period=math.inf,
    ) as bar:  # fmt: skip
        task = bar.add_task(description, total=None)
        yield lambda completed, total: bar.update(task, completed=completed, total=total)


def _make_line_printer(description: str) -> Callable[[int, int], None]:
    """Return an update function that prints at most one line per `LINE_PERIOD`."""
    start_time = last_print_time = time.monotonic()

    def update(completed: int, total: int) -> None:
        nonlocal last_print_time
        now = time.monotonic()
        if completed and now - last_print_time >= LINE_PERIOD:
            last_print_time = now
            rate = completed / (now - start_time)
            estimates = f"{60 * rate:.1f} per minute, about {(total - completed) / rate:.0f} s left"
            click.echo(f"{description}: {completed} of {total}, {estimates}", err=True)

    return update


def print_report(lines_and_tables: Iterable[RenderableType]) -> None:
    """Print lines of text, which are not wrapped, and tables to stderr."""
    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    for line_or_table in lines_and_tables:
        console.print(line_or_table, soft_wrap=isinstance(line_or_table, str))


def print_halt() -> None:
    """Print the consequences of the received Ctrl-C or SIGTERM for runs on this computer."""
    click.echo("halting: no new runs start; current runs halt; press Ctrl-C again to quit at once", err=True)


def print_cancellation() -> None:
    """Print the consequences of the received Ctrl-C or SIGTERM for runs on a cluster."""
    click.echo("halting: no new runs start; current runs on the cluster are cancelled", err=True)
