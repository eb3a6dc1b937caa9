"""What is done to a simulated cell is done by its physics, and ledger and audit agree in the end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from executive.cells.sim.cell import SimCell
from executive.events import FaultInjected, NodeEnded, TimedEvent
from executive.geometry import Array
from executive.testing import faults as effects
from executive.testing.faults import ScheduledFault, after, during
from executive.testing.world_access import open_world
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import MissionResult, run_mission


class Watched:
    """A mission in the simulator, looked at while it runs: its world is gone when it is over."""

    def __init__(self) -> None:
        self.seen: dict[str, object] = {}
        self._cell: SimCell | None = None

    def run(self, fault: ScheduledFault, look: Callable[[SimCell], object]) -> MissionResult:
        """Run sort_overhead; keep what the first `look` at each kind of event, state or reason returns."""

        def watch(timed: TimedEvent) -> None:
            assert self._cell is not None
            event = timed.event
            for name in (type(event).__name__, getattr(event, "reason", ""), getattr(event, "state", "")):
                if name and name not in self.seen:
                    self.seen[name] = look(self._cell)

        def keep(cell: SimCell) -> None:
            self._cell = cell

        return run_mission(
            "sort_overhead", make_oracle_kind(), faults=[fault], arrange=keep, observers=[watch]
        )


@pytest.fixture
def watched() -> Watched:
    return Watched()


def places(cell: SimCell) -> dict[int, Array]:
    """Return where every object is, by body `(3,)` [m]."""
    return {thing.body: thing.position for thing in open_world(cell).objects}


def holding(cell: SimCell) -> bool:
    return cell.cell.tool.holding


@pytest.mark.slow
def test_when_a_seal_breaks_in_mid_carry_the_object_falls_and_is_picked_up_again(watched: Watched) -> None:
    result = watched.run(during("*/Transit", effects.seal_breaks(), activations=3), places)
    (fault,) = result.list_injected_faults()
    hung = watched.seen["FaultInjected"]
    fallen = watched.seen["SelectTarget.unseen"]
    assert isinstance(hung, dict) and isinstance(fallen, dict)
    (body,) = (body for body, place in hung.items() if np.allclose(place, fault.position, atol=1e-3))
    assert hung[body][2] > 0.1
    assert fallen[body][2] < 0.05
    assert (result.status, result.list_failure_reasons("*/Transit")) == ("SUCCESS", ["dropped"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["seal_breaks", "arm_collides", "no_path"])
def test_what_falls_or_is_put_down_is_not_taken_for_something_else(name: str) -> None:
    script = [during("*/Transit", getattr(effects, name)(), activations=2)]
    assert run_mission("sort_overhead", make_oracle_kind(), faults=script).agrees


@pytest.mark.slow
def test_what_is_taken_out_of_the_tool_is_parted_from_it_first(watched: Watched) -> None:
    result = watched.run(during("*/Transit", effects.object_removed(), activations=2), holding)
    assert (watched.seen["FaultInjected"], watched.seen["dropped"]) == (True, False)
    assert (result.reason, result.items["lost"], result.agrees) == ("lost", 1, True)


@pytest.mark.slow
def test_what_is_moved_is_found_where_it_is_now(watched: Watched) -> None:
    result = watched.run(during("*/Approach", effects.object_moved((0.0, -0.06)), activations=2), places)
    (fault,) = result.list_injected_faults()
    before, felt = watched.seen["FaultInjected"], watched.seen["no_contact"]
    assert isinstance(before, dict) and isinstance(felt, dict)
    (body,) = (body for body, place in before.items() if np.allclose(place, fault.position, atol=1e-3))
    assert np.allclose(felt[body][:2] - before[body][:2], [0.0, -0.06], atol=0.005)
    assert (result.status, result.items["lost"], result.agrees) == ("SUCCESS", 0, True)


@pytest.mark.slow
def test_an_arm_that_runs_into_something_brakes(watched: Watched) -> None:
    hand = during("*/Approach", effects.arm_collides("a hand"), activations=2)
    result = watched.run(hand, lambda cell: cell.cell.arm.at_rest)
    assert (watched.seen["FaultInjected"], watched.seen["blocked"]) == (False, True)
    failed = next(one for one in result.events if getattr(one.event, "reason", "") == "blocked")
    assert isinstance(failed.event, NodeEnded)
    assert failed.event.message == "the arm ran into a hand"
    fault = next(one for one in result.events if isinstance(one.event, FaultInjected))
    assert 10 < failed.tick - fault.tick < 400, "it brakes, and moves back along its path"
    assert (result.status, result.items["rejected"], result.agrees) == ("SUCCESS", 0, True)


@pytest.mark.slow
def test_the_world_goes_on_without_what_was_removed_before_anybody_looked(watched: Watched) -> None:
    result = watched.run(after(0.0, effects.object_removed(1)), places)
    assert (result.status, result.agrees) == ("SUCCESS", True)
    assert result.items["seen"] == len(watched.seen["RunEnded"])  # type: ignore[arg-type]
