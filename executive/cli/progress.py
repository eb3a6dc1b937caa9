"""Progress bars, and reports of lines and tables, on a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import click
from rich import progress
from rich.console import Console, RenderableType
from rich.text import Text

from executive.cli.streams import open_unescaped_stderr


class RateColumn(progress.ProgressColumn):
    """Column of a progress bar with the number of completed parts per minute."""

    def render(self, task: progress.Task) -> Text:
        """Return the content of the column; empty before the first completed part."""
        return Text(f"{60 * task.speed:.1f} per minute" if task.speed else "")


@contextmanager
def show_progress(description: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with rate and remaining time if stderr is a terminal; yield the update function.

    The arguments of the update function are the numbers of completed parts and of all parts of the work.

    Args:
        description: Name of the work, beside the bar.
        quiet: True to show nothing.
    """
    console = Console(file=open_unescaped_stderr())
    is_hidden = quiet or not console.is_interactive
    # The remaining time is estimated from all completed parts, because a part may take minutes.
    with progress.Progress(
        progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn(),
        RateColumn(), progress.TimeRemainingColumn(),
        console=console, disable=is_hidden, speed_estimate_period=math.inf,
    ) as bar:  # fmt: skip
        task = bar.add_task(description, total=None)
        yield lambda completed, total: bar.update(task, completed=completed, total=total)


def print_report(lines_and_tables: Iterable[RenderableType]) -> None:
    """Print lines of text, which are not wrapped, and tables to stderr."""
    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    for line_or_table in lines_and_tables:
        console.print(line_or_table, soft_wrap=isinstance(line_or_table, str))


def print_halt() -> None:
    """Print the consequences of the received Ctrl-C or SIGTERM."""
    click.echo("halting: no new runs start, and current runs end", err=True)
