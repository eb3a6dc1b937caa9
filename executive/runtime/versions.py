"""With what a run was made: this project, Python, the machine, every package asked for by name."""

from __future__ import annotations

import functools
import platform
import re
import sys
from collections.abc import Mapping
from importlib import metadata
from types import MappingProxyType

ITSELF = "executive"
"""The distribution that asks for the others."""


@functools.cache
def versions() -> Mapping[str, str]:
    """Return the version of each by name; a package that is not installed is left out."""
    found = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    for name in (ITSELF, *required()):
        if version := installed(name):
            found[name] = version
    return MappingProxyType(found)


def required(extra: str = "") -> tuple[str, ...]:
    """Return the packages that this project asks for by name on this Python, or those that an extra adds.

    None where it is not installed itself.
    """
    try:
        asked = metadata.requires(ITSELF) or []
    except metadata.PackageNotFoundError:
        return ()
    return tuple(re.split(r"[^A-Za-z0-9._-]", line, maxsplit=1)[0] for line in asked if _wanted(line, extra))


def _wanted(line: str, extra: str) -> bool:
    """Tell whether a line of the metadata asks for something on this Python, for an extra or for none."""
    marker = line.partition(";")[2].replace('"', "'")
    of = re.search(r"extra == '([^']+)'", marker)
    older = re.search(r"python_version < '(\d+)\.(\d+)'", marker)
    if older is not None and sys.version_info[:2] >= tuple(map(int, older.groups())):
        return False
    return (of[1] if of is not None else "") == extra


def installed(name: str) -> str:
    """Return the version of a distribution, or "" where it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""
