"""Loading pybullet without its greeting, which would stand between the lines of a view or a log."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from importlib import import_module


@contextlib.contextmanager
def silenced(descriptor: int) -> Iterator[None]:
    """Drop what is written to a file descriptor meanwhile, by whatever library."""
    try:
        kept = os.dup(descriptor)
    except OSError:  # It is closed: nothing can be written to it.
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, descriptor)
        yield
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)
        os.close(nowhere)


with silenced(2):
    import_module("pybullet")
