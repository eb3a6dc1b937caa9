"""Where a film goes: a file that is there whole, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from executive.errors import InputError


@contextmanager
def file_for(path: Path, *, force: bool) -> Iterator[Path]:
    """Yield where to write what is to be at `path`; it gets there, whole, when nothing went wrong.

    Raises:
        InputError: There is something already, or nothing can be written there.
    """
    if path.exists() and not force:
        raise InputError(
            f'"{path}" is there already; name another file with -o, or write over it with --force'
        )
    part = path.with_name(f".{path.name}.part")
    try:
        part.touch()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f'cannot write the film "{path}": {reason}; name another place with -o') from error
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
