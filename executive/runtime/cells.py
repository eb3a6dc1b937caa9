"""Finding the installed kinds of work cells, and asking one what is wrong with a cell file."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import entry_points

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.workcell import CellKind, KeyPath

GROUP = "executive.cells"


def cell_kind(name: str) -> CellKind:
    """Return the class that makes cells of a kind.

    Raises:
        InputError: No installed package offers this kind.
    """
    entries = {entry.name: entry for entry in entry_points(group=GROUP)}
    if name not in entries:
        raise InputError(
            f'no installed package offers cells of kind "{name}"; '
            f"installed: {', '.join(sorted(entries)) or 'none'}"
        )
    kind: CellKind = entries[name].load()
    return kind


def robot_check(config: CellConfig) -> Iterable[tuple[KeyPath, str]]:
    """Return what the robot of a cell file cannot do, each with the key it is about and a sentence.

    Raises:
        InputError: No installed package offers this kind of cell.
    """
    return cell_kind(config.kind).check(config)
