"""Checks that relative paths, which users write in files, stay inside a folder."""

from __future__ import annotations

from pathlib import Path, PurePosixPath


def is_outside_path(path_text: str) -> bool:
    """Return True if a path may lead out of its folder: it is absolute, or contains `..` or a backslash."""
    path = PurePosixPath(path_text)
    return path.is_absolute() or ".." in path.parts or "\\" in path_text


def has_outside_link(folder: Path, path_text: str) -> bool:
    """Return True if a relative path leads out of a folder through a symbolic link."""
    return not (folder / path_text).resolve().is_relative_to(folder.resolve())
