"""What the runtime drives: a cell together with the world it acts in, and how one is made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from executive.cell.protocols import Cell, LeastTimes, Operator, Routes
from executive.cell.visuals import Scenery
from executive.events import Emit

PLACES = ("right", "wrong_bin", "left", "elsewhere", "fell_in_wrong_bin", "unseen")
"""Keys of the counts of an audit; the last two count objects that the others count, too."""


class Accounts(Protocol):
    """What the runtime asks of a ledger when a run is over."""

    def close(self, *, completed: bool) -> None:
        """Decide the final state of each item; `completed` is True if the tree succeeded."""

    def reopen(self) -> None:
        """Forget the items that were left on the table; the next look enters those that still lie there."""

    def balance(self) -> dict[str, int]:
        """Return the counts `seen, placed, rejected, skipped, lost, phantom`.

        `seen` is the sum of the next four.
        """

    @property
    def unknown(self) -> Mapping[str, int]:
        """Largest number of boxes in one look for each label that the cell does not know."""

    @property
    def doubts(self) -> Sequence[str]:
        """Reasons why error rates of detectors were assumed and not measured."""

    def rows(self) -> list[dict[str, object]]:
        """Return a plain row per item, in the order of first sight."""


class Workcell(Protocol):
    """What the runtime drives: a cell together with the world it acts in."""

    @property
    def cell(self) -> Cell:
        """What skills see."""

    @property
    def accounts(self) -> Accounts:
        """The books of the cell's ledger."""

    @property
    def steps(self) -> int:
        """Control steps that its world has made since the run began, those before a resumption included."""

    def log_to(self, path: Path) -> None:
        """Keep in a file, from now on, what a simulated world can be rebuilt from at any moment.

        Called before the first control step; a cell of hardware has nothing to keep.

        Raises:
            InputError: The file cannot be written.
        """

    def advance(self) -> None:
        """Let one control step pass."""

    def scenery(self) -> Scenery | None:
        """Return what there is to be seen, for people only; None where nothing tells."""

    def audit(self) -> Mapping[str, int] | None:
        """Return what really became of the objects, or None where nobody can know (real hardware)."""

    def close(self) -> None:
        """Give everything back; the cell cannot be used afterwards."""


@dataclass(frozen=True)
class CellPast:
    """What a run that is taken up again has had of its cell.

    A simulated world is rebuilt from the log that the run left, its arm braking, and the log goes on.

    Attributes:
        log: What `log_to` was given.
        steps: Control steps made, as far as the journal knows.
        frames: Images taken.
        turns: Times that the camera was asked for its next pose.
    """

    log: Path
    steps: int = 0
    frames: int = 0
    turns: int = 0


@dataclass(frozen=True)
class CellOptions:
    """How a run wants its cell.

    Attributes:
        operator: Who is asked for requests.
        base: Folder that paths in the cell file start from.
        gui: Show the world in a window.
        past: What a run that is taken up again has had of the cell; None: a run begins.
        scene: File that changes the world of a simulated cell, which alone reads it; None: the world is as
            the cell file declares it.
    """

    operator: Operator
    base: Path
    gui: bool = False
    past: CellPast | None = None
    scene: Path | None = None


KeyPath = tuple[str | int, ...]
"""Keys that lead to a value in a cell file, outermost first."""


class CellKind(Protocol):
    """A class that makes work cells; found by its name in the entry-point group `executive.cells`."""

    def __call__(
        self, config: Any, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> Workcell:
        """Return a cell made from a cell file (`executive.cell.config.CellConfig`)."""

    def check(self, config: Any, base: Path) -> Iterable[tuple[KeyPath, str]]:
        """Return what is wrong with a cell file beyond its form: the key it is about, and a sentence.

        `base` is the folder that paths in it start from.
        """

    def labels(self, config: Any, base: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the classes that each detector of a cell file knows, by the cell's names for them.

        None where nobody can know without asking it. Never raises: what is wrong is found by `check`.
        """

    def least_times(self, config: Any) -> LeastTimes:
        """Return what things take at the very least in a cell that `check` finds nothing wrong with."""
