"""The scene is built when somebody looks, with everything that there is to be seen."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import ClassVar

import pytest

from executive.geometry import Pose
from executive.scenery import Shape
from executive.view.live import scene
from executive.view.live.stage import Stage

BOX = Shape("", "box", (0.1, 0.1, 0.1), Pose.identity(), (1.0, 0.0, 0.0))
PLACE = (0.5, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0)


class Built:
    """Stands for a scene, and notes what it is told."""

    made: ClassVar[list[Built]] = []

    def __init__(self, path: Path) -> None:
        self.path, self.told = path, []
        self.made.append(self)

    def show(self, shapes) -> None:
        self.told.append(("show", shapes))

    def move(self, bodies) -> None:
        self.told.append(("move", bodies))


@pytest.fixture(autouse=True)
def built(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Built, "made", [])
    monkeypatch.setattr(scene, "Scene", Built)
    return Built.made


def test_who_comes_before_anything_is_known_waits_and_is_shown_all_of_it(built) -> None:
    async def work() -> None:
        stage = Stage(Path("socket"))
        early = asyncio.create_task(stage.ready())
        await asyncio.sleep(0.05)
        assert not early.done() and not built
        stage.show((BOX,))
        stage.move({"tool": PLACE})
        assert await early == Path("socket")
        assert await stage.ready() == Path("socket")
        stage.move({})

    asyncio.run(work())
    (only,) = built
    assert only.told == [("show", (BOX,)), ("move", {"tool": PLACE}), ("move", {})]


def test_while_nobody_looks_nothing_is_built(built) -> None:
    async def work() -> None:
        stage = Stage(Path("socket"))
        stage.show((BOX,))
        stage.move({"tool": PLACE})

    asyncio.run(work())
    assert built == []
