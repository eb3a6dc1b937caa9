"""What is done to a simulated cell is done by its physics, and ledger and audit agree in the end."""

from __future__ import annotations

from typing import Any

import pytest

from executive.testing import faults as effects
from executive.testing.faults import after, during
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import run_mission

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("fault", "reasons", "lost"),
    [
        (during("*/Transit", effects.grip_lost(), activations=3), ["dropped"], 0),
        (during("*/Transit", effects.object_removed(), activations=2), ["dropped"], 1),
        (during("*/Approach", effects.object_moved((0.0, -0.06)), activations=2), ["no_contact"], 0),
        (during("*/Approach", effects.arm_collides("a hand"), activations=2), ["blocked"], 0),
        (after(0.0, effects.object_removed(1)), [], 0),
    ],
)
def test_a_fault_changes_the_world_and_the_ledger_agrees(fault: Any, reasons: list[str], lost: int) -> None:
    result = run_mission("sort_overhead", make_oracle_kind(), faults=[fault])
    patterns = ("*/Transit", "*/Approach")
    assert [reason for pattern in patterns for reason in result.list_failure_reasons(pattern)] == reasons
    assert (result.items["lost"], result.agrees) == (lost, True)
    assert result.status == ("FAILURE" if lost else "SUCCESS")
    assert len(result.list_injected_faults()) == 1
