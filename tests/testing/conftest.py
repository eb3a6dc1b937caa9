"""A target for tests of the kit."""

from __future__ import annotations

import pytest
from at_hand import look

from executive.cell.objects import Target
from executive.cells.fake.cell import FakeCell


@pytest.fixture
def target(fake: FakeCell) -> Target:
    """A cube in the middle of the fake table, seen once."""
    fake.world.put("cube", 0.5, 0.0)
    return look(fake)[0]
