"""Which hand reaches into which kind of cell."""

from __future__ import annotations

from executive.errors import InputError
from executive.testing.disturbances.fake_hand import FakeHand
from executive.testing.disturbances.hand import Hand
from executive.testing.fake_cell import FakeCell
from executive.testing.wrapped_cell import innermost
from executive.workcell import Workcell


def hand_of(workcell: Workcell) -> Hand:
    """Return what reaches into a fake or a simulated cell.

    Raises:
        InputError: It is neither.
    """
    inner = innermost(workcell)
    if isinstance(inner, FakeCell):
        return FakeHand(inner)
    # These bring the simulator along, which a fake cell never needs.
    from executive.sim.cell import SimCell
    from executive.testing.disturbances.sim_hand import SimHand

    if isinstance(inner, SimCell):
        return SimHand(inner)
    raise InputError(
        f"nobody knows how to reach into a {type(inner).__name__}; give `disturbed` a `hand` that does"
    )
