"""Mission of a campaign or benchmark, and the cell in which it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from executive.cell.workcell import Workcell
from executive.errors import InputError
from executive.mission.load import LoadedMission, load_mission
from executive.plugins import load_cell_kind, load_skills


@dataclass(frozen=True)
class MissionUnderTest:
    """A mission with the cell and the seed of its test runs.

    Attributes:
        loaded: The mission, checked together with its cell file.
        make_cell: Function that makes the work cell.
        cell_description: Kind of the cell, and source of the detections, for reports.
        seed: Random seed; in a series of runs, the seed of the first run.
    """

    loaded: LoadedMission
    make_cell: Callable[..., Workcell]
    cell_description: str
    seed: int

    @property
    def name(self) -> str:
        """Name of the mission."""
        return self.loaded.mission.name

    @property
    def requests(self) -> list[str]:
        """Requests of the operator: for each class of the mission, as many as objects can be on the table."""
        return [*self.loaded.routes] * self.loaded.cell_config.table.objects[1]


def load_mission_under_test(
    mission: str, overrides: Mapping[str, str], has_oracle: bool, seed: int
) -> MissionUnderTest:
    """Load a mission; if `has_oracle` is True, the detectors of its simulated cell return true detections.

    Raises:
        InputError: The mission does not exist or has errors, or `has_oracle` requires a simulated cell.
    """
    loaded = load_mission(mission, load_skills(), overrides, load_cell_kind)
    kind = loaded.cell_config.kind
    if not has_oracle:
        return MissionUnderTest(loaded, load_cell_kind(kind), kind, seed)
    if kind != "sim":
        name = loaded.mission.name
        raise InputError(f"--oracle requires a simulated cell, but the cell of {name} is of kind {kind}")
    from executive.testing.oracle import make_oracle_kind

    return MissionUnderTest(loaded, make_oracle_kind(), "sim, true detections", seed)
