"""Runs on the fake cell that go wrong in one way or another, and the stories they leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from executive.behaviours import load_skills
from executive.events import RunEnded
from executive.mission.load import load_mission
from executive.record.diagnose import diagnose
from executive.record.result import Diagnosis
from executive.record.timeline import Timeline
from executive.run.assembly import RunOptions, assemble
from executive.testing.fake_cell import FakeCell

HEAD = """\
mission: trial
description: A test's.
cell: cells/overhead.yaml
params: {attempts: 3, patience: 2.0}
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree:
"""

PICK = """\
  - MoveToScan
  - Detect
  - Localize
  - SelectTarget
  - retry:
      attempts: $attempts
      on: [Grasp.missed, Transit.dropped]
      recover: [Detect, Localize, {SelectTarget: {same: $item}}]
      do: [Approach, Grasp, Transit, Release]
"""
"""Picks one object, and deals with nothing that may fail but by trying again."""


class FailedRun:
    """A run of a shipped mission or of a tree, written to a file here; its parts can be broken first.

    `objects` are label and place [m] of what lies on the table; by default it is what the seed says.
    """

    def __init__(
        self,
        mission: str,
        *,
        objects: Sequence[tuple[str, float, float]] = (),
        overrides: Mapping[str, str] | None = None,
        requests: Sequence[str] | None = (),
    ) -> None:
        file: str | Path = mission
        if "\n" in mission:
            file = Path("trial.yaml")
            file.write_text(HEAD + mission)
        self.loaded = load_mission(file, load_skills(), overrides or {})
        self.timeline = Timeline(has_history=False)
        options = RunOptions(3, requests, make_cell=FakeCell)
        self.run = assemble(self.loaded, options, [self.timeline])
        assert isinstance(self.run.station, FakeCell)
        self.fake = self.run.station
        if objects:
            self.fake.world.objects.clear()
            for label, x, y in objects:
                self.fake.world.put(label, x, y)

    def tell(self, is_at_rest: Callable[[], bool] | None = None) -> Any:
        """Execute the run and return its diagnosis, or None."""
        return self.diagnose(self.run.execute(), is_at_rest or (lambda: self.fake.arm.at_rest))

    def diagnose(self, end: RunEnded, is_at_rest: Callable[[], bool]) -> Diagnosis | None:
        """Return the diagnosis of the run, which has ended."""
        return diagnose(self.timeline, end, self.loaded, Path(), is_at_rest)

    def at_every_step(self, do: Callable[[], None]) -> None:
        """Have something done after every control step."""
        advance = self.fake.advance

        def advance_and_do() -> None:
            advance()
            do()

        self.fake.advance = advance_and_do  # type: ignore[method-assign]

    @property
    def height(self) -> float:
        """Height of the tool over the table [m]."""
        return float(self.fake.arm.tool_pose.position[2])

    def slip(self, times: int = 1000, *, vanish: bool = False) -> None:
        """Let whatever is lifted fall, so many times; it may vanish in the act."""
        slips = iter(range(times))

        def watch() -> None:
            held = self.fake.world.held_object
            if held is not None and self.height > 0.12 and next(slips, None) is not None:
                self.fake.tool.open()
                if vanish:
                    self.fake.world.objects.remove(held)

        self.at_every_step(watch)
