"""With what a run was made: this project, Python, the machine, every package asked for by name."""

from __future__ import annotations

import functools
import platform
import re
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


def required() -> tuple[str, ...]:
    """Return the packages that this project asks for by name on this Python, extras left out.

    None where it is not installed itself.
    """
    try:
        asked = metadata.requires(ITSELF) or []
    except metadata.PackageNotFoundError:
        return ()
    plain = (line for line in asked if "extra ==" not in line and "python_version <" not in line)
    return tuple(re.split(r"[^A-Za-z0-9._-]", line, maxsplit=1)[0] for line in plain)


def installed(name: str) -> str:
    """Return the version of a distribution, or "" where it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""
