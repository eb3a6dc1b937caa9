"""One short mission, and the devices that runs were made on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from executive.drivers.fake import FakeDriver

MISSION = """\
mission: bring_one
description: Bring one object.
cell: cells/overhead.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree: [MoveToScan, Detect, Localize, SelectTarget, Approach, Grasp, Transit, Release]
"""


@pytest.fixture
def bring_one(tmp_path: Path) -> str:
    """The file of a mission that brings one object."""
    file = tmp_path / "bring_one.yaml"
    file.write_text(MISSION)
    return str(file)


@pytest.fixture
def drivers(monkeypatch: pytest.MonkeyPatch) -> list[FakeDriver]:
    """The devices that runs were made on."""
    made: list[FakeDriver] = []

    class Driver(FakeDriver):
        def __init__(self, *args, **options) -> None:
            super().__init__(*args, **options)
            made.append(self)

    monkeypatch.setattr("executive.station.station.load_driver_kind", lambda name: Driver)
    return made


@pytest.fixture
def full_disk() -> Callable[..., NoReturn]:
    """A function in place of one of `os` on a full disk."""

    def fail(*args: object) -> NoReturn:
        raise OSError(28, "No space left on device")

    return fail
