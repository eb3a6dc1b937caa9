"""Plugins: skills, cell kinds and other classes that packages register as entry points.

The project in the working directory is used like an installed package, even if it is not installed.
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
SKILL_GROUP = "executive.skills"
CELL_KIND_GROUP = "executive.cells"

_CLASS_PATH = re.compile(r"\w+(\.\w+)*:\w+(\.\w+)*")
_EXAMPLE_LINE = 'Wave = "my_package.wave:Wave"'


def load_skills() -> dict[str, type[Skill]]:
    """Return every skill of the entry-point group `executive.skills`, by name.

    Raises:
        InputError: Two packages register the same name, an entry is not a skill or cannot be loaded, or the
            pyproject.toml of the project in the working directory is invalid.
    """
    found: dict[str, type[Skill]] = {}
    for name, entry in list_entries(SKILL_GROUP, "skill").items():
        loaded = entry.load()
        if not (isinstance(loaded, type) and issubclass(loaded, Skill)):
            raise InputError(f'the entry point "{name}" ({entry.value}) is not a Skill subclass')
        found[name] = loaded
    return found


def load_cell_kind(name: str) -> CellKind:
    """Return the class that builds cells of a kind.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    entries = list_entries(CELL_KIND_GROUP, "kind of cell")
    if name not in entries:
        raise InputError(
            f'no installed package offers cells of kind "{name}"; '
            f"installed: {', '.join(sorted(entries)) or 'none'}"
        )
    kind: CellKind = entries[name].load()
    return kind


@dataclass(frozen=True)
class PluginEntry:
    """A class that a package registers under a name.

    Attributes:
        name: Name of the entry point.
        value: Import path of the class: `module:Class`.
        kind: Kind of plugin for error messages, for instance `skill`.
        remedy: Advice to the user if the class cannot be loaded.
    """

    name: str
    value: str
    kind: str
    remedy: str

    def load(self) -> Any:
        """Import and return the class.

        Raises:
            InputError: The import of the module raised an exception, or the module lacks the class.
        """
        try:
            return EntryPoint(self.name, self.value, "").load()
        except Exception as error:  # A plugin's module may raise anything.
            raise InputError(
                f'the {self.kind} "{self.name}" ({self.value}) cannot be loaded: {type(error).__name__}: '
                f"{error}{_locate_error(error)}; correct it, or {self.remedy}"
            ) from error


def list_entries(group: str, kind: str) -> dict[str, PluginEntry]:
    """Return the entries of a group by name, sorted by name, without importing their classes.

    The project in the working directory (`find_project`) need not be installed: this function appends its
    folder to `sys.path`. The entries in its pyproject.toml replace those of an installation of the project.

    Raises:
        InputError: Two packages register the same name, or the pyproject.toml of the project is invalid.
    """
    project = find_project()
    found: dict[str, PluginEntry] = {}
    entries = (*_list_installed_entries(group, kind, project), *_list_project_entries(group, kind, project))
    for entry in sorted(entries, key=lambda entry: (entry.name, entry.value)):
        if entry.name in found and found[entry.name].value != entry.value:
            raise InputError(
                f'the {kind} "{entry.name}" is registered twice, by {found[entry.name].value} and '
                f"{entry.value}; uninstall or rename one of them"
            )
        found[entry.name] = entry
    return found


def _list_installed_entries(group: str, kind: str, project: Project | None) -> Iterator[PluginEntry]:
    """Yield the entries of all installed packages except the project itself."""
    for point in entry_points(group=group):
        package = point.dist.name if point.dist else point.module.partition(".")[0]
        if project is None or _normalize(package) != _normalize(project.name):
            yield PluginEntry(point.name, point.value, kind, f"uninstall the package {package}")


def _list_project_entries(group: str, kind: str, project: Project | None) -> Iterator[PluginEntry]:
    """Yield the entries of the project, and append its folder to `sys.path`."""
    if project is None or not (entries := project.read_entries(group)):
        return
    folder = str(project.file.parent)
    if folder not in sys.path:
        # At the end of the path, the folder cannot shadow installed modules.
        sys.path.append(folder)
    for name, value in entries.items():
        yield PluginEntry(name, value, kind, f"remove it from {project.file}")


def _normalize(package: str) -> str:
    """Return the normalized name of a package: `my-package` for `My_Package`."""
    return re.sub(r"[-_.]+", "-", package).lower()


def _locate_error(error: Exception) -> str:
    """Return file and line of the plugin in which an error was raised, or "" if there are none."""
    if isinstance(error, SyntaxError):
        return ""  # The message of a syntax error already names file and line.
    ignored_folders = Path(__file__).parent, Path(traceback.__file__).parent
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        file = Path(frame.filename)
        is_installed = "site-packages" in file.parts
        if file.is_file() and (is_installed or not any(folder in file.parents for folder in ignored_folders)):
            return f", in {file}:{frame.lineno}"
    return ""


@dataclass(frozen=True)
class Project:
    """A folder with a pyproject.toml.

    Attributes:
        file: Path of the pyproject.toml.
        name: Name of the project in this file, or "".
        project_table: Content of the table `project` in this file.
    """

    file: Path
    name: str
    project_table: Mapping[str, Any]

    def read_entries(self, group: str) -> dict[str, str]:
        """Return the entries of the table `[project.entry-points."<group>"]`: `module:Class` by name.

        Raises:
            InputError: The value is not a table of strings `module:Class`.
        """
        groups = self.project_table.get("entry-points", {})
        entries = groups.get(group, {}) if isinstance(groups, dict) else groups
        if not isinstance(entries, dict):
            raise InputError(
                f"{self._locate(group)} is not a table; write lines like {_EXAMPLE_LINE} below it"
            )
        for name, value in entries.items():
            if not isinstance(value, str) or _CLASS_PATH.fullmatch(value) is None:
                raise InputError(
                    f'{self._locate(group)}: "{name}" names no class: {value!r}; write it as {_EXAMPLE_LINE}'
                )
        return entries

    def _locate(self, group: str) -> str:
        return f'{self.file}: [project.entry-points."{group}"]'


def find_project() -> Project | None:
    """Return the project with the nearest pyproject.toml, in the working directory or above it, or None.

    A user who works in a folder trusts its code, as with pytest. In a folder in which every user may write,
    such as /tmp, a pyproject.toml is ignored.

    Raises:
        InputError: The file cannot be read, or is not TOML.
    """
    try:
        working_directory = Path.cwd()
    except FileNotFoundError:
        return None  # The working directory was deleted.
    for folder in (working_directory, *working_directory.parents):
        file = folder / PROJECT_FILE
        # Unlike `Path.is_file`, `os.path.isfile` returns False if the folder is not readable.
        if os.path.isfile(file) and not _is_shared(folder):
            return _read_project(file)
    return None


def _is_shared(folder: Path) -> bool:
    """Return True if all users may write in a folder, as in /tmp (sticky bit, writable by others)."""
    mode = folder.stat().st_mode
    return bool(mode & stat.S_ISVTX and mode & stat.S_IWOTH)


def _read_project(file: Path) -> Project:
    try:
        content = tomllib.loads(file.read_bytes().decode("utf-8"))
    except OSError as error:
        raise InputError(
            f"{file} cannot be read: {error.strerror}; the plugins of the project are registered there"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file} is not UTF-8 text: byte {error.start} is invalid") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"{file} is not valid TOML: {error}; correct the file: it registers plugins"
        ) from None
    table = content.get("project", {})
    if not isinstance(table, dict):
        raise InputError(f"{file}: project is not a table; begin it with a line [project]")
    return Project(file, str(table.get("name", "")), table)
