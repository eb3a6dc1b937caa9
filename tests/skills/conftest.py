from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from executive.messages import Target
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.detect import Detect
from skills.localize import Localize


@pytest.fixture(autouse=True)
def no_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing here can import the simulator, though tests of other folders may have done so before."""
    for name in [*sys.modules]:
        if name.startswith("executive.sim."):
            monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, "pybullet", None)


@pytest.fixture
def look(fake: FakeCell) -> Callable[..., list[Target]]:
    """Looks at the fake table and returns what was localized."""

    def looking(view: str = "table") -> list[Target]:
        detections = run_skill(Detect(view=view), fake).outputs["detections"]
        return run_skill(Localize(detections=detections), fake).outputs["targets"]

    return looking
