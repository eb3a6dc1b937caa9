"""Comparison of the software of this computer with the software of a worker: equal software, equal traces."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import executive
from executive.mission.text.file_search import get_shipped_folder
from executive.run.versions import find_version, list_requirements, list_versions

CLUSTER_EXTRA = "cluster"
"""Extra of this project with the packages for the connection to a scheduler."""
FILES_KEY = "files of executive"
"""Key of the hash of the files of this project, whose version number does not change with each commit."""
HASHED_SUFFIXES = (".py", ".yaml", ".onnx")
"""Suffixes of the files that are hashed: code, shipped missions and cells, and models."""


@functools.cache
def describe_environment() -> Mapping[str, str]:
    """Return versions by name, and a hash of the code, missions and models of this project."""
    versions = {name: find_version(name) for name in list_requirements(CLUSTER_EXTRA)}
    return MappingProxyType({**list_versions(), **versions, FILES_KEY: _hash_files()})


def describe_differences(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Return a text with the different properties of this computer and another computer, or ""."""
    pairs = {name: (there.get(name, "missing"), here.get(name, "none")) for name in (*here, *there)}
    return ", ".join(
        f"{name} {one} instead of {other}" for name, (one, other) in pairs.items() if one != other
    )


def _hash_files() -> str:
    """Return a hash of the files of this project; a wheel and a checkout of one commit have the same hash."""
    package = Path(executive.__file__).parent
    digest = hashlib.sha256()
    for folder in (package, package.parent / "skills", get_shipped_folder()):
        files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*")}
        for name in sorted(name for name in files if name.endswith(HASHED_SUFFIXES)):
            if not name.startswith("shipped/"):
                digest.update(f"{name}\0".encode() + files[name].read_bytes())
    return digest.hexdigest()[:12]
