"""Loading of cells, given by the path of a cell file or the name of a shipped cell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from executive.cell.config import CellConfig


def load_cells(names: tuple[str, ...], overrides: Mapping[str, str] | None = None) -> dict[str, CellConfig]:
    """Return the cells by name; `names` contains paths of cell files and names of shipped cells.

    `overrides` contains values of keys of the cells, by `cell.<key>.<key>`.

    Raises:
        InputError: A cell does not exist, two cells have the same name, or a file is invalid.
    """
    from executive.errors import InputError
    from executive.mission.parse.cell_file import load_cell

    cells: dict[str, CellConfig] = {}
    for name in names:
        config = load_cell(find_cell(name), overrides)
        if config.cell in cells:
            raise InputError(f'two cells are called "{config.cell}"; give one of them another name')
        cells[config.cell] = config
    return cells


def find_cell(name: str) -> Path:
    """Return the cell file at a path, or the shipped cell with this name.

    Raises:
        InputError: Neither a file nor a shipped cell has this name.
    """
    from executive.errors import InputError
    from executive.mission.findings import suggest_choice
    from executive.mission.text.file_search import get_shipped_folder

    path = Path(name)
    if path.is_file():
        return path
    folder = get_shipped_folder() / "cells"
    shipped = {file.stem: file for file in sorted(folder.glob("*.yaml"))}
    if name in shipped:
        return shipped[name]
    hint = suggest_choice(name, shipped, "Shipped cells")
    raise InputError(f'there is neither a cell file nor a shipped cell "{name}". {hint}')
