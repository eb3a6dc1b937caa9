"""Versions of the software of a run: this project, Python, the machine, and all required packages."""

from __future__ import annotations

import functools
import platform
from collections.abc import Mapping
from importlib import metadata
from types import MappingProxyType

from packaging.requirements import Requirement

DISTRIBUTION = "executive"
"""Name of the distribution of this project."""


@functools.cache
def versions() -> Mapping[str, str]:
    """Return the versions by name; packages that are not installed are left out."""
    found = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    for name in (DISTRIBUTION, *list_requirements()):
        if version := find_version(name):
            found[name] = version
    return MappingProxyType(found)


def list_requirements(extra: str = "") -> tuple[str, ...]:
    """Return the names of the packages that this project requires on this Python, or that an extra adds.

    Empty if the project is not installed.
    """
    try:
        requirements = [Requirement(line) for line in metadata.requires(DISTRIBUTION) or ()]
    except metadata.PackageNotFoundError:
        return ()
    applicable = [one for one in requirements if one.marker is None or one.marker.evaluate({"extra": extra})]
    return tuple(one.name for one in applicable if not extra or "extra" in str(one.marker))


def find_version(name: str) -> str:
    """Return the version of a distribution, or "" if it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def find_installer(name: str) -> str:
    """Return the program that installed a distribution, for instance `pip`; "" if unknown."""
    try:
        return (metadata.distribution(name).read_text("INSTALLER") or "").strip()
    except metadata.PackageNotFoundError:
        return ""
