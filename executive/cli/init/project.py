"""The files of a new project, made from the template beside this file."""

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
"""Ends the name of every file of the template, so that nothing takes it for code of this project."""
PACKAGE = "package"
"""The template's folder that gets the package's name."""
MISSION = "sort.yaml"
FOLDERS = ("cells", "runs", "tests")
"""Folders of every new project, which its package stands beside."""

_NAME = re.compile(r"[a-z]([a-z0-9_]*[a-z0-9])?")
_NEXT = "give another name with --name"


def write_project(folder: Path, package: str) -> list[str]:
    """Fill an empty or new folder with a project whose package has this name; return the files' paths.

    Raises:
        InputError: The folder holds something, is a file, or cannot be written to.
    """
    _require_empty(folder)
    # Code and YAML, not HTML: nothing is escaped.
    environment = Environment(autoescape=False, undefined=StrictUndefined, keep_trailing_newline=True)
    files = {
        _place(file, package): environment.from_string(file.read_text(encoding="utf-8")).render(name=package)
        for file in sorted(TEMPLATE.rglob(f"*{SUFFIX}"))
    }
    try:
        for place, text in files.items():
            path = folder / place
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{error.filename or folder} cannot be written: {error.strerror}; name a folder that can"
        ) from None
    return list(files)


def _require_empty(folder: Path) -> None:
    """Return if nothing can be overwritten in a folder, or beside what somebody keeps there."""
    if folder.is_file():
        raise InputError(f'"{folder}" is a file; name a folder that is empty, or not there yet')
    held = sorted(os.listdir(folder)) if folder.exists() else []
    if held:
        raise InputError(
            f'the folder "{folder}" is not empty: it holds {held[0]}'
            f"{f' and {len(held) - 1} more' if held[1:] else ''}; name one that is empty, or not there yet"
        )


def _place(file: Path, package: str) -> str:
    """Return where in the project a file of the template belongs."""
    parts = file.relative_to(TEMPLATE).with_suffix("").parts
    return str(PurePosixPath(*(package if part == PACKAGE else part for part in parts)))


def package_name(folder: Path) -> str:
    """Return the name of a package that is called as `folder` is: `blue_table` for `Blue-Table`.

    Raises:
        InputError: No package can be called so, or its name is taken: importing it might bring another one.
    """
    called = folder.resolve().name
    return require_free(re.sub(r"[-. ]", "_", called).lower(), f'the folder "{called}"')


def require_free(name: str, source: str) -> str:
    """Return `name` if a package can be called so and none is; `source` says what the name was made from.

    Raises:
        InputError: It cannot, or the name is taken.
    """
    if _NAME.fullmatch(name) is None:
        raise InputError(
            f"{source} names no package: such a name begins with a letter, goes on with letters, digits and "
            f'"_", and does not end with "_"; {_NEXT}'
        )
    if why := _taken(name):
        raise InputError(f'a package cannot be called "{name}": {why}; {_NEXT}')
    return name


def _taken(name: str) -> str:
    """Return why nobody else can have a name, or ""."""
    if keyword.iskeyword(name):
        return "that is a word of Python's own"
    if name in FOLDERS:
        return "that is another folder of the project"
    spec = find_spec(name)
    # A folder without any Python is none: it may be the one that is to be filled.
    if spec is not None and spec.origin is not None:
        return f"a module of that name is installed already: {spec.origin}"
    return ""
