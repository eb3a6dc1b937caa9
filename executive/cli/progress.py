"""How far a command is, on stderr."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

UNKNOWN = "-:--:--"
"""Shown while nobody can know how long it will take."""


@contextmanager
def bar(what: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a bar with the time left, and yield what moves it: a function told how many of how many are done.

    It is drawn ten times a second, and not at all where stderr is no terminal.
    """
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeLeft())
    with Progress(*columns, console=console, disable=quiet or not console.is_interactive) as progress:
        number = progress.add_task(what, total=None, spent=0.0)
        (task,) = progress.tasks

        def told(done: int, total: int) -> None:
            progress.update(number, completed=done, total=total, spent=task.elapsed or 0.0)

        yield told


class TimeLeft(ProgressColumn):
    """The time left, if all parts take as long as those that are done.

    Rich's own column looks at the last half minute alone, in which no epoch of a training ends.
    """

    def render(self, task: Task) -> Text:
        """Return it as `0:12:30`."""
        left = time_left(int(task.completed), task.total, task.fields["spent"], task.elapsed or 0.0)
        return Text(left, style="progress.remaining")


def time_left(done: int, total: float | None, spent: float, elapsed: float) -> str:
    """Return as `0:12:30` how long it will take yet.

    Args:
        done: How many parts are done.
        total: How many there are; None as long as nobody knows.
        spent: Time that the parts that are done have taken [s].
        elapsed: Time since the beginning [s].
    """
    if total is None or done == 0:
        return UNKNOWN
    minutes, seconds = divmod(max(0, round(spent * total / done - elapsed)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}"


def say_halting() -> None:
    """Say that Ctrl-C or SIGTERM was heard, and what comes of it."""
    click.echo(
        "halting: no further run begins, and those under way are cut; once more ends at once", err=True
    )
