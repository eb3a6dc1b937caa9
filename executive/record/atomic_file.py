"""Atomic writing of files: after an interruption, a file has its old content or its new content."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def replace_atomically(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file that replaces `path` after the `with` block.

    After an exception in the block, the temporary file is removed.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    temporary_path = path.with_name(f".{path.name}.part")
    try:
        temporary_path.touch()
        yield temporary_path
        temporary_path.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary_path.unlink()
        raise


def write_atomically(path: Path, text: str) -> None:
    """Replace the content of the file `path` by `text`, and sync the file to the disk.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    with replace_atomically(path) as temporary_path, temporary_path.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
