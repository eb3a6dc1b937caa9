"""Throw-away skills and a way to load a mission from text."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest

import executive.mission.load
from executive.cell.config import CellConfig
from executive.mission import cell_file
from executive.mission.load import LoadedMission, load_mission
from executive.skill import In, Metres, Out, Skill, param, port
from executive.station.check import CellChecker
from executive.tree.node import load_control_nodes


class Look(Skill):
    """See something."""

    view: str = param("table", choices=("table", "full"), doc="a view")
    detector: str = param("", refers_to="detector", doc="a detector")
    pose: str = param("auto", refers_to="pose", choices=("auto", "next"), doc="a pose")
    classes: tuple[str, ...] = param((), refers_to="class", doc="classes")
    seen: Out[list[int]] = port(doc="a value")
    reasons: ClassVar = ("unsure", "hidden")
    senses: ClassVar = True

    def run(self, cell: Any) -> Any:
        yield
        self.seen = [1]


class Pick(Skill):
    """Take something."""

    seen: In[list[int]] = port(doc="a value")
    only: In[str | None] = port(default=None, doc="a value")
    height: Metres = param(0.1, ge=0, le=0.5, doc="a height")
    tries: int = param(1, ge=1, doc="a number")
    held: Out[str] = port(doc="a value")
    reasons: ClassVar = ("missed",)

    def run(self, cell: Any) -> Any:
        yield
        self.held = "thing"


class Drop(Skill):
    """Put something into a bin."""

    held: In[str] = port(doc="a value")
    bin: str = param(refers_to="bin", doc="where it goes")
    reasons: ClassVar = ("stuck",)

    def run(self, cell: Any) -> Any:
        yield


SKILLS: dict[str, type[Skill]] = {"Look": Look, "Pick": Pick, "Drop": Drop}

SMALL_CELL = Path(__file__).with_name("small_cell.yaml").read_text()


@pytest.fixture(scope="module")
def shared_cells() -> Iterator[None]:
    """Read each file once, check each cell once, and load the control nodes once, per module."""
    check = CellChecker.check
    found = {}

    def check_once(checker: CellChecker, config: CellConfig, cell_folder: Path) -> Any:
        key = checker, config.model_dump_json(), cell_folder
        if key not in found:
            found[key] = tuple(check(checker, config, cell_folder))
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cell_file, "read_source", functools.cache(cell_file.read_source))
        for module in (cell_file, executive.mission.load):
            patch.setattr(module, "parse_yaml", functools.cache(module.parse_yaml))
        patch.setattr(CellChecker, "check", check_once)
        patch.setattr(executive.mission.load, "load_control_nodes", functools.cache(load_control_nodes))
        yield


@pytest.fixture(scope="session")
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
