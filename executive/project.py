"""The project in whose folder one works: what its pyproject.toml registers, installed or not."""

from __future__ import annotations

import os
import re
import stat
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executive.errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

FILE = "pyproject.toml"

_VALUE = re.compile(r"\w+(\.\w+)*:\w+(\.\w+)*")
_LINE = 'Wave = "my_package.wave:Wave"'


@dataclass(frozen=True)
class Project:
    """A folder with a pyproject.toml.

    Attributes:
        file: The pyproject.toml.
        name: What the project is called there, or "".
        tables: Everything that the file holds below `project`.
    """

    file: Path
    name: str
    tables: Mapping[str, Any]

    def registers(self, group: str) -> dict[str, str]:
        """Return what the table `[project.entry-points."<group>"]` says: `module:Class` by name.

        Raises:
            InputError: It is no such table.
        """
        groups = self.tables.get("entry-points", {})
        entries = groups.get(group, {}) if isinstance(groups, dict) else groups
        if not isinstance(entries, dict):
            raise InputError(f"{self._place(group)} is no table; write lines as {_LINE} below it")
        for name, value in entries.items():
            if not isinstance(value, str) or _VALUE.fullmatch(value) is None:
                raise InputError(
                    f'{self._place(group)}: "{name}" names no class: {value!r}; write it as {_LINE}'
                )
        return entries

    def _place(self, group: str) -> str:
        return f'{self.file}: [project.entry-points."{group}"]'


def project_here() -> Project | None:
    """Return the project of the working directory, None outside of any.

    It is that of the nearest pyproject.toml, in the working directory or above it. Whoever works in a folder
    has its code run, as with pytest: nothing else is trusted. So no pyproject.toml counts in a folder that is
    everybody's, as /tmp is, where it may be anyone's.

    Raises:
        InputError: The file cannot be read, or is no TOML.
    """
    try:
        here = Path.cwd()
    except FileNotFoundError:
        return None  # Somebody deleted it meanwhile.
    for folder in (here, *here.parents):
        file = folder / FILE
        # Unlike Path's method this says no of a folder that may not be looked into.
        if os.path.isfile(file) and not _is_everybodys(folder):
            return _read(file)
    return None


def _is_everybodys(folder: Path) -> bool:
    """Tell whether anybody may put a file there beside those of others."""
    mode = folder.stat().st_mode
    return bool(mode & stat.S_ISVTX and mode & stat.S_IWOTH)


def _read(file: Path) -> Project:
    try:
        content = tomllib.loads(file.read_bytes().decode("utf-8"))
    except OSError as error:
        raise InputError(
            f"{file} cannot be read: {error.strerror}; what the project registers stands there"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file} is not UTF-8 text: byte {error.start} does not fit") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file} is no TOML: {error}; mend it: it says what the project registers") from None
    tables = content.get("project", {})
    if not isinstance(tables, dict):
        raise InputError(f"{file}: project is no table; begin it with a line [project]")
    return Project(file, str(tables.get("name", "")), tables)
