"""Bundle of the files that the runs of a sweep read: a zip file for workers on other computers."""

from __future__ import annotations

import importlib.util
import io
import os.path
import re
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import distributions
from pathlib import Path

from packaging.utils import canonicalize_name

from executive.campaign.sweep_job import SweepJob
from executive.errors import InputError
from executive.mission.yaml_files import find_mission
from executive.perception.detectors.detector_registry import DETECTOR_GROUP
from executive.perception.envelope import MEASUREMENT_SUFFIX
from executive.plugins import CELL_KIND_GROUP, SKILL_GROUP, find_project, list_entries
from executive.run.versions import DISTRIBUTION
from executive.tree.node import ENTRY_POINT_GROUP as CONTROL_NODE_GROUP

PACKAGES_FOLDER = ".packages"
"""Folder of the packages with skills, control nodes, detectors and kinds of cells, in an unpacked bundle."""
TEXT_SUFFIXES = (".yaml", ".yml", ".urdf", ".obj", ".mtl")
"""Suffixes of files that name further files: libraries, cells, weights, labels, meshes and textures."""
_FILE_NAME_PATTERN = re.compile(r""""([^"\n]+)"|'([^'\n]+)'|([^\s"'<>,\[\]{}]+)""")
"""Pattern of a possible file name in a text: a quoted text or a word."""
PLUGIN_GROUPS = (SKILL_GROUP, CONTROL_NODE_GROUP, DETECTOR_GROUP, CELL_KIND_GROUP)
"""Groups of entry points with which a package extends this project."""
PROJECT_PACKAGES = ("executive", "skills")
"""Top-level packages of this project, which each worker has."""
METADATA_FILES = ("METADATA", "entry_points.txt")
"""Files of a `dist-info` folder from which Python reads the entry points of a package."""


def make_bundle(jobs: Sequence[SweepJob]) -> bytes:
    """Return a zip file with the files of the missions and scenes of jobs, and of the packages with plugins.

    Each file of a mission or scene has its absolute path, so that all relative paths stay valid. A shipped
    file that is named in another folder is not included, because each worker has the same version of this
    project. Equal files have an equal zip file.

    Raises:
        InputError: A file names another file by its absolute path, or the module of a plugin does not exist.
    """
    settings = [job.settings for job in jobs]
    paths = {find_mission(each.mission) for each in settings}
    paths |= {each.scene for each in settings if each.scene}
    values = {text for job in jobs for text in (*job.settings.overrides.values(), *job.variant.values())}
    files = {f"{PACKAGES_FOLDER}/{name}": content for name, content in _list_plugin_files()}
    files |= {str(path): path.read_bytes() for path in _find_named_files(paths, values)}
    if project := find_project():
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
        if is_plugin and name != DISTRIBUTION:
            folder = f"{name.replace('-', '_')}-{distribution.version}.dist-info"
            for file in METADATA_FILES:
                yield f"{folder}/{file}", (distribution.read_text(file) or "").encode()
    entries = (entry for group in PLUGIN_GROUPS for entry in list_entries(group, "plugin").values())
    modules = {entry.value.partition(":")[0].partition(".")[0] for entry in entries}
    for module in sorted(modules.difference(PROJECT_PACKAGES)):
        yield from _list_module_files(module)


def _list_module_files(module: str) -> Iterator[tuple[str, bytes]]:
    """Yield path and content of the files of a top-level module."""
    spec = importlib.util.find_spec(module)
    if spec is None:
        raise InputError(f'the module "{module}" of an entry point does not exist; install its package again')
    for folder in map(Path, spec.submodule_search_locations or ()):
        for path in sorted(folder.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                yield f"{module}/{path.relative_to(folder)}", path.read_bytes()
    if spec.submodule_search_locations is None and spec.origin:
        yield Path(spec.origin).name, Path(spec.origin).read_bytes()
