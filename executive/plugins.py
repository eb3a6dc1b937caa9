"""Plugins: skills, cell kinds and other classes that packages register by entry points.

The project in whose folder one works counts as a package even if it is not installed.
"""

from __future__ import annotations

import os
import re
import stat
import sys
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from executive.cell.workcell import CellKind
from executive.errors import InputError
from executive.skill import Skill

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROJECT_FILE = "pyproject.toml"
SKILLS = "executive.skills"
CELL_KINDS = "executive.cells"

_VALUE = re.compile(r"\w+(\.\w+)*:\w+(\.\w+)*")
_LINE = 'Wave = "my_package.wave:Wave"'


def discover() -> dict[str, type[Skill]]:
    """Return every skill by name, found through the entry-point group `executive.skills`.

    Raises:
        InputError: Two packages register one name, an entry is no skill or cannot be loaded, or the
            pyproject.toml of the project one works in is wrong.
    """
    found: dict[str, type[Skill]] = {}
    for name, entry in registered(SKILLS, "skill").items():
        loaded = entry.load()
        if not (isinstance(loaded, type) and issubclass(loaded, Skill)):
            raise InputError(f'the entry point "{name}" ({entry.value}) is not a Skill subclass')
        found[name] = loaded
    return found


def cell_kind(name: str) -> CellKind:
    """Return the class that makes cells of a kind.

    Raises:
        InputError: No package offers this kind, or it cannot be loaded.
    """
    entries = registered(CELL_KINDS, "kind of cell")
    if name not in entries:
        raise InputError(
            f'no installed package offers cells of kind "{name}"; '
            f"installed: {', '.join(sorted(entries)) or 'none'}"
        )
    kind: CellKind = entries[name].load()
    return kind


@dataclass(frozen=True)
class PluginEntry:
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


def registered(group: str, kind: str) -> dict[str, PluginEntry]:
    """Return what is registered in a group by name, in the order of the names; nothing is loaded.

    The project one works in (`project_here`) need not be installed: its folder is the last
    place where modules are looked for afterwards. If it is, its pyproject.toml counts all the same, not what
    it said when it was installed.

    Raises:
        InputError: Two packages register one name, or the project's pyproject.toml is wrong.
    """
    project = project_here()
    found: dict[str, PluginEntry] = {}
    entries = (*_installed(group, kind, project), *_own(group, kind, project))
    for entry in sorted(entries, key=lambda entry: (entry.name, entry.value)):
        if entry.name in found and found[entry.name].value != entry.value:
            raise InputError(
                f'the {kind} "{entry.name}" is registered twice, by {found[entry.name].value} and '
                f"{entry.value}; uninstall or rename one of them"
            )
        found[entry.name] = entry
    return found


def _installed(group: str, kind: str, project: Project | None) -> Iterator[PluginEntry]:
    """Yield what installed packages register, the project itself left out."""
    for point in entry_points(group=group):
        package = point.dist.name if point.dist else point.module.partition(".")[0]
        if project is None or _normal(package) != _normal(project.name):
            yield PluginEntry(point.name, point.value, kind, f"uninstall the package {package}")


def _own(group: str, kind: str, project: Project | None) -> Iterator[PluginEntry]:
    """Yield what the project registers; its modules can be imported afterwards."""
    if project is None or not (entries := project.registers(group)):
        return
    folder = str(project.file.parent)
    if folder not in sys.path:
        # At the end: nothing in the folder can stand in for what is installed.
        sys.path.append(folder)
    for name, value in entries.items():
        yield PluginEntry(name, value, kind, f"take it out of {project.file}")


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
            raise InputError(f"{self._locate(group)} is no table; write lines as {_LINE} below it")
        for name, value in entries.items():
            if not isinstance(value, str) or _VALUE.fullmatch(value) is None:
                raise InputError(
                    f'{self._locate(group)}: "{name}" names no class: {value!r}; write it as {_LINE}'
                )
        return entries

    def _locate(self, group: str) -> str:
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
        file = folder / PROJECT_FILE
        # Unlike Path's method this says no of a folder that may not be looked into.
        if os.path.isfile(file) and not _is_everybodys(folder):
            return _read_project(file)
    return None


def _is_everybodys(folder: Path) -> bool:
    """Tell whether anybody may put a file there beside those of others."""
    mode = folder.stat().st_mode
    return bool(mode & stat.S_ISVTX and mode & stat.S_IWOTH)


def _read_project(file: Path) -> Project:
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
