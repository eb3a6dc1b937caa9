"""Atomic writing of files: after an interruption, a file has its old content or its new content."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def replace_atomically(path: Path) -> Iterator[Path]:
    """Yield a temporary file that replaces `path` after the `with` block, or is removed after an exception.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    temporary = path.with_name(f".{path.name}.part")
    try:
        temporary.touch()
        yield temporary
        temporary.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def write_atomically(path: Path, text: str) -> None:
    """Replace the content of the file `path` by `text`, and sync the file to the disk.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    with replace_atomically(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
