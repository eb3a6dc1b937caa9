"""Plugins: skills, cell kinds and other classes that packages register by entry points.

The project of the working directory counts as a package even if it is not installed.
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

_CLASS_PATH = re.compile(r"\w+(\.\w+)*:\w+(\.\w+)*")
_EXAMPLE_LINE = 'Wave = "my_package.wave:Wave"'


def discover() -> dict[str, type[Skill]]:
    """Return every skill of the entry-point group `executive.skills`, by name.

    Raises:
        InputError: Two packages register one name, an entry is not a skill or cannot be loaded, or the
            pyproject.toml of the working directory's project is invalid.
    """
    found: dict[str, type[Skill]] = {}
    for name, entry in list_entries(SKILLS, "skill").items():
        loaded = entry.load()
        if not (isinstance(loaded, type) and issubclass(loaded, Skill)):
            raise InputError(f'the entry point "{name}" ({entry.value}) is not a Skill subclass')
        found[name] = loaded
    return found


def cell_kind(name: str) -> CellKind:
    """Return the class that builds cells of a kind.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    entries = list_entries(CELL_KINDS, "kind of cell")
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
        value: Place of the class: `module:Class`.
        kind: Kind of plugin as named in an error message: `skill`.
        remedy: Advice to the user if the class cannot be loaded.
    """

    name: str
    value: str
    kind: str
    remedy: str

    def load(self) -> Any:
        """Return the class.

        Raises:
            InputError: Importing the module of the class raised an exception.
        """
        try:
            return EntryPoint(self.name, self.value, "").load()
        except Exception as error:  # A plugin's module may raise anything.
            raise InputError(
                f'the {self.kind} "{self.name}" ({self.value}) cannot be loaded: {type(error).__name__}: '
                f"{error}{_locate_error(error)}; correct it, or {self.remedy}"
            ) from error


def list_entries(group: str, kind: str) -> dict[str, PluginEntry]:
    """Return the entries of a group by name, sorted by name, without loading their classes.

    The project of the working directory (`project_here`) need not be installed: afterwards its folder is the
    last in which Python looks for modules. If the project is installed, the entries in its pyproject.toml
    count, not those at the time of the installation.

    Raises:
        InputError: Two packages register one name, or the project's pyproject.toml is invalid.
    """
    project = project_here()
    found: dict[str, PluginEntry] = {}
    entries = (*_list_installed(group, kind, project), *_list_own(group, kind, project))
    for entry in sorted(entries, key=lambda entry: (entry.name, entry.value)):
        if entry.name in found and found[entry.name].value != entry.value:
            raise InputError(
                f'the {kind} "{entry.name}" is registered twice, by {found[entry.name].value} and '
                f"{entry.value}; uninstall or rename one of them"
            )
        found[entry.name] = entry
    return found


def _list_installed(group: str, kind: str, project: Project | None) -> Iterator[PluginEntry]:
    """Yield the entries of all installed packages except the project itself."""
    for point in entry_points(group=group):
        package = point.dist.name if point.dist else point.module.partition(".")[0]
        if project is None or _normalize(package) != _normalize(project.name):
            yield PluginEntry(point.name, point.value, kind, f"uninstall the package {package}")


def _list_own(group: str, kind: str, project: Project | None) -> Iterator[PluginEntry]:
    """Yield the entries of the project, and make its modules importable."""
    if project is None or not (entries := project.registers(group)):
        return
    folder = str(project.file.parent)
    if folder not in sys.path:
        # At the end of the path, the folder cannot shadow installed modules.
        sys.path.append(folder)
    for name, value in entries.items():
        yield PluginEntry(name, value, kind, f"take it out of {project.file}")


def _normalize(package: str) -> str:
    """Return the normalized name of a package: `my-package` for `My_Package`."""
    return re.sub(r"[-_.]+", "-", package).lower()


def _locate_error(error: Exception) -> str:
    """Return the file and line in which a module raised an error, or "" if no code of a plugin did."""
    if isinstance(error, SyntaxError):
        return ""  # The message of a syntax error names file and line.
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
        file: The pyproject.toml.
        name: Name of the project in this file, or "".
        tables: Content of the table `project` in this file.
    """

    file: Path
    name: str
    tables: Mapping[str, Any]

    def registers(self, group: str) -> dict[str, str]:
        """Return the entries of the table `[project.entry-points."<group>"]`: `module:Class` by name.

        Raises:
            InputError: The entry is not a table of strings `module:Class`.
        """
        groups = self.tables.get("entry-points", {})
        entries = groups.get(group, {}) if isinstance(groups, dict) else groups
        if not isinstance(entries, dict):
            raise InputError(f"{self._locate(group)} is no table; write lines as {_EXAMPLE_LINE} below it")
        for name, value in entries.items():
            if not isinstance(value, str) or _CLASS_PATH.fullmatch(value) is None:
                raise InputError(
                    f'{self._locate(group)}: "{name}" names no class: {value!r}; write it as {_EXAMPLE_LINE}'
                )
        return entries

    def _locate(self, group: str) -> str:
        return f'{self.file}: [project.entry-points."{group}"]'


def project_here() -> Project | None:
    """Return the project of the working directory, or None if there is no project.

    The project is that of the nearest pyproject.toml, in the working directory or above it. A user who works
    in a folder trusts its code, as with pytest. In a shared folder such as /tmp, any user may have written
    the pyproject.toml: there it is ignored.

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
    """Return True if every user may add files to a folder that holds files of others, as /tmp."""
    mode = folder.stat().st_mode
    return bool(mode & stat.S_ISVTX and mode & stat.S_IWOTH)


def _read_project(file: Path) -> Project:
    try:
        content = tomllib.loads(file.read_bytes().decode("utf-8"))
    except OSError as error:
        raise InputError(
            f"{file} cannot be read: {error.strerror}; it lists the plugins of the project"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file} is not UTF-8 text: byte {error.start} does not fit") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file} is no TOML: {error}; correct it: it lists the plugins") from None
    tables = content.get("project", {})
    if not isinstance(tables, dict):
        raise InputError(f"{file}: project is no table; begin it with a line [project]")
    return Project(file, str(tables.get("name", "")), tables)
