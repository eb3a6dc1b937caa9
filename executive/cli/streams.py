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


class TolerantStream(io.TextIOBase):
    """Text stream that escapes control characters, and drops all output after the first write error.

    Args:
        stream: Underlying stream; None if the stream was closed when the process started.
        escapes: False to write control characters unchanged, for a library that draws on the terminal.

    Attributes:
        stream: Underlying stream, or None.
        error: Message of the first write error, or "".
    """

    def __init__(self, stream: TextIO | None, *, escapes: bool = True) -> None:
        if isinstance(stream, io.TextIOWrapper):
            # By default, a character that the encoding lacks would cause an error.
            stream.reconfigure(errors="backslashreplace")
        self.stream = stream
        self._escapes = escapes
        self.error = ""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Name of the character encoding of the stream."""
        return "utf-8" if self.stream is None else self.stream.encoding

    def write(self, text: str) -> int:
        """Write `text`; drop the text if the stream is closed or a write has failed."""
        if self.stream is None:
            self.error = "it is closed"
        elif not self.error:
            try:
                self.stream.write(escape_control_characters(text) if self._escapes else text)
            except OSError as error:
                self._stop_writing(self.stream, error)
        return len(text)

    def flush(self) -> None:
        """Flush the buffer of the stream; do nothing if the stream is closed or a write has failed."""
        if self.stream is not None and not self.error:
            try:
                self.stream.flush()
            except OSError as error:
                self._stop_writing(self.stream, error)

    def isatty(self) -> bool:
        """Return True if the stream is a terminal."""
        return self.stream is not None and self.stream.isatty()

    def fileno(self) -> int:
        """Return the number of the stream's file descriptor."""
        return super().fileno() if self.stream is None else self.stream.fileno()

    def _stop_writing(self, stream: TextIO, error: OSError) -> None:
        """Store the error of a write, and connect the stream to the null device."""
        self.error = error.strerror or str(error)
        # Python flushes the stream again at the end of the process; an error would change the exit code.
        with contextlib.suppress(OSError), open(os.devnull, "w") as null_file:
            os.dup2(null_file.fileno(), stream.fileno())


def open_unescaped_stderr() -> TextIO:
    """Return stderr without escaping of control characters, for a library that draws on the terminal."""
    if isinstance(sys.stderr, TolerantStream):
        return cast(TextIO, TolerantStream(sys.stderr.stream, escapes=False))
    return sys.stderr


@contextlib.contextmanager
def use_tolerant_streams() -> Iterator[None]:
    """Make stdout and stderr tolerant in this context; at its end, report a write error of stdout."""
    _open_closed_descriptors()
    with (
        contextlib.redirect_stdout(TolerantStream(sys.stdout)) as stdout,
        contextlib.redirect_stderr(TolerantStream(sys.stderr)) as stderr,
    ):
        try:
            yield
        finally:
            stdout.flush()
            if stdout.error:
                stderr.write(f"note: standard output could not be written: {stdout.error}\n")
            stderr.flush()


def _open_closed_descriptors() -> None:
    """Connect closed standard streams to the null device.

    Otherwise, a file that is opened later would get the descriptor and the output of a closed stream.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


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
