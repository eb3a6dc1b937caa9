"""Finding the kinds of work cells that there are."""

from __future__ import annotations

from executive.entry_points import registered
from executive.errors import InputError
from executive.workcell import CellKind

GROUP = "executive.cells"


def cell_kind(name: str) -> CellKind:
    """Return the class that makes cells of a kind.

    Raises:
        InputError: No package offers this kind, or it cannot be loaded.
    """
    entries = registered(GROUP, "kind of cell")
    if name not in entries:
        raise InputError(
            f'no installed package offers cells of kind "{name}"; '
            f"installed: {', '.join(sorted(entries)) or 'none'}"
        )
    kind: CellKind = entries[name].load()
    return kind
