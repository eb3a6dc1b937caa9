"""What a station builds from its driver, and what it closes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from executive.drivers.fake import FakeDriver
from executive.errors import InputError
from executive.events import discard_event
from executive.station.station import CellOptions, SilentOperator, Station
from executive.testing.fake_cell import load_empty_cell


class ClosedDriver(FakeDriver):
    """A driver that remembers that it was closed."""

    is_closed = False

    def close(self) -> None:
        type(self).is_closed = True


class OtherRole(ClosedDriver):
    """A driver with two arms, of which none has the default role."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.arms = {"left": self.arm, "right": self.arm}


def refuse(*_: Any) -> Any:
    raise InputError("no weights")


@pytest.mark.parametrize(
    ("kind", "make_detector", "problem"),
    [
        (ClosedDriver, refuse, "no weights"),
        (OtherRole, None, 'no arm with the name "main"; it has: left, right'),
    ],
)
def test_a_driver_is_closed_if_its_station_cannot_be_built(
    kind: Any, make_detector: Any, problem: str
) -> None:
    options = CellOptions(SilentOperator(), Path())
    kind.is_closed = False
    with pytest.raises(InputError, match=problem):
        Station(
            load_empty_cell(), kind, seed=0, routes={}, emit=discard_event, options=options,
            make_detector=make_detector,
        )  # fmt: skip
    assert kind.is_closed
