"""The mission of a campaign and the cell in which it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from executive.cell.workcell import Workcell
from executive.errors import InputError
from executive.mission.load import LoadedMission, load_mission
from executive.plugins import cell_kind, discover
from executive.skill import Skill


@dataclass(frozen=True)
class Subject:
    """A mission, and the cell in which it runs.

    Attributes:
        loaded: The mission and its cell file.
        skills: Installed skills by name.
        kind: Function that makes the work cell; None: the kind in the cell file.
        cell: Description of the kind of cell.
        seed: Random seed; in a series of runs, the seed of the first run.
    """

    loaded: LoadedMission
    skills: Mapping[str, type[Skill]]
    kind: Callable[..., Workcell] | None
    cell: str
    seed: int

    @property
    def name(self) -> str:
        """The mission's name."""
        return self.loaded.mission.name

    @property
    def requests(self) -> list[str]:
        """Requests of the operator: each class in turn, as often as the maximum number of objects."""
        return [*self.loaded.routes] * self.loaded.cell_config.table.objects[1]


def load_subject(mission: str, overrides: Mapping[str, str], oracle: bool, seed: int) -> Subject:
    """Return a mission and its cell; with `oracle` a simulated cell with true detections.

    Raises:
        InputError: The mission is missing or wrong, or `oracle` is set and the cell is not simulated.
    """
    skills = discover()
    loaded = load_mission(mission, skills, overrides, cell_kind)
    kind = loaded.cell_config.kind
    if not oracle:
        return Subject(loaded, skills, None, kind, seed)
    if kind != "sim":
        raise InputError(
            f"--oracle is for simulated cells, but {loaded.mission.name} has a cell of kind {kind}; omit it"
        )
    from executive.testing.oracle import make_oracle_kind

    return Subject(loaded, skills, make_oracle_kind(), "sim, detections from the truth", seed)
