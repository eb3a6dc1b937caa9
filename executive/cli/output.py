"""Standard output belongs to the result: everything else a command causes to be printed goes to stderr."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import sys
from collections.abc import Iterator
from typing import Any

import click


@contextlib.contextmanager
def stdout_kept_clean() -> Iterator[None]:
    """Send what Python prints meanwhile to stderr, and drop what C libraries print to stdout.

    pybullet does so whenever a world is made; there is nothing in it that anybody needs.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        # What waits in the C library's buffer would come out later, on the real standard output.
        ctypes.CDLL(None).fflush(None)
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def print_json(value: Any) -> None:
    """Write `value` as the one object or array on standard output."""
    click.echo(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))
