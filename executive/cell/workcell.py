"""Protocols for the run: a work cell with its world, its ledger, and the kinds of work cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from executive.cell.protocols import Cell, MinTimes, Operator, Routes
from executive.cell.visuals import Visuals
from executive.events import Emit, ItemChanged

PLACES = ("right", "wrong_bin", "left", "elsewhere", "fell_in_wrong_bin", "unseen")
"""Keys of the counts of an audit; the last two counts are subsets of the first four."""


class Accounts(Protocol):
    """The methods of a ledger that a run uses at its end and at a resumption."""

    def close(self, *, completed: bool) -> None:
        """Set the final state of each item; `completed` is True if the tree succeeded."""

    def reopen(self) -> None:
        """Remove the items that were left on the table; the next look adds visible objects again."""

    def count_states(self) -> dict[str, int]:
        """Return the number of items by state: `placed`, `rejected`, `skipped`, `lost`, `phantom`.

        The key `seen` has the sum of the first four.
        """

    @property
    def unknown_labels(self) -> Mapping[str, int]:
        """Maximum number of boxes in one look, by label, for labels that the cell file does not declare."""

    @property
    def assumption_reasons(self) -> Sequence[str]:
        """Reasons why error rates of detectors were assumed instead of measured."""

    def list_items(self) -> Sequence[ItemChanged]:
        """Return the current state of each item, in the order of the first detection."""


class Workcell(Protocol):
    """A cell with its world, as a run uses it."""

    @property
    def cell(self) -> Cell:
        """The cell that skills use."""

    @property
    def accounts(self) -> Accounts:
        """The ledger, which the run closes and reads at its end."""

    @property
    def steps(self) -> int:
        """Number of control steps since the start of the run, including those before a resumption."""

    @property
    def last_command(self) -> int:
        """Control step of the last start of a motion, or of the last opening or closing of the tool.

        0 if there was none, or if it is unknown after an interruption of the run.
        """

    def log_to(self, path: Path) -> None:
        """Start a log file from which the simulated world can be reconstructed at any control step.

        The run calls this method before the first control step; a hardware cell writes no log.

        Raises:
            InputError: The file cannot be written.
        """

    def advance(self) -> None:
        """Execute one control step."""

    def visuals(self) -> Visuals | None:
        """Return shapes and poses for displays, or None if the cell has none."""

    def audit(self) -> Mapping[str, int] | None:
        """Return the true final counts of the objects, or None if they are unknown, as on hardware."""

    def close(self) -> None:
        """Release all resources; the cell is unusable afterwards."""


@dataclass(frozen=True)
class ResumePoint:
    """State of a cell at the interruption of a run.

    A simulated world is reconstructed from its log, including the braking arm, and continues the log.

    Attributes:
        log: The log file that `log_to` started.
        frames: Number of captured frames.
        turns: Number of calls of `Camera.next_pose`.
    """

    log: Path
    frames: int = 0
    turns: int = 0


@dataclass(frozen=True)
class CellOptions:
    """Options of a run for its cell.

    Attributes:
        operator: The person or script that requests classes of objects.
        base: Folder to which paths in the cell file are relative.
        gui: True to show the simulated world in a window.
        resume: State of the cell at the interruption of a resumed run; None for a new run.
        scene: Scene file that changes the world of a simulated cell; None: the world is as the cell file
            declares.
    """

    operator: Operator
    base: Path
    gui: bool = False
    resume: ResumePoint | None = None
    scene: Path | None = None


KeyPath = tuple[str | int, ...]
"""Keys on the path from the top level of a cell file to a value, outermost first."""


class CellKind(Protocol):
    """A class of work cells; its name is an entry point of the group `executive.cells`."""

    def __call__(
        self, config: Any, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> Workcell:
        """Return a cell for a cell file (`executive.cell.config.CellConfig`)."""

    def check(self, config: Any, base: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return the errors of a cell file that passes validation, each with its key and a message.

        `base` is the folder to which paths in the file are relative.
        """

    def labels(self, config: Any, base: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return, by detector of a cell file, the labels in the cell of the classes that it can find.

        None for a detector whose classes are unknown before its first answer. Never raises an error: `check`
        reports errors.
        """

    def min_times(self, config: Any) -> MinTimes:
        """Return the minimum times of actions in a cell whose file has no errors by `check`."""
