"""Versions of everything a run was made with: this project, Python, the machine, every required package."""

from __future__ import annotations

import functools
import platform
from collections.abc import Mapping
from importlib import metadata
from types import MappingProxyType

from packaging.requirements import Requirement

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

    Empty if the project is not installed itself.
    """
    try:
        requirements = [Requirement(line) for line in metadata.requires(ITSELF) or ()]
    except metadata.PackageNotFoundError:
        return ()
    wanted = [one for one in requirements if one.marker is None or one.marker.evaluate({"extra": extra})]
    return tuple(one.name for one in wanted if not extra or "extra" in str(one.marker))


def installed(name: str) -> str:
    """Return the version of a distribution, or "" where it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def installer(name: str) -> str:
    """Return the program that installed a distribution, for instance `pip`; "" if that is not known."""
    try:
        return (metadata.distribution(name).read_text("INSTALLER") or "").strip()
    except metadata.PackageNotFoundError:
        return ""
