"""Bundle of the files that the runs of a sweep read: a zip file for workers on other computers."""

from __future__ import annotations

import io
import os.path
import re
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from executive.campaign.cluster.plugin_files import list_plugin_files
from executive.campaign.sweep import SweepJob
from executive.errors import InputError
from executive.mission.text.file_search import find_mission
from executive.perception.envelope.measurement import MEASUREMENT_SUFFIX
from executive.plugins import find_project

PACKAGES_FOLDER = ".packages"
"""Folder of the packages with skills, control nodes, detectors and kinds of cells, in an unpacked bundle."""
TEXT_SUFFIXES = (".yaml", ".yml", ".urdf", ".obj", ".mtl")
"""Suffixes of files that name further files: libraries, cells, weights, labels, meshes and textures."""
_FILE_NAME_PATTERN = re.compile(r""""([^"\n]+)"|'([^'\n]+)'|([^\s"'<>,\[\]{}]+)""")
"""Pattern of a possible file name in a text: a quoted text or a word."""


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
    files = {f"{PACKAGES_FOLDER}/{name}": content for name, content in list_plugin_files()}
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
