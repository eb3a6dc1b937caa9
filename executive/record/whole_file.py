"""Files that are there whole or not at all, whatever stops the writing."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Make `text` the content of `path`, and have it on the disk.

    Raises:
        OSError: The disk does not take it; what was at `path` before, if anything, is still there.
    """
    fresh = path.with_name(f".{path.name}.part")
    try:
        with fresh.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            fresh.unlink()
        raise
