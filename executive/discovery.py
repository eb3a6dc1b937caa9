"""The skills that are installed, whoever's packages register them."""

from __future__ import annotations

import traceback
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from executive.errors import InputError
from executive.skill import Skill


def discover() -> dict[str, type[Skill]]:
    """Return every installed skill by name, found through the entry-point group `executive.skills`.

    Raises:
        InputError: Two packages register one name, or an entry is no skill or cannot be loaded.
    """
    found: dict[str, type[Skill]] = {}
    origin: dict[str, str] = {}
    for entry in sorted(entry_points(group="executive.skills"), key=lambda e: (e.name, e.value)):
        if entry.name in found and origin[entry.name] != entry.value:
            raise InputError(
                f'the skill "{entry.name}" is registered twice, by {origin[entry.name]} and {entry.value}; '
                "uninstall or rename one of them"
            )
        loaded = _loaded(entry)
        if not (isinstance(loaded, type) and issubclass(loaded, Skill)):
            raise InputError(f'the entry point "{entry.name}" ({entry.value}) is not a Skill subclass')
        found[entry.name], origin[entry.name] = loaded, entry.value
    return found


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except Exception as error:  # whatever stands in somebody's module
        package = entry.dist.name if entry.dist else entry.module.partition(".")[0]
        raise InputError(
            f'the skill "{entry.name}" ({entry.value}) cannot be loaded: {type(error).__name__}: {error}'
            f"{_place(error)}; mend it, or uninstall the package {package}"
        ) from error


def _place(error: Exception) -> str:
    """Return file and line at which a module goes wrong, or "" if that is not in its own code."""
    if isinstance(error, SyntaxError):
        return ""  # its text says so
    others = Path(__file__).parent, Path(traceback.__file__).parent
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        file = Path(frame.filename)
        installed = "site-packages" in file.parts
        if file.is_file() and (installed or not any(folder in file.parents for folder in others)):
            return f", in {file}:{frame.lineno}"
    return ""
