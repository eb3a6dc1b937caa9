"""Functions that find and load a cell by the path of a cell file or the name of a shipped cell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from executive.cell.config import CellConfig
from executive.errors import InputError
from executive.mission.cell_file import load_cell
from executive.mission.findings import suggest_choice
from executive.mission.yaml_files import get_shipped_folder


def load_cells(
    paths_or_names: tuple[str, ...], overrides: Mapping[str, str] | None = None
) -> dict[str, CellConfig]:
    """Return the configurations of cells by cell name.

    `paths_or_names` contains paths of cell files and names of shipped cells. `overrides` contains values for
    keys of the cells, by key name `cell.KEY.KEY`.

    Raises:
        InputError: A cell does not exist, two cells have the same name, or a file is invalid.
    """
    cells: dict[str, CellConfig] = {}
    for path_or_name in paths_or_names:
        config = load_cell(find_cell(path_or_name), overrides)
        if config.cell in cells:
            raise InputError(f'two cells are called "{config.cell}"; give one of them another name')
        cells[config.cell] = config
    return cells


def find_cell(path_or_name: str) -> Path:
    """Return the path of a cell file, or the path of the shipped cell file with this name.

    Raises:
        InputError: There is neither a cell file with this path nor a shipped cell with this name.
    """
    path = Path(path_or_name)
    if path.is_file():
        return path
    shipped_files = {file.stem: file for file in sorted((get_shipped_folder() / "cells").glob("*.yaml"))}
    if path_or_name in shipped_files:
        return shipped_files[path_or_name]
    choices = suggest_choice(path_or_name, shipped_files, "Shipped cells")
    raise InputError(f'there is neither a cell file nor a shipped cell "{path_or_name}". {choices}')
