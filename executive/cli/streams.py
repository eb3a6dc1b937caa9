"""Output of commands: streams that tolerate write errors, a clean stdout, results, tables and progress bars.

The functions import rich themselves, because a command that needs no rich would wait 0.1 s.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, TextIO, cast

import click

from executive.errors import escape_control_characters

if TYPE_CHECKING:
    from rich.console import RenderableType


class TolerantStream:
    """Text stream that escapes control characters, and drops all output after the first write error.

    Args:
        stream: Underlying stream.
        escapes: False to write control characters unchanged, for a library that draws on the terminal.

    Attributes:
        stream: Underlying stream.
        error: Message of the first write error, or "".
    """

    def __init__(self, stream: TextIO, *, escapes: bool = True) -> None:
        if isinstance(stream, io.TextIOWrapper):
            # By default, a character that the encoding lacks would cause an error.
            stream.reconfigure(errors="backslashreplace")
        self.stream = stream
        self.encoding = stream.encoding
        self.isatty = stream.isatty
        self.fileno = stream.fileno
        self._escapes = escapes
        self.error = ""

    def write(self, text: str) -> int:
        """Write `text`; drop the text if a write has failed."""
        with self._tolerate_errors():
            self.stream.write(escape_control_characters(text) if self._escapes else text)
        return len(text)

    def flush(self) -> None:
        """Flush the buffer of the stream."""
        with self._tolerate_errors():
            self.stream.flush()

    @contextlib.contextmanager
    def _tolerate_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.error = error.strerror or str(error)
            # Later writes, and the flush at the end of the process, go to the null device.
            with contextlib.suppress(OSError), open(os.devnull, "w") as null_file:
                os.dup2(null_file.fileno(), self.stream.fileno())


def open_unescaped_stderr() -> TextIO:
    """Return stderr without escaping of control characters, for a library that draws on the terminal."""
    return cast(TextIO, TolerantStream(getattr(sys.stderr, "stream", sys.stderr), escapes=False))


@contextlib.contextmanager
def use_tolerant_streams() -> Iterator[None]:
    """Make stdout and stderr tolerant in this context; at its end, report a write error of stdout."""
    # Otherwise, a file that is opened later would get the descriptor and the output of a closed stream.
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    # `print`, click and rich use no other attributes of a stream than the class has.
    stdout: Any = TolerantStream(sys.stdout or io.StringIO())
    stderr: Any = TolerantStream(sys.stderr or io.StringIO())
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        try:
            yield
        finally:
            stdout.flush()
            if stdout.error:
                stderr.write(f"note: standard output could not be written: {stdout.error}\n")
            stderr.flush()


@contextlib.contextmanager
def keep_stdout_clean() -> Iterator[None]:
    """Redirect Python's stdout to stderr, and drop the stdout of C libraries (pybullet), in this context."""
    sys.stdout.flush()
    real_stdout = os.dup(1)
    try:
        with open(os.devnull, "w") as null_file:
            os.dup2(null_file.fileno(), 1)
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        # Without a flush, the C library would write its buffer to the real stdout later.
        ctypes.CDLL(None).fflush(None)
        os.dup2(real_stdout, 1)
        os.close(real_stdout)


def print_json(value: Any) -> None:
    """Print `value` to stdout as one JSON object or array."""
    click.echo(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))


def print_result(value: Any, text: str, *, as_json: bool) -> None:
    """Print the result of a command to stdout: `value` as JSON, or `text`."""
    print_json(value) if as_json else click.echo(text)


@contextlib.contextmanager
def show_progress(description: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with rate and remaining time if stderr is a terminal; yield the update function.

    The arguments of the update function are the numbers of completed parts and of all parts of the work.

    Args:
        description: Name of the work, beside the bar.
        quiet: True to show nothing.
    """
    from rich import progress
    from rich.console import Console

    console = Console(file=open_unescaped_stderr())
    is_hidden = quiet or not console.is_interactive
    # The remaining time is estimated from all completed parts, because a part may take minutes.
    with progress.Progress(
        progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn(),
        progress.TextColumn("{task.fields[rate]}"), progress.TimeRemainingColumn(),
        console=console, disable=is_hidden, speed_estimate_period=math.inf,
    ) as bar:  # fmt: skip
        task = bar.add_task(description, total=None, rate="")

        def update(completed: int, total: int) -> None:
            bar.update(task, completed=completed, total=total)
            if speed := bar.tasks[0].speed:
                bar.update(task, rate=f"{60 * speed:.1f} per minute")

        yield update


def print_report(lines_and_tables: Iterable[RenderableType]) -> None:
    """Print lines of text, which are not wrapped, and tables to stderr."""
    from rich.console import Console

    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    for line_or_table in lines_and_tables:
        console.print(line_or_table, soft_wrap=isinstance(line_or_table, str))


def print_halt() -> None:
    """Print the consequences of the received Ctrl-C or SIGTERM."""
    click.echo("halting: no new runs start, and current runs end", err=True)
