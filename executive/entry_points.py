"""What packages register by entry points: those that are installed, and the project one works in."""

from __future__ import annotations

import re
import sys
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from executive.errors import InputError
from executive.project import Project, project_here


@dataclass(frozen=True)
class Entry:
    """A class that some package offers under a name.

    Attributes:
        name: The name.
        value: Where it is: `module:Class`.
        kind: What it is, for the text of an error: `skill`.
        remedy: What helps where it cannot be loaded.
    """

    name: str
    value: str
    kind: str
    remedy: str

    def load(self) -> Any:
        """Return the class.

        Raises:
            InputError: Something is wrong in its module, whatever it is.
        """
        try:
            return EntryPoint(self.name, self.value, "").load()
        except Exception as error:  # whatever stands in somebody's module
            raise InputError(
                f'the {self.kind} "{self.name}" ({self.value}) cannot be loaded: {type(error).__name__}: '
                f"{error}{_place(error)}; mend it, or {self.remedy}"
            ) from error


def registered(group: str, kind: str) -> dict[str, Entry]:
    """Return what is registered in a group by name, in the order of the names; nothing is loaded.

    The project one works in (`executive.project.project_here`) need not be installed: its folder is the last
    place where modules are looked for afterwards. If it is, its pyproject.toml counts all the same, not what
    it said when it was installed.

    Raises:
        InputError: Two packages register one name, or the project's pyproject.toml is wrong.
    """
    project = project_here()
    found: dict[str, Entry] = {}
    entries = (*_installed(group, kind, project), *_own(group, kind, project))
    for entry in sorted(entries, key=lambda entry: (entry.name, entry.value)):
        if entry.name in found and found[entry.name].value != entry.value:
            raise InputError(
                f'the {kind} "{entry.name}" is registered twice, by {found[entry.name].value} and '
                f"{entry.value}; uninstall or rename one of them"
            )
        found[entry.name] = entry
    return found


def _installed(group: str, kind: str, project: Project | None) -> Iterator[Entry]:
    """Yield what installed packages register, the project itself left out."""
    for point in entry_points(group=group):
        package = point.dist.name if point.dist else point.module.partition(".")[0]
        if project is None or _normal(package) != _normal(project.name):
            yield Entry(point.name, point.value, kind, f"uninstall the package {package}")


def _own(group: str, kind: str, project: Project | None) -> Iterator[Entry]:
    """Yield what the project registers; its modules can be imported afterwards."""
    if project is None or not (entries := project.registers(group)):
        return
    folder = str(project.file.parent)
    if folder not in sys.path:
        # At the end: nothing in the folder can stand in for what is installed.
        sys.path.append(folder)
    for name, value in entries.items():
        yield Entry(name, value, kind, f"take it out of {project.file}")


def _normal(package: str) -> str:
    """Return the form of a package's name in which all its spellings are the same."""
    return re.sub(r"[-_.]+", "-", package).lower()


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
