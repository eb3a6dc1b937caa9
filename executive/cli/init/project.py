"""Files of a new project, rendered from the template beside this module."""

from __future__ import annotations

import keyword
import os
import re
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

from jinja2 import Environment, StrictUndefined

from executive.errors import InputError

TEMPLATE = Path(__file__).parent / "template"
SUFFIX = ".jinja"
"""Suffix of every template file: without it, tools would treat the template as code of this project."""
PACKAGE = "package"
"""Folder of the template that is renamed to the name of the package."""
MISSION = "sort.yaml"
FOLDERS = ("cells", "runs", "tests")
"""Folders beside the package in every new project."""

_NAME_PATTERN = re.compile(r"[a-z]([a-z0-9_]*[a-z0-9])?")
_ADVICE = "give another name with --name"


def write_project(folder: Path, package: str) -> list[str]:
    """Create a project in an empty or new folder; return the paths of its files.

    Raises:
        InputError: The folder is not empty, is a file, or cannot be written to.
    """
    _require_empty(folder)
    # The files are code and YAML, not HTML: nothing is escaped.
    environment = Environment(autoescape=False, undefined=StrictUndefined, keep_trailing_newline=True)
    files = {
        _locate(file, package): environment.from_string(file.read_text(encoding="utf-8")).render(name=package)
        for file in sorted(TEMPLATE.rglob(f"*{SUFFIX}"))
    }
    try:
        for path_in_project, text in files.items():
            path = folder / path_in_project
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{error.filename or folder} cannot be written: {error.strerror}; name a folder that can"
        ) from None
    return list(files)


def _require_empty(folder: Path) -> None:
    """Raise an InputError if a folder is a file, or holds files."""
    if folder.is_file():
        raise InputError(f'"{folder}" is a file; name a folder that is empty, or not there yet')
    entries = sorted(os.listdir(folder)) if folder.exists() else []
    if entries:
        raise InputError(
            f'the folder "{folder}" is not empty: it holds {entries[0]}'
            f"{f' and {len(entries) - 1} more' if entries[1:] else ''}; "
            "name one that is empty, or not there yet"
        )


def _locate(file: Path, package: str) -> str:
    """Return the path of a template file in the project."""
    parts = file.relative_to(TEMPLATE).with_suffix("").parts
    return str(PurePosixPath(*(package if part == PACKAGE else part for part in parts)))


def package_name(folder: Path) -> str:
    """Return a package name made from the name of a folder: `blue_table` for `Blue-Table`.

    Raises:
        InputError: The result is not a valid name, or another module has it and might be imported instead.
    """
    folder_name = folder.resolve().name
    return require_free(re.sub(r"[-. ]", "_", folder_name).lower(), f'the folder "{folder_name}"')


def require_free(name: str, source: str) -> str:
    """Return `name` if it is a valid and free name of a package.

    Args:
        name: The name.
        source: Origin of the name, for an error message.

    Raises:
        InputError: The name is invalid, or taken.
    """
    if _NAME_PATTERN.fullmatch(name) is None:
        raise InputError(
            f"{source} names no package: such a name begins with a letter, goes on with letters, digits and "
            f'"_", and does not end with "_"; {_ADVICE}'
        )
    if conflict := _find_conflict(name):
        raise InputError(f'a package cannot be called "{name}": {conflict}; {_ADVICE}')
    return name


def _find_conflict(name: str) -> str:
    """Return the reason why a name is not free, or ""."""
    if keyword.iskeyword(name):
        return "that is a word of Python's own"
    if name in FOLDERS:
        return "that is another folder of the project"
    spec = find_spec(name)
    # A folder without an `__init__.py` is no module: it may be the folder of the new project.
    if spec is not None and spec.origin is not None:
        return f"a module of that name is installed already: {spec.origin}"
    return ""
