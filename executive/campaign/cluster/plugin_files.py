"""Files of the packages that register skills, control nodes, detectors and kinds of cells."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path

from packaging.utils import canonicalize_name

from executive.errors import InputError
from executive.perception.detectors.detector_registry import DETECTOR_GROUP
from executive.plugins import CELL_KIND_GROUP, SKILL_GROUP, list_entries
from executive.run.versions import DISTRIBUTION
from executive.tree.node_registry import ENTRY_POINT_GROUP as CONTROL_NODE_GROUP

PLUGIN_GROUPS = (SKILL_GROUP, CONTROL_NODE_GROUP, DETECTOR_GROUP, CELL_KIND_GROUP)
"""Groups of entry points with which a package extends this project."""
PROJECT_PACKAGES = ("executive", "skills")
"""Top-level packages of this project, which each worker has."""
METADATA_FILES = ("METADATA", "entry_points.txt")
"""Files of a `dist-info` folder from which Python reads the entry points of a package."""


def list_plugin_files() -> Iterator[tuple[str, bytes]]:
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
