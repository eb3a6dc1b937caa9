"""Bundle of the files that the runs of a sweep read, for workers on other computers."""

from __future__ import annotations

import hashlib
import io
import os.path
import re
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
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
_NAME = re.compile(r""""([^"\n]+)"|'([^'\n]+)'|([^\s"'<>,\[\]{}]+)""")
"""Pattern of a possible file name in a text: a quoted text or a word."""


@dataclass(frozen=True)
class Bundle:
    """A zip file in which every file has its absolute path, so that all relative paths stay valid.

    Attributes:
        content: The zip file; equal files have an equal zip file.
        working_directory: Absolute path of the working directory.
    """

    content: bytes
    working_directory: Path

    @property
    def hash(self) -> str:
        """Hash of the content."""
        return hashlib.sha256(self.content).hexdigest()[:16]

    def unpack(self, root: Path) -> None:
        """Unpack all files below the folder `root`, and make the working directory there."""
        with zipfile.ZipFile(io.BytesIO(self.content)) as archive:
            archive.extractall(root)
        (root / make_relative(self.working_directory)).mkdir(parents=True, exist_ok=True)


def make_bundle(jobs: Sequence[SweepJob]) -> Bundle:
    """Return the files of the missions and scenes of jobs, and of the packages with plugins.

    Shipped files that a mission names are not included, because each worker has them.

    Raises:
        InputError: A file names another file by its absolute path, or the module of a plugin does not exist.
    """
    settings = [job.settings for job in jobs]
    paths = {find_mission(each.mission) for each in settings}
    paths |= {each.scene for each in settings if each.scene}
    values = {text for job in jobs for text in (*job.settings.overrides.values(), *job.variant.values())}
    files = {f"{PACKAGES_FOLDER}/{name}": content for name, content in list_plugin_files()}
    files |= {str(make_relative(path)): path.read_bytes() for path in _find_named_files(paths, values)}
    if project := find_project():
        files[str(make_relative(project.file))] = project.file.read_bytes()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(files):
            # A ZipInfo without a time has the year 1980, so that the content does not depend on the time.
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
    return Bundle(buffer.getvalue(), Path.cwd())


def make_relative(path: Path) -> Path:
    """Return an absolute path as a path relative to the root of the file system."""
    return path.relative_to(path.anchor)


def _find_named_files(paths: Iterable[Path], values: Iterable[str]) -> set[Path]:
    """Return the absolute paths of files, of all files that they name, and of the measured detectors there.

    A name is a path relative to the folder of the file that contains the name. Each value of an override may
    also be a name.
    """
    files: set[Path] = set()
    pending_paths = list(paths)
    while pending_paths:
        path = Path(os.path.abspath(pending_paths.pop()))
        if path in files:
            continue
        files.add(path)
        if path.suffix in TEXT_SUFFIXES:
            matches = _NAME.findall(path.read_text(encoding="utf-8", errors="replace"))
            names = {"".join(match) for match in matches}.union(values)
            for name in (name for name in names if os.path.isfile(path.parent / name)):
                if os.path.isabs(name):
                    advice = f"write a path relative to {path.parent}"
                    raise InputError(f'{path} names "{name}", a path that workers may not have; {advice}')
                pending_paths.append(path.parent / name)
            pending_paths += path.parent.glob(f"*{MEASUREMENT_SUFFIX}")
    return files
