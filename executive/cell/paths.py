"""Checks that paths in files of the user stay below a folder."""

from __future__ import annotations

from pathlib import Path, PurePosixPath


def leaves_folder(written: str) -> bool:
    """Return True if a path is absolute or contains `..` or a backslash."""
    path = PurePosixPath(written)
    return path.is_absolute() or ".." in path.parts or "\\" in written


def links_out(folder: Path, written: str) -> bool:
    """Return True if a path below a folder leads out of it through a link."""
    return not (folder / written).resolve().is_relative_to(folder.resolve())
