"""The mission of a recorded run, as it was run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import yaml

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.mission.load import LoadedMission, load_mission
from executive.mission.parse.read_mission import GivenCell
from executive.skill import Skill
from executive.tape.past import Entry


def recorded_mission(
    path: Path, run: Entry, skills: Mapping[str, type[Skill]], mission: Path | None = None
) -> LoadedMission:
    """Return the mission that a run directory holds, with the params and the cell of that run.

    Args:
        path: The run directory.
        run: The `run` entry of its journal.
        skills: Installed skills by name.
        mission: Another mission file to put in its place, or None.

    Raises:
        MissionError: Something is wrong with the mission: the skills it uses are others by now.
        InputError: The directory lacks a file.
    """
    try:
        cell = CellConfig(**yaml.safe_load((path / "cell.yaml").read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, yaml.YAMLError) as error:
        raise InputError(f'the run directory "{path}" holds no cell that can be read: {error}') from error
    overrides = {key: text for key, text in run["overrides"].items() if not key.startswith("cell.")}
    given = GivenCell(cell, Path(run["base"]) / "cell.yaml")
    return load_mission(mission or path / "mission.yaml", skills, overrides, cell=given)
