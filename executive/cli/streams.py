"""Standard streams that tolerate write errors and escape control characters, and a clean stdout."""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import os
import sys
from collections.abc import Iterator
from typing import Any, TextIO, cast

import click

from executive.errors import escape_control_characters


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
