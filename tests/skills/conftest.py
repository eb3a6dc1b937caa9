from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial

import at_hand
import pytest

from executive.cell.objects import Target
from executive.testing.fake_cell import FakeCell


@pytest.fixture(autouse=True)
def no_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing here can import the simulator, though tests of other folders may have done so before."""
    for name in [*sys.modules]:
        if name.startswith("executive.drivers.sim."):
            monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, "pybullet", None)


@pytest.fixture
def look(fake: FakeCell) -> Callable[..., list[Target]]:
    """Looks at the fake table and returns what was localized."""
    return partial(at_hand.look, fake)


@pytest.fixture
def held(fake: FakeCell, target: Target) -> str:
    """The cube, in the tool."""
    return at_hand.pick(fake, target)
