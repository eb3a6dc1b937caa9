"""Protocols of a work cell: the cell that skills use, the world around it, and the kinds of cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from executive.cell.protocols import Cell, MinTimes, Operator, Routes
from executive.cell.visuals import Visuals
from executive.events import Emit, ItemChanged

PLACES = ("right", "wrong_bin", "left", "elsewhere", "fell_in_wrong_bin", "unseen")
"""Keys of the counts of an audit; the last two count objects that are also among the first four."""


class Accounts(Protocol):
    """The part of a ledger that a run uses at its end and when it is resumed."""

    def close(self, *, completed: bool) -> None:
        """Decide the final state of each item; `completed` is True if the tree succeeded."""

    def reopen(self) -> None:
        """Forget the items that were left on the table; the next look adds those that still lie there."""

    def count_states(self) -> dict[str, int]:
        """Return the counts `seen, placed, rejected, skipped, lost, phantom`.

        `seen` is the sum of the next four.
        """

    @property
    def unknown(self) -> Mapping[str, int]:
        """Largest number of boxes in one look for each label that the cell does not know."""

    @property
    def doubts(self) -> Sequence[str]:
        """Reasons why error rates of detectors were assumed and not measured."""

    def summaries(self) -> Sequence[ItemChanged]:
        """Return the present state of each item, in the order of the first detection."""


class Workcell(Protocol):
    """A cell together with its world, as a run drives it."""

    @property
    def cell(self) -> Cell:
        """The cell that skills see."""

    @property
    def accounts(self) -> Accounts:
        """The ledger; at its end, the run closes the ledger and reads its counts and items."""

    @property
    def steps(self) -> int:
        """Number of control steps since the run began, those before a resumption included."""

    @property
    def last_command(self) -> int:
        """Control step of the last start of a motion, or of the last opening or closing of the tool.

        0 if there was none, or if the cell of an interrupted run cannot know it.
        """

    def log_to(self, path: Path) -> None:
        """Start a log file from which the simulated world can be rebuilt at any control step.

        The run calls this before the first control step; a hardware cell keeps no log.

        Raises:
            InputError: The file cannot be written.
        """

    def advance(self) -> None:
        """Let one control step pass."""

    def visuals(self) -> Visuals | None:
        """Return the scene for viewers, or None if the cell has none."""

    def audit(self) -> Mapping[str, int] | None:
        """Return the true final counts of the objects, or None if they are unknown, as on hardware."""

    def close(self) -> None:
        """Release all resources; the cell cannot be used afterwards."""


@dataclass(frozen=True)
class ResumePoint:
    """State of a cell in which an interrupted run left it.

    A simulated world is rebuilt from its log, with the arm braking; the log is continued.

    Attributes:
        log: File that `log_to` started.
        frames: Number of images taken.
        turns: Number of calls of the camera's `next_pose`.
    """

    log: Path
    frames: int = 0
    turns: int = 0


@dataclass(frozen=True)
class CellOptions:
    """Options of a run for its cell.

    Attributes:
        operator: The operator beside the cell.
        base: Folder to which paths in the cell file are relative.
        gui: True to show the simulated world in a window.
        resume: State in which the interrupted run left the cell; None for a new run.
        scene: File that changes the world of a simulated cell, and that only this cell reads; None: the world
            is as the cell file declares.
    """

    operator: Operator
    base: Path
    gui: bool = False
    resume: ResumePoint | None = None
    scene: Path | None = None


KeyPath = tuple[str | int, ...]
"""Keys that lead to a value in a cell file, outermost first."""


class CellKind(Protocol):
    """A class of work cells; its name is an entry point of the group `executive.cells`."""

    def __call__(
        self, config: Any, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> Workcell:
        """Return a cell for a cell file (`executive.cell.config.CellConfig`)."""

    def check(self, config: Any, base: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return the mistakes in a cell file of the right form, each as its key and a sentence.

        `base` is the folder to which paths in the file are relative.
        """

    def labels(self, config: Any, base: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the classes that each detector of a cell file knows, with the labels of the cell.

        None for a detector whose classes are unknown before its first answer. Never raises: `check` reports
        errors.
        """

    def min_times(self, config: Any) -> MinTimes:
        """Return the minimum times of actions in a cell for which `check` returns no finding."""
