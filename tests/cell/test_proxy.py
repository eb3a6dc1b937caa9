"""The proxy between a skill and its cell."""

from __future__ import annotations

from typing import Any

from executive.cell.proxy import intercept

from executive.cell.arm import Task
from executive.station.border import Access
from executive.testing.fake_cell import FakeCell


def test_every_access_goes_through_the_interceptor_and_so_do_those_to_what_a_call_returns(
    fake: FakeCell,
) -> None:
    seen: list[tuple[str, str, tuple[Any, ...], bool]] = []

    def ask(access: Access) -> Any:
        seen.append((access.name, access.detector, access.arguments, access.is_call))
        return access.proceed()

    cell = intercept(fake.cell, ask, ("arm", "detector"))
    assert cell.arm.at_rest
    planning = cell.arm.plan("home", task=Task())
    assert not planning.ready
    frame = cell.camera.capture()
    assert not cell.detectors["embedded"].request(frame, view="full").ready
    assert seen == [
        ("arm.at_rest", "", (), False),
        ("arm.plan", "", ("home", Task()), True),
        ("plan.ready", "", (), False),
        ("detector.request", "embedded", (frame, "full"), True),
        ("request.ready", "embedded", (), False),
    ]
