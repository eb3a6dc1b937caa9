"""Mission, cell and tree of a recorded run, from its directory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_json

from executive.cell.config import CellConfig
from executive.errors import InputError, explained
from executive.events import RunStarted
from executive.mission.outline import OutlineNode
from executive.mission.parse.read_mission import GivenCell
from executive.skill import Skill

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission

_NODES = TypeAdapter(list[OutlineNode])


def recorded_mission(
    path: Path, run: RunStarted, skills: Mapping[str, type[Skill]], mission: Path | None = None
) -> LoadedMission:
    """Return the mission that a run directory holds, with the params and the cell of that run.

    Args:
        path: The run directory.
        run: Start of the run.
        skills: Installed skills by name.
        mission: Another mission file to put in its place, or None.

    Raises:
        MissionError: Something is wrong with the mission: the skills it uses are others by now.
        InputError: The directory lacks a file.
    """
    from executive.mission.load import load_mission

    overrides = {key: text for key, text in run.overrides.items() if not key.startswith("cell.")}
    given = GivenCell(recorded_cell(path), Path(run.base) / "cell.yaml")
    return load_mission(mission or path / "mission.yaml", skills, overrides, cell=given)


def recorded_cell(path: Path) -> CellConfig:
    """Return the cell of the run in a directory.

    Raises:
        InputError: It cannot be read.
    """
    try:
        return CellConfig(**yaml.safe_load((path / "cell.yaml").read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, yaml.YAMLError) as error:
        raise InputError(f'the run directory "{path}" holds no cell that can be read: {error}') from error


def tree_text(nodes: Sequence[OutlineNode]) -> str:
    """Return an outline as JSON; values that JSON lacks become text."""
    return to_json(list(nodes), inf_nan_mode="strings", fallback=str, indent=1).decode() + "\n"


def read_tree(path: Path) -> list[OutlineNode]:
    """Return the outline that a file holds: the tree of a run as it was built.

    Raises:
        InputError: There is no such file, or something else is in it.
    """
    since = "every run leaves one beside its journal since version 0.1"
    with explained(InputError, f'cannot read the tree "{path}"', since):
        content = path.read_bytes()
    try:
        return _NODES.validate_json(content)
    except ValidationError as error:
        raise InputError(f'"{path}" holds no tree of a run: {error.errors()[0]["msg"].lower()}') from error
