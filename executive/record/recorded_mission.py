"""Mission, cell and tree of a recorded run, from its directory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_json

from executive.cell.config import CellConfig
from executive.errors import InputError, explain_os_errors
from executive.events import RunStarted
from executive.mission.outline import OutlineNode
from executive.mission.parse.read_mission import GivenCell
from executive.skill import Skill

if TYPE_CHECKING:
    from executive.mission.load import LoadedMission

_NODES = TypeAdapter(list[OutlineNode])


def read_mission_of_run(
    path: Path, run: RunStarted, skills: Mapping[str, type[Skill]], mission: Path | None = None
) -> LoadedMission:
    """Return the mission of a run directory, with the params and the cell of the run.

    Args:
        path: The run directory.
        run: Start of the run.
        skills: Installed skills by name.
        mission: Mission file that replaces the recorded mission, or None.

    Raises:
        MissionError: The mission has errors, for instance because installed skills have changed.
        InputError: A file of the directory cannot be read.
    """
    from executive.mission.load import load_mission

    overrides = {key: text for key, text in run.overrides.items() if not key.startswith("cell.")}
    given = GivenCell(read_cell(path), Path(run.base) / "cell.yaml")
    return load_mission(mission or path / "mission.yaml", skills, overrides, cell=given)


def read_cell(path: Path) -> CellConfig:
    """Return the configuration of the cell in a run directory.

    Raises:
        InputError: The file of the cell cannot be read.
    """
    try:
        return CellConfig(**yaml.safe_load((path / "cell.yaml").read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, yaml.YAMLError) as error:
        raise InputError(f'the run directory "{path}" holds no cell that can be read: {error}') from error


def format_tree(nodes: Sequence[OutlineNode]) -> str:
    """Return an outline as JSON; values that JSON cannot represent become text."""
    return to_json(list(nodes), inf_nan_mode="strings", fallback=str, indent=1).decode() + "\n"


def read_tree(path: Path) -> list[OutlineNode]:
    """Return the outline of the built tree of a run from a file.

    Raises:
        InputError: The file cannot be read or holds no outline.
    """
    hint = "every run leaves one beside its journal since version 0.1"
    with explain_os_errors(InputError, f'cannot read the tree "{path}"', hint):
        content = path.read_bytes()
    try:
        return _NODES.validate_json(content)
    except ValidationError as error:
        raise InputError(f'"{path}" holds no tree of a run: {error.errors()[0]["msg"].lower()}') from error
