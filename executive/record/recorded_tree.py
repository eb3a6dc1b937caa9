"""The tree of a recorded run, as it was built: what its pictures are drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_json

from executive.errors import InputError
from executive.mission.outline import OutlineNode

_NODES = TypeAdapter(list[OutlineNode])


def tree_text(nodes: Sequence[OutlineNode]) -> str:
    """Return an outline as JSON; values that JSON lacks become text."""
    return to_json(list(nodes), inf_nan_mode="strings", fallback=str, indent=1).decode() + "\n"


def read_tree(path: Path) -> list[OutlineNode]:
    """Return the outline that a file holds.

    Raises:
        InputError: There is no such file, or something else is in it.
    """
    try:
        return _NODES.validate_json(path.read_bytes())
    except OSError as error:
        raise InputError(
            f'cannot read the tree "{path}": {(error.strerror or str(error)).lower()}; '
            "every run leaves one beside its journal since version 0.1"
        ) from error
    except ValidationError as error:
        raise InputError(f'"{path}" holds no tree of a run: {error.errors()[0]["msg"].lower()}') from error
