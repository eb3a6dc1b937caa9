"""Clocks of devices, and the kinds of drivers that are registered."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cell.devices import StepClock, WallClock, load_driver_kind
from executive.errors import InputError


def test_a_step_clock_advances_only_with_ticks_and_the_devices_with_it() -> None:
    clock = StepClock(0.25)
    times: list[float] = []
    clock.on_tick = lambda: times.append(clock.now)
    assert clock.now == 0.0
    for _ in clock.sleep(0.6):
        clock.wait_for_tick()
    assert times == [0.25, 0.5], "0.6 s are 2 steps and less than half of one"


class HandSetTime:
    """A wall clock that shows the time [s] that a test and the sleeps set."""

    now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


def test_a_wall_clock_ticks_at_multiples_of_its_step_and_counts_late_ticks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wall = HandSetTime()
    monkeypatch.setattr("executive.cell.devices.time", wall)
    clock = WallClock(0.5)
    ticks: list[tuple[float, int]] = []
    clock.on_tick = lambda: ticks.append((clock.now, clock.late_tick_count))
    for work in (0.25, 0.75, 1.5, 0.0, 1.0, 0.125):
        wall.now += work
        clock.wait_for_tick()
    # The third tick was due at 1.5 s, and the fifth at 3.5 s.
    assert ticks == [(0.5, 0), (1.25, 0), (2.75, 1), (3.0, 1), (4.0, 2), (4.5, 2)]
    assert clock.tick_count == len(ticks)


@pytest.mark.parametrize(
    ("group", "message"),
    [
        ("executive.cells", r'registers "bench" in the group executive\.cells, .* in executive\.drivers'),
        ("executive.skills", 'offers cells of kind "bench"; installed: fake, sim'),
    ],
)
def test_a_kind_of_cell_of_the_former_group_is_refused_with_the_present_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, group: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    entries = f'[project.entry-points."{group}"]\nbench = "bench:Cell"\n'
    Path("pyproject.toml").write_text(f'[project]\nname = "lab"\n{entries}')
    with pytest.raises(InputError, match=message):
        load_driver_kind("bench")
