"""Reading of the mission, the cell and the tree of a recorded run from its directory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError

from executive.cell.config import CellConfig
from executive.errors import InputError, explain_os_errors
from executive.events import RunStarted
from executive.mission.cell_file import CellFile
from executive.mission.outline import OutlineNode
from executive.skill import Skill
from executive.tree.specification import Source

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission

_NODES_ADAPTER = TypeAdapter(list[OutlineNode], config=ConfigDict(ser_json_inf_nan="strings"))
"""Encoder and decoder of `tree.json`."""


def read_mission_of_run(
    path: Path, start: RunStarted, skills: Mapping[str, type[Skill]], mission: Path | None = None
) -> LoadedMission:
    """Return the mission of a run directory, with the params and the cell of the run.

    Args:
        path: The run directory.
        start: Event of the start of the run.
        skills: Installed skills by name.
        mission: Mission file that replaces the recorded mission, or None.

    Raises:
        MissionError: The mission has errors, for instance because installed skills have changed.
        InputError: A file in the directory cannot be read.
    """
    from executive.mission.load import load_mission

    # The recorded cell file already contains the overrides of the cell.
    overrides = {key: text for key, text in start.overrides.items() if not key.startswith("cell.")}
    cell_path = Path(start.base) / "cell.yaml"
    recorded_cell = CellFile(cell_path, read_cell(path), Source(str(cell_path), ""))
    return load_mission(mission or path / "mission.yaml", skills, overrides, recorded_cell=recorded_cell)


def read_cell(path: Path) -> CellConfig:
    """Return the content of the cell file in the run directory `path`.

    Raises:
        InputError: The cell file cannot be read.
    """
    try:
        return CellConfig(**yaml.safe_load((path / "cell.yaml").read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, yaml.YAMLError) as error:
        raise InputError(f'cannot read the cell file in the run directory "{path}": {error}') from error


def format_tree(nodes: Sequence[OutlineNode]) -> str:
    """Return an outline as the text of `tree.json`; values that JSON cannot represent become strings."""
    return _NODES_ADAPTER.dump_json(list(nodes), by_alias=True, fallback=str, indent=1).decode() + "\n"


def read_tree(path: Path) -> list[OutlineNode]:
    """Return the outline of the tree of a run from its file `tree.json`.

    Raises:
        InputError: The file cannot be read or contains no outline.
    """
    with explain_os_errors(InputError, f'cannot read the tree "{path}"'):
        content = path.read_bytes()
    try:
        return _NODES_ADAPTER.validate_json(content)
    except ValidationError as error:
        raise InputError(f'"{path}" contains no tree of a run: {error.errors()[0]["msg"].lower()}') from error
