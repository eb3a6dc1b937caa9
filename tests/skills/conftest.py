from __future__ import annotations

from collections.abc import Callable

import pytest

from executive.messages import Target
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import run_skill
from skills.detect import Detect
from skills.localize import Localize


@pytest.fixture
def look(fake: FakeCell) -> Callable[..., list[Target]]:
    """Looks at the fake table and returns what was localized."""

    def looking(view: str = "table") -> list[Target]:
        detections = run_skill(Detect(view=view), fake).outputs["detections"]
        return run_skill(Localize(detections=detections), fake).outputs["targets"]

    return looking
