"""What a run requires of a work cell: protocols, shapes, ground truth, ledger, factory; wrapper of a cell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from executive.cell.config import ObjectConfig
from executive.cell.objects import Quotas
from executive.cell.protocols import Cell, Ledger, Operator, Routes
from executive.errors import InputError
from executive.events import Emit, ItemChanged
from executive.geometry import Array, Pose
from executive.plugins import list_entries
from executive.text.validate import KeyPath


@dataclass(frozen=True)
class Shape:
    """A solid shape that is rigidly attached to a body.

    Attributes:
        body: Name of the body; "" for a shape that never moves.
        kind: Kind of shape: `box`, `cylinder`, `sphere` or `mesh`.
        size: Size along x, y and z [m]; for a mesh, scale factors along x, y and z.
        X_BS: Pose of the shape in the frame of the body.
        colour: Red, green and blue of the surface, 0 to 1.
        file: Path of the file of a mesh, with the suffix of its format; "" for other kinds.
    """

    body: str
    kind: str
    size: tuple[float, float, float]
    X_BS: Pose
    colour: tuple[float, float, float]
    file: str = ""


class Visuals(Protocol):
    """Shapes of a cell and their poses, for displays."""

    @property
    def shapes(self) -> Sequence[Shape]:
        """All shapes of the cell."""

    def poses(self) -> Mapping[str, Pose]:
        """Return the current pose `X_WB` of each body by name, without removed bodies."""


AUDIT_KEYS = ("right", "wrong_bin", "left", "elsewhere", "fell_in_wrong_bin", "unseen")
"""Keys of the object counts of an audit: objects in permitted bins (`right`), in other bins, on the table
(`left`), elsewhere; and, counted a second time, objects that fell into a wrong bin or were never detected."""


@dataclass(eq=False)
class TrueObject:
    """Ground truth about an object of a simulated, fake or rendered scene.

    Attributes:
        label: Class of the object, or `UNKNOWN_LABEL`.
        X_WO: Pose of the object in the world; its position is the centre of the object.
        body: Number of the object in its world.
        rest_positions: Positions of the object `(3,)` [m] at the start, and after each move and each fall.
        is_dropped: True if the object fell from the tool and has not been picked up since.
        bin: At the end of a run, name of the bin that contains the object; "" outside of all bins, None below
            the table.
        is_held: At the end of a run, True if the tool holds the object.
        is_removed: True if the object was removed from the world; `bin` is then the bin before the removal.
        model: Model of the object, already scaled, in a scene that is rendered.
        colour: Red, green and blue of the object, each 0 to 1; black if unknown.
    """

    label: str
    X_WO: Pose
    body: int = 0
    rest_positions: list[Array] = field(default_factory=list)
    is_dropped: bool = False
    bin: str | None = ""
    is_held: bool = False
    is_removed: bool = False
    model: ObjectConfig | None = None
    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def position(self) -> Array:
        """Centre of the object `(3,)` [m]."""
        return self.X_WO.position


class Accounts(Ledger, Protocol):
    """Ledger with what a run needs at its end and at its resumption."""

    def set_final_states(self, *, completed: bool) -> None:
        """Set the final state of each item; `completed` is True if the tree succeeded."""

    def discard_rejected_and_skipped(self) -> None:
        """Discard all rejected and skipped items; the next frame adds a new item for each visible object."""

    def count_states(self) -> dict[str, int]:
        """Return the number of items by final state; the key `seen` is the total without phantoms."""

    @property
    def assumption_reasons(self) -> Sequence[str]:
        """Reasons why error rates of detectors were assumed instead of measured."""

    def list_items(self) -> Sequence[ItemChanged]:
        """Return the current state of each item, in the order of the first detection."""


class Workcell(Protocol):
    """A cell with its world, as a run uses it."""

    @property
    def cell(self) -> Cell:
        """Interface of the work cell for skills."""

    @property
    def accounts(self) -> Accounts:
        """The ledger; at the end of the run, the run calls its `set_final_states`."""

    @property
    def steps(self) -> int:
        """Number of control steps since the start of the run, including those before a resumption."""

    @property
    def last_command_step(self) -> int:
        """Control step of the last start of a motion or command to the tool; 0 if none or unknown."""

    def log_to(self, path: Path) -> None:
        """Start a log file from which the simulated world can be reconstructed at any control step.

        The run calls this method before the first control step; a hardware cell writes no log.

        Raises:
            InputError: The file cannot be written.
        """

    def advance(self) -> None:
        """Execute one control step."""

    def visuals(self) -> Visuals | None:
        """Return the shapes and poses of the bodies for displays, or None if the cell has no visuals."""

    def audit(self) -> Mapping[str, int] | None:
        """Return the number of objects by true place, by `AUDIT_KEYS`; None without ground truth."""

    def close(self) -> None:
        """Release all resources; the cell is unusable afterwards."""


@dataclass(frozen=True)
class ResumePoint:
    """State of a cell at the interruption of a run.

    Attributes:
        log_path: Log file that `log_to` started, from which the simulated world is reconstructed.
        frame_count: Number of frames captured before the interruption.
        pose_count: Number of calls of `Camera.next_pose` before the interruption.
    """

    log_path: Path
    frame_count: int = 0
    pose_count: int = 0


@dataclass(frozen=True)
class CellOptions:
    """Options of a run for its cell.

    Attributes:
        operator: The person or script that requests classes of objects.
        cell_folder: Folder of the cell file, to which paths in the file are relative.
        resume: State of the cell at the interruption of a resumed run; None for a new run.
        quotas: Maximum numbers of objects in the bins, from the mission.
        driver_options: Options of the driver by name; only the driver knows them.
    """

    operator: Operator
    cell_folder: Path
    resume: ResumePoint | None = None
    quotas: Quotas = field(default_factory=dict)
    driver_options: Mapping[str, str] = field(default_factory=dict)


class CellKind(Protocol):
    """Factory of work cells. Each entry point of the group `executive.cells` is such a factory.

    A kind may have a method `compute_mass(section)`, which returns the mass [kg] of the objects of a class,
    declared or not, or raises an `InputError`; `section` is an `executive.cell.config.ObjectConfig`.
    A kind may have an attribute `driver_options`, which contains `file` or `flag` by the name of each option
    of a run that it knows; the run directory gets a copy of a file.
    """

    def __call__(
        self, config: Any, *, seed: int, routes: Routes, emit: Emit, options: CellOptions
    ) -> Workcell:
        """Return a cell for a cell file (`executive.cell.config.CellConfig`)."""

    def check(self, config: Any, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Yield key and message of each error that the validation of the cell file does not find.

        `cell_folder` is the folder of the cell file, to which paths in the file are relative.
        """

    def labels(self, config: Any, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the labels that each detector of a cell file can report, by name of the detector.

        The labels of a detector are None if they are unknown before its first answer. Errors in the file are
        ignored, because `check` reports errors.
        """


class CellWrapper:
    """Work cell that forwards each call to another work cell; a subclass overrides `advance` or `steps`.

    Attributes:
        inner: The wrapped work cell.
        cell: Interface of the work cell for skills.
        accounts: The ledger; at the end of the run, the run calls its `set_final_states`.
    """

    def __init__(self, inner: Workcell) -> None:
        self.inner = inner
        self.cell = inner.cell
        self.accounts = inner.accounts
        self.log_to = inner.log_to
        self.visuals = inner.visuals
        self.audit = inner.audit
        self.close = inner.close

    @property
    def steps(self) -> int:
        """Number of control steps since the start of the run."""
        return self.inner.steps

    @property
    def last_command_step(self) -> int:
        """Control step of the last command to the arm or the tool."""
        return self.inner.last_command_step

    def advance(self) -> None:
        """Execute one control step."""
        self.inner.advance()


def find_innermost_cell(workcell: Workcell) -> Workcell:
    """Return the work cell inside all wrappers."""
    while isinstance(workcell, CellWrapper):
        workcell = workcell.inner
    return workcell


CELL_KIND_GROUP = "executive.cells"
"""Entry-point group of kinds of cells."""


def load_cell_kind(name: str) -> CellKind:
    """Return the class that builds the cells of the kind `name`.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    entries = list_entries(CELL_KIND_GROUP, "kind of cell")
    if name not in entries:
        installed = ", ".join(sorted(entries)) or "none"
        raise InputError(f'no installed package offers cells of kind "{name}"; installed: {installed}')
    cell_kind: CellKind = entries[name].load()
    return cell_kind


def find_driver_options(kind: str) -> Mapping[str, str]:
    """Return `file` or `flag` by the name of each option that the driver of a kind of cell knows.

    Raises:
        InputError: No package registers this kind, or its class cannot be loaded.
    """
    known_options: Mapping[str, str] = getattr(load_cell_kind(kind), "driver_options", {})
    return known_options


def check_driver_options(kind: str, options: Iterable[str]) -> None:
    """Raise an InputError if the driver of a kind of cell does not know an option."""
    for name in options:
        known_options = find_driver_options(kind)
        if name not in known_options:
            choices = ", ".join(known_options) or "none"
            advice = f"omit --{name}, or use a cell with another driver"
            raise InputError(
                f'the driver "{kind}" does not know the option "{name}"; it knows: {choices}; {advice}'
            )
