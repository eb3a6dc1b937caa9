"""Atomic writing of files: an interruption leaves the old content or the new content."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def atomic_replacement(path: Path) -> Iterator[Path]:
    """Yield a temporary file; it replaces `path` after the block, or is removed after an exception.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        part.touch()
        yield part
        part.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise


def write_atomically(path: Path, text: str) -> None:
    """Replace the content of the file `path` by `text`, and sync the file to the disk.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    with atomic_replacement(path) as part, part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
