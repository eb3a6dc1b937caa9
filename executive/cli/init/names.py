"""What a new project's package may be called."""

from __future__ import annotations

import keyword
import re
import sys
from importlib.util import find_spec
from pathlib import Path

from executive.errors import InputError

FOLDERS = ("cells", "runs", "tests")
"""Folders of every new project, which its package stands beside."""
OWN = ("executive", "skills")
"""Packages of the executive."""

_NAME = re.compile(r"[a-z]([a-z0-9_]*[a-z0-9])?")
_NEXT = "give another name with --name"


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
    if name in OWN:
        return "that is a package of the executive"
    if name in FOLDERS:
        return "that is another folder of the project"
    if name in sys.stdlib_module_names:
        return "that is a module of Python's standard library"
    spec = find_spec(name)
    # A folder without any Python is none: it may be the one that is to be filled.
    if spec is not None and spec.origin is not None:
        return f"a module of that name is installed already, {spec.origin}"
    return ""
