"""Finding the installed kinds of work cells."""

from __future__ import annotations

from importlib.metadata import entry_points

from executive.errors import InputError
from executive.workcell import CellKind

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
