"""Exchange with the workers of a cluster: bundle of files, versions of the software, and returned runs.

This file needs no package of the extra `cluster`.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import io
import os
import os.path
import re
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import distributions
from pathlib import Path
from typing import TYPE_CHECKING

from packaging.utils import canonicalize_name

import executive
from executive import plugins
from executive.behaviours import SKILL_GROUP
from executive.campaign.jobs import SweepJob
from executive.campaign.results import RunRecord
from executive.cell.devices import DRIVER_GROUP
from executive.cell.tools import TOOL_GROUP
from executive.errors import InputError, explain_os_errors
from executive.motion.joints import IK_SOLVER_GROUP
from executive.perception.detectors.detector_registry import DETECTOR_GROUP
from executive.perception.detectors.envelope import MEASUREMENT_SUFFIX
from executive.record.run_directory import FOLDER_ADVICE, make_unique_folder
from executive.text.yaml_files import find_cell, find_mission, get_shipped_folder
from executive.tree.node import ENTRY_POINT_GROUP as CONTROL_NODE_GROUP

if TYPE_CHECKING:
    from distributed import Worker

PACKAGES_FOLDER = ".packages"
"""Folder of the packages with plugins (`PLUGIN_GROUPS`), in an unpacked bundle."""
TEXT_SUFFIXES = (".yaml", ".yml", ".urdf", ".obj", ".mtl")
"""Suffixes of files that name further files: libraries, cells, weights, labels, meshes and textures."""
_FILE_NAME_PATTERN = re.compile(r""""([^"\n]+)"|'([^'\n]+)'|([^\s"'<>,\[\]{}]+)""")
"""Pattern of a possible file name in a text: a quoted text or a word."""
PLUGIN_GROUPS = (
    SKILL_GROUP, CONTROL_NODE_GROUP, DETECTOR_GROUP, DRIVER_GROUP, IK_SOLVER_GROUP, TOOL_GROUP,
)  # fmt: skip
"""Groups of entry points with which a package extends this project."""
PROJECT_PACKAGES = ("executive", "skills")
"""Top-level packages of this project, which each worker has."""
METADATA_FILES = ("METADATA", "entry_points.txt")
"""Files of a `dist-info` folder from which Python reads the entry points of a package."""
CLUSTER_EXTRA = "cluster"
"""Extra of this project with the packages for the connection to a scheduler."""
FILES_KEY = "hash of the files of executive"
"""Key of the hash of this project's files, which differs for commits with the same version number."""
HASHED_SUFFIXES = (".py", ".yaml", ".onnx", ".urdf")
"""Suffixes of the hashed files: code, shipped missions and cells, models of detectors and of the tool."""
INSTALLATION_ADVICE = "install the same versions there, and start the scheduler and its workers again"
"""Advice to the user of a worker with other software."""
RUN_TEXT_SUFFIXES = (".html", ".json", ".jsonl", ".yaml")
"""Suffixes of the files that may contain paths."""


def make_bundle(jobs: Sequence[SweepJob]) -> bytes:
    """Return a zip file with the files that jobs read, and of the packages with plugins.

    Each file of a mission, cell or scene has its absolute path, so that all relative paths stay valid. A
    shipped file that is named in another folder is not included, because each worker has the same version
    of this project. Equal files have an equal zip file.

    Raises:
        InputError: A file names another file by its absolute path, or the module of a plugin does not exist.
    """
    settings = [job.settings for job in jobs]
    paths = {find_mission(each.mission) for each in settings}
    paths |= {find_cell(each.replacing_cell) for each in settings if each.replacing_cell}
    paths |= {each.scene for each in settings if each.scene}
    values = {text for job in jobs for text in (*job.settings.overrides.values(), *job.variant.values())}
    files = {f"{PACKAGES_FOLDER}/{name}": content for name, content in _list_plugin_files()}
    files |= {str(path): path.read_bytes() for path in _find_named_files(paths, values)}
    if project := plugins.find_project():
        files[str(project.file)] = project.file.read_bytes()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(files):
            # A ZipInfo without a time has the year 1980, so that the content does not depend on the time.
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _find_named_files(paths: Iterable[Path], values: Iterable[str]) -> set[Path]:
    """Return the absolute paths of the given files and of all files that these files name.

    A named file may name further files. The measurement files in the folder of a file with names are
    included. A name is a path relative to the folder of the file that contains the name. Each value of an
    override may also be a name.
    """
    files: set[Path] = set()
    pending_paths = list(paths)
    while pending_paths:
        path = Path(os.path.abspath(pending_paths.pop()))
        if path in files:
            continue
        files.add(path)
        if path.suffix in TEXT_SUFFIXES:
            matches = _FILE_NAME_PATTERN.findall(path.read_text(encoding="utf-8", errors="replace"))
            names = {"".join(match) for match in matches}.union(values)
            for name in (name for name in names if os.path.isfile(path.parent / name)):
                if os.path.isabs(name):
                    advice = f"write a path relative to {path.parent}"
                    raise InputError(f'{path} names "{name}", a path that workers may not have; {advice}')
                pending_paths.append(path.parent / name)
            pending_paths += path.parent.glob(f"*{MEASUREMENT_SUFFIX}")
    return files


def _list_plugin_files() -> Iterator[tuple[str, bytes]]:
    """Yield path and content of each file that a worker needs to load the plugins of other packages.

    The paths are relative to a folder of Python's search path. The packages on which the other packages
    depend are not included.

    Raises:
        InputError: The module of an entry point does not exist.
    """
    for distribution in distributions():
        name = canonicalize_name(distribution.name)
        is_plugin = any(entry.group in PLUGIN_GROUPS for entry in distribution.entry_points)
        if is_plugin and name != plugins.DISTRIBUTION:
            folder = f"{name.replace('-', '_')}-{distribution.version}.dist-info"
            for file in METADATA_FILES:
                yield f"{folder}/{file}", (distribution.read_text(file) or "").encode()
    entries = (entry for group in PLUGIN_GROUPS for entry in plugins.list_entries(group, "plugin").values())
    modules = {entry.value.partition(":")[0].partition(".")[0] for entry in entries}
    for module in sorted(modules.difference(PROJECT_PACKAGES)):
        yield from _list_module_files(module)


def _list_module_files(module: str) -> Iterator[tuple[str, bytes]]:
    spec = importlib.util.find_spec(module)
    if spec is None:
        raise InputError(f'the module "{module}" of an entry point does not exist; install its package again')
    for folder in map(Path, spec.submodule_search_locations or ()):
        for path in sorted(folder.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                yield f"{module}/{path.relative_to(folder)}", path.read_bytes()
    if spec.submodule_search_locations is None and spec.origin:
        yield Path(spec.origin).name, Path(spec.origin).read_bytes()


@functools.cache
def describe_environment() -> Mapping[str, str]:
    """Return versions by name, and a hash of the code, missions and models of this project."""
    cluster_versions = {name: plugins.find_version(name) for name in plugins.list_requirements(CLUSTER_EXTRA)}
    return {**plugins.list_versions(), **cluster_versions, FILES_KEY: _hash_files()}


def _hash_files() -> str:
    """Return a hash of the files of this project; a wheel and a checkout of one commit have the same hash."""
    package = Path(executive.__file__).parent
    digest = hashlib.sha256()
    for folder in (package, package.parent / "skills", get_shipped_folder()):
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder).as_posix()
            if name.endswith(HASHED_SUFFIXES) and not name.startswith("shipped/"):
                digest.update(f"{name}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


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


@dataclass(frozen=True)
class ReturnedRun:
    """A run that a worker returns.

    Attributes:
        root: Folder of the unpacked bundle on the worker. A path on the worker is `root` followed by the path
            on the client.
        record: Record of the run.
        run_directory: Zip file with the files of the run directory; empty if there is no run directory.
    """

    root: str
    record: RunRecord
    run_directory: bytes


def pack_run(record: RunRecord, root: Path) -> ReturnedRun:
    """Return a run, and delete its run directory on the worker."""
    content = b""
    if record.run.run_directory:
        archive = Path(shutil.make_archive(record.run.run_directory, "zip", record.run.run_directory))
        content = archive.read_bytes()
        archive.unlink()
        shutil.rmtree(record.run.run_directory)
    return ReturnedRun(str(root), record, content)


def unpack_run(returned: ReturnedRun) -> RunRecord:
    """Write the run directory, and return the record; both contain the paths on the client.

    Raises:
        InputError: A file cannot be written.
    """
    run = returned.record.run
    message = run.message.replace(returned.root, "")
    path = Path(run.run_directory.replace(returned.root, ""))
    if run.run_directory:
        folder = path
        with explain_os_errors(InputError, f'cannot write the run directory "{folder}"', FOLDER_ADVICE):
            folder.parent.mkdir(parents=True, exist_ok=True)
            # Runs of two workers may have the same name.
            path = make_unique_folder(folder.parent, folder.name)
            with zipfile.ZipFile(io.BytesIO(returned.run_directory)) as archive:
                archive.extractall(path)
            for file in (file for file in path.rglob("*") if file.suffix in RUN_TEXT_SUFFIXES):
                content = file.read_bytes().replace(returned.root.encode(), b"")
                file.write_bytes(content.replace(bytes(folder), bytes(path)))
        message = message.replace(str(folder), str(path))
    directory = str(path) if run.run_directory else ""
    return replace(returned.record, run=replace(run, message=message, run_directory=directory))
