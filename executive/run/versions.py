"""Software versions of a run: this project, Python, operating system, machine and required packages."""

from __future__ import annotations

import functools
import platform
from collections.abc import Mapping
from importlib import metadata
from types import MappingProxyType

from packaging.requirements import Requirement

DISTRIBUTION = "pick-place-executive"
"""Name of the distribution of this project; `executive` in the package index is another project."""


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
