"""Throw-away skills and a way to load a mission from text."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest

import executive.cells.sim.cell
from executive.cell.config import CellConfig
from executive.mission.load import LoadedMission, load_mission
from executive.mission.parse import cell_file
from executive.skill import In, Metres, Out, Skill, param, port


class Look(Skill):
    """See something."""

    view: str = param("table", choices=("table", "full"))
    detector: str = param("", refers_to="detector")
    pose: str = param("auto", refers_to="pose", choices=("auto", "next"))
    classes: tuple[str, ...] = param((), refers_to="class")
    seen: Out[list[int]]
    reasons: ClassVar = ("unsure", "hidden")
    senses: ClassVar = True

    def run(self, cell: Any) -> Any:
        yield
        self.seen = [1]


class Pick(Skill):
    """Take something."""

    seen: In[list[int]]
    only: In[str | None] = port(default=None)
    height: Metres = param(0.1, ge=0, le=0.5)
    tries: int = param(1, ge=1)
    held: Out[str]
    reasons: ClassVar = ("missed",)

    def run(self, cell: Any) -> Any:
        yield
        self.held = "thing"


class Drop(Skill):
    """Put something into a bin."""

    held: In[str]
    bin: str = param(refers_to="bin", doc="where it goes")
    reasons: ClassVar = ("stuck",)

    def run(self, cell: Any) -> Any:
        yield


SKILLS: dict[str, type[Skill]] = {"Look": Look, "Pick": Pick, "Drop": Drop}

SMALL_CELL = Path(__file__).with_name("small_cell.yaml").read_text()


@pytest.fixture(scope="module")
def shared_cells() -> Iterator[None]:
    """Read each cell file once, and look once at the poses of each cell, for all missions of a module."""
    unfit_poses, found = executive.cells.sim.cell.find_pose_errors, {}

    def look_once(config: CellConfig) -> Any:
        key = config.model_dump_json()
        if key not in found:
            found[key] = list(unfit_poses(config))
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cell_file, "read_source", functools.cache(cell_file.read_source))
        patch.setattr(cell_file, "parse_yaml", functools.cache(cell_file.parse_yaml))
        patch.setattr(executive.cells.sim.cell, "find_pose_errors", look_once)
        yield


@pytest.fixture
def skills() -> dict[str, type[Skill]]:
    return dict(SKILLS)


@pytest.fixture
def small_cell() -> str:
    return SMALL_CELL


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., LoadedMission]:
    """Write the text as `m.yaml` beside `cells/small.yaml`, go there and load it."""
    monkeypatch.chdir(tmp_path)
    Path("cells").mkdir()
    Path("cells/small.yaml").write_text(SMALL_CELL)

    def load(text: str, overrides: dict[str, str] | None = None, **more: Any) -> LoadedMission:
        Path("m.yaml").write_text(text)
        return load_mission("m.yaml", SKILLS, overrides, **more)

    return load
