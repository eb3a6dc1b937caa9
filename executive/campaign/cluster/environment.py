"""Comparison of the software of client and worker; only the same software produces the same traces."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import executive
from executive.errors import InputError
from executive.mission.yaml_files import get_shipped_folder
from executive.run.versions import find_version, list_requirements, list_versions

if TYPE_CHECKING:
    from distributed import Worker

CLUSTER_EXTRA = "cluster"
"""Extra of this project with the packages for the connection to a scheduler."""
FILES_KEY = "hash of the files of executive"
"""Key of the hash of this project's files, which differs for commits with the same version number."""
HASHED_SUFFIXES = (".py", ".yaml", ".onnx", ".urdf")
"""Suffixes of the hashed files: code, shipped missions and cells, models of detectors and of the tool."""
INSTALLATION_ADVICE = "install the same versions there, and start the scheduler and its workers again"
"""Advice to the user of a worker with other software."""


@functools.cache
def describe_environment() -> Mapping[str, str]:
    """Return versions by name, and a hash of the code, missions and models of this project."""
    cluster_versions = {name: find_version(name) for name in list_requirements(CLUSTER_EXTRA)}
    return {**list_versions(), **cluster_versions, FILES_KEY: _hash_files()}


def check_environment(client_versions: Mapping[str, str], dask_worker: Worker) -> None:
    """Compare the software of the client with the software of this worker.

    Raises:
        InputError: The software differs.
    """
    worker_versions = describe_environment()
    differences = [
        f"{name} {worker_versions.get(name, 'missing')} instead of {client_versions.get(name, 'none')}"
        for name in {**client_versions, **worker_versions}
        if worker_versions.get(name) != client_versions.get(name)
    ]
    if differences:
        subject = f"the software of the worker {dask_worker.address} differs from this computer"
        raise InputError(f"{subject}: {', '.join(differences)}; {INSTALLATION_ADVICE}")


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
