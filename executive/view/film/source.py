"""What a film is made from: the record of a run on a simulated cell."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.mission.outline import OutlineNode
from executive.record.journal import ending_of, read_journal
from executive.record.recorded_tree import read_tree
from executive.record.run_directory import RunDirectory
from executive.sim.command_log import is_log
from executive.tape.past import Entry, Past
from executive.view.film.ending import Ending


@dataclass(frozen=True, eq=False)
class Source:
    """The record of a run.

    Attributes:
        directory: Where it is.
        past: What counts of its journal.
        start: How the run began.
        nodes: Its tree.
        config: Its cell.
        ending: How it ended.
    """

    directory: RunDirectory
    past: Past
    start: Entry
    nodes: Sequence[OutlineNode]
    config: CellConfig
    ending: Ending

    @staticmethod
    def of(directory: RunDirectory) -> Source:
        """Return the record in a run directory.

        Raises:
            InputError: It lacks what a film is made from.
        """
        _require_log(directory)
        entries = read_journal(directory.journal)
        past = Past.of(entries)
        if past.start is None:
            raise InputError(
                f'the run in "{directory.path}" had not begun when it was cut off; there is nothing to film'
            )
        nodes, config = read_tree(directory.tree), _cell(directory)
        ending = Ending.of(_result(directory), ending_of(entries))
        return Source(directory, past, past.start, nodes, config, ending)

    @property
    def items(self) -> int:
        """How many items the run met with."""
        return len({entry["item"] for entry in self.past.entries if entry["kind"] == "item"})


def _require_log(directory: RunDirectory) -> None:
    """Make sure that there is a world to look at.

    Raises:
        InputError: There is none.
    """
    if not directory.world.exists():
        raise InputError(
            f'the run in "{directory.path}" cannot be filmed: it has no world.log, from which its world is '
            "rebuilt; sweeps keep none. Run the mission once more with `executive run` and the same seed, "
            "and film that run"
        )
    if not is_log(directory.world):
        raise InputError(
            f'the run in "{directory.path}" cannot be filmed: its cell has no simulated world to look at; '
            "film a run on a cell of `kind: sim`"
        )


def _cell(directory: RunDirectory) -> CellConfig:
    """Return the cell that a run was made on.

    Raises:
        InputError: It cannot be read.
    """
    file = directory.path / "cell.yaml"
    try:
        return CellConfig(**yaml.safe_load(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, yaml.YAMLError) as error:
        raise InputError(
            f'the run directory "{directory.path}" holds no cell that can be read: {error}'
        ) from error


def _result(directory: RunDirectory) -> Mapping[str, Any] | None:
    try:
        result = json.loads(directory.result.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        # A run that was cut off left none, or half of one; its film just ends.
        return None
    return result if isinstance(result, dict) else None
