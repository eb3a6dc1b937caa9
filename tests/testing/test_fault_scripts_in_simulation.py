"""What is done to a simulated cell is done by its physics, and ledger and audit agree in the end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from executive.events import FaultInjected, NodeEnded, TimedEvent
from executive.testing import faults as effects
from executive.testing.faults import after, during
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import run_mission
from executive.testing.world_access import WorldAccess

pytestmark = pytest.mark.slow
MOVE = (0.0, -0.06)


@pytest.mark.parametrize(
    ("fault", "reasons", "lost", "displacement"),
    [
        (during("*/Transit", effects.seal_breaks(), activations=3), ["dropped"], 0, None),
        (during("*/Transit", effects.object_removed(), activations=2), ["dropped"], 1, None),
        (during("*/Approach", effects.object_moved(MOVE), activations=2), ["no_contact"], 0, MOVE),
        (during("*/Approach", effects.arm_collides("a hand"), activations=2), ["blocked"], 0, None),
        (after(0.0, effects.object_removed(1)), [], 0, None),
    ],
)  # fmt: skip
def test_a_fault_changes_the_world_and_the_ledger_agrees(
    fault: Any, reasons: list[str], lost: int, displacement: tuple[float, float] | None
) -> None:
    cells: list[Any] = []
    states: dict[str, Any] = {}

    def watch(timed: TimedEvent) -> None:
        name = type(timed.event).__name__
        if isinstance(timed.event, NodeEnded) and timed.event.reason in reasons:
            name = "failed"
        states.setdefault(name, {one.body: one.position for one in WorldAccess(cells[0]).objects})

    result = run_mission(
        "sort_overhead", make_oracle_kind(), faults=[fault], arrange=cells.append, observers=[watch]
    )
    patterns = ("*/Transit", "*/Approach")
    assert [reason for pattern in patterns for reason in result.list_failure_reasons(pattern)] == reasons
    assert (result.items["lost"], result.agrees) == (lost, True)
    assert result.status == ("FAILURE" if lost else "SUCCESS")
    (injected,) = [one.event for one in result.events if isinstance(one.event, FaultInjected)]
    if displacement is not None:
        (body,) = (one for one, place in states["FaultInjected"].items()
                   if np.allclose(place, injected.position, atol=1e-3))  # fmt: skip
        moved = states["failed"][body] - states["FaultInjected"][body]
        assert np.allclose(moved[:2], displacement, atol=0.005)
