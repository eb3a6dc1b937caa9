"""Files that are there whole or not at all, whatever stops the writing."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a file to write into; it takes the place of `path` when nothing went wrong, else it is removed.

    Raises:
        OSError: The disk does not take it; what was at `path` before, if anything, is still there.
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


def write_whole(path: Path, text: str) -> None:
    """Make `text` the content of `path`, and have it on the disk.

    Raises:
        OSError: The disk does not take it; what was at `path` before, if anything, is still there.
    """
    with replacing(path) as part, part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
