"""A mission that a campaign runs again and again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from executive.cell.workcell import Workcell
from executive.mission.load import LoadedMission
from executive.skill import Skill


@dataclass(frozen=True)
class Subject:
    """A mission, and the cell it is run in.

    Attributes:
        loaded: The mission and its cell file.
        skills: Installed skills by name.
        kind: Makes the work cell; None: the kind that the cell file names.
        cell: What that is, in words.
        seed: Decides everything random; where there are many runs, that of the first.
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
        """What an operator asks for: every class in turn, as often as there may be objects."""
        return [*self.loaded.routes] * self.loaded.cell_config.table.objects[1]
