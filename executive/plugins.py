"""Classes that packages register as entry points, and software versions.

The entry points of the project in the working directory are found even if the project is not installed.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import platform
import re
import stat
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import MappingProxyType
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from executive.errors import InputError, Interrupted, to_text
from executive.text.files import has_outside_link, is_outside_path, read_source

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PACKAGE_PREFIX = "package:"
"""Prefix of the name of a file in an installed package, as in `package:airo_models/arms/arm.urdf`."""
ARMS_EXTRA = "arms"
"""Extra with the packages of the models of shipped arms."""
DISTRIBUTION = "pick-place-executive"
"""Name of the distribution of this project; `executive` in the package index is another project."""
MAX_PROJECT_LENGTH = 100_000
"""Maximum length of a pyproject.toml [characters]; a command reads the file several times."""
MAX_DOT_COUNT = 5_000
"""Maximum number of dots in a pyproject.toml."""
CLASS_PATH = re.compile(r"\w+(\.\w+)*:\w+(\.\w+)*")
"""Import path of a class: `module:Class`."""
_EXAMPLE_LINE = 'Wave = "my_package.wave:Wave"'
"""Line of a pyproject.toml that registers a class, for error messages."""


@dataclass(frozen=True)
class PluginEntry:
    """A class that a package registers under a name.

    Attributes:
        name: Name of the entry point.
        value: Import path of the class: `module:Class`.
        noun: Noun for the class in error messages, for instance `skill`.
        remedy: Clause that tells the user how to unregister the class.
    """

    name: str
    value: str
    noun: str
    remedy: str

    def load(self) -> Any:
        """Import and return the class.

        Raises:
            InputError: The import of the module raised an exception, or the class is not in the module.
        """
        try:
            return EntryPoint(self.name, self.value, "").load()
        except Interrupted:
            raise
        except BaseException as error:  # The import runs third-party code, which may raise any exception.
            raise InputError(
                f'the {self.noun} "{self.name}" ({self.value}) cannot be loaded: {type(error).__name__}: '
                f"{to_text(error)}{_locate_error(error)}; correct it, or {self.remedy}"
            ) from error


def list_entries(group: str, noun: str) -> dict[str, PluginEntry]:
    """Return the entries of an entry-point group by name, sorted by name, without importing their classes.

    The folder of the project in the working directory (`find_project`) is appended to `sys.path`. If the
    project is also installed, the entries in its pyproject.toml replace the installed entries. `noun` is the
    noun for a class of the group in error messages.

    Raises:
        InputError: Two packages register the same name, or the pyproject.toml of the project is invalid.
    """
    project = find_project()
    project_name = canonicalize_name(project.name) if project else None
    entries = [
        PluginEntry(name, value, noun, f"uninstall the package {package}")
        for name, value, package in _read_installed_entries(group, tuple(sys.path))
        if canonicalize_name(package) != project_name
    ]
    if project and (project_entries := project.read_entries(group)):
        folder = str(project.file.parent)
        if folder not in sys.path:
            # The folder is the last entry of the path, so that its modules do not shadow installed modules.
            sys.path.append(folder)
        remedy = f"remove it from {project.file}"
        entries += [PluginEntry(name, value, noun, remedy) for name, value in project_entries.items()]
    entry_by_name: dict[str, PluginEntry] = {}
    for entry in sorted(entries, key=lambda entry: (entry.name, entry.value)):
        first_entry = entry_by_name.setdefault(entry.name, entry)
        if first_entry.value != entry.value:
            raise InputError(
                f'the {noun} "{entry.name}" is registered twice, by {first_entry.value} and '
                f"{entry.value}; uninstall or rename one of them"
            )
    return entry_by_name


@functools.cache
def _read_installed_entries(group: str, search_path: tuple[str, ...]) -> tuple[tuple[str, str, str], ...]:
    """Return name, import path and package of each installed entry of a group.

    `search_path` must be `sys.path`: another path may contain other packages.
    """
    del search_path
    entries = entry_points(group=group)
    packages = {entry.dist: entry.dist.name for entry in entries if entry.dist}
    return tuple(
        (entry.name, entry.value, packages[entry.dist] if entry.dist else entry.module.partition(".")[0])
        for entry in entries
    )


def _locate_error(error: BaseException) -> str:
    """Return the clause `, in FILE:LINE` about the plugin code that raised an error, or "" if not found."""
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
    """A Python project: a folder with a pyproject.toml.

    Attributes:
        file: Path of the pyproject.toml.
        name: Name of the project in the file, or "".
        project_table: Content of the table `project` of the file.
    """

    file: Path
    name: str
    project_table: Mapping[str, Any]

    def read_entries(self, group: str) -> dict[str, str]:
        """Return the table `[project.entry-points."<group>"]`: import paths of classes by name.

        Raises:
            InputError: The entry points of the group are not a table of strings `module:Class`.
        """
        groups = self.project_table.get("entry-points", {})
        entries = groups.get(group, {}) if isinstance(groups, dict) else groups
        location = f'{self.file}: [project.entry-points."{group}"]'
        if not isinstance(entries, dict):
            raise InputError(f"{location} is not a table; write lines like {_EXAMPLE_LINE} below it")
        for name, value in entries.items():
            if not isinstance(value, str) or CLASS_PATH.fullmatch(value) is None:
                raise InputError(
                    f'{location}: "{name}" is not the import path of a class: {value!r}; '
                    f"write it as {_EXAMPLE_LINE}"
                )
        return entries


def find_project() -> Project | None:
    """Return the project with the nearest pyproject.toml in the working directory or above, or None.

    The user is assumed to trust the code in the working directory. A pyproject.toml in a folder in which all
    users may write, such as /tmp, is ignored.

    Raises:
        InputError: The file cannot be read, or is not valid TOML.
    """
    try:
        working_directory = Path.cwd()
    except FileNotFoundError:
        return None  # The working directory was deleted.
    for folder in (working_directory, *working_directory.parents):
        file = folder / "pyproject.toml"
        # Unlike `Path.is_file`, `os.path.isfile` returns False if the folder is not readable.
        if os.path.isfile(file) and not _is_shared(folder):
            return _read_project(file)
    return None


def _is_shared(folder: Path) -> bool:
    """Return True if all users may write in a folder, as in /tmp: it is world-writable and sticky."""
    mode = folder.stat().st_mode
    return bool(mode & stat.S_ISVTX and mode & stat.S_IWOTH)


def _read_project(file: Path) -> Project:
    """Return the project with the given pyproject.toml."""
    text = read_source(file).text
    # The time of the parser grows with the square of the number of parts of a dotted key.
    if len(text) > MAX_PROJECT_LENGTH or text.count(".") > MAX_DOT_COUNT:
        raise InputError(f"{file} has more than {MAX_PROJECT_LENGTH} characters or {MAX_DOT_COUNT} dots")
    try:
        content = _parse_toml(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{file} is not valid TOML: {error}; the file registers plugins") from None
    table = content.get("project", {})
    if not isinstance(table, dict):
        raise InputError(f"{file}: project is not a table; begin it with a line [project]")
    return Project(file, str(table.get("name", "")), table)


@functools.lru_cache(maxsize=1)
def _parse_toml(text: str) -> Mapping[str, Any]:
    """Return the content of a text; cached, because each look-up of plugins reads the same file."""
    return tomllib.loads(text)


@functools.cache
def list_versions() -> Mapping[str, str]:
    """Return the versions by name, without packages that are not installed."""
    versions = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    versions |= {name: find_version(name) for name in (DISTRIBUTION, *list_requirements())}
    return MappingProxyType({name: version for name, version in versions.items() if version})


def list_requirements(extra: str = "") -> tuple[str, ...]:
    """Return the packages that this project or its `extra` requires; () if the project is not installed."""
    try:
        requirements = [Requirement(line) for line in metadata.requires(DISTRIBUTION) or ()]
    except metadata.PackageNotFoundError:
        return ()
    required = [r for r in requirements if r.marker is None or r.marker.evaluate({"extra": extra})]
    return tuple(r.name for r in required if not extra or "extra" in str(r.marker))


def find_version(name: str) -> str:
    """Return the version of a distribution, or "" if the distribution is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def find_package_file(reference: str) -> Path:
    """Return the file `path` in the installed package `NAME`, for `package:NAME/path`, without an import.

    Raises:
        InputError: The package is not installed, the path leaves its folder, or the file does not exist.
    """
    name, _, path = reference.removeprefix(PACKAGE_PREFIX).partition("/")
    folder = find_package_folder(name)
    if folder is None:
        advice = "install the package, or copy the model beside the file that names it"
        if canonicalize_name(name) in list_requirements(ARMS_EXTRA):
            command = f'uv sync --extra {ARMS_EXTRA}` or `pip install "{DISTRIBUTION}[{ARMS_EXTRA}]"'
            advice = f"install it with `{command}`"
        raise InputError(f'the package "{name}" of the model {reference} is not installed; {advice}')
    if is_outside_path(path) or has_outside_link(folder, path):
        raise InputError(f'"{reference}" leads out of the folder of the package "{name}"; name a file in it')
    if not os.path.isfile(folder / path):
        raise InputError(f'the package "{name}" has no file "{path}" in {folder}')
    return folder / path


def find_package_folder(name: str) -> Path | None:
    """Return the folder of an installed Python package, which is not imported, or None."""
    spec = importlib.util.find_spec(name) if name.isidentifier() else None
    folders = (spec and spec.submodule_search_locations) or ()
    return next(map(Path, folders), None)
