"""A whole work cell without physics: the real ledger and localizer around fake parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from executive.cell import Cell, Operator
from executive.cell_config import CellConfig, LedgerConfig
from executive.events import Emit, ignore
from executive.ledger.ledger import ItemLedger
from executive.messages import Bin, ObjectClass, Target
from executive.testing.fake_parts import FakeArm, FakeCamera, FakeClock, FakeDetector, FakeTool
from executive.testing.fake_world import FakeWorld
from executive.vision.localize import PlaneLocalizer
from executive.workcell import CellOptions

CLASSES = {
    "cube": ObjectClass("cube", 0.05, 0.035),
    "sphere": ObjectClass("sphere", 0.06, 0.03),
    "duck": ObjectClass("duck", 0.05, 0.04),
}
ROUTES = {"cube": "red_bin", "sphere": "blue_bin", "duck": "yellow_bin"}
PLACES = {"red_bin": (0.20, -0.44), "blue_bin": (0.20, 0.44), "yellow_bin": (0.52, 0.46)}


class SilentOperator:
    """Asks for what a list says, then quits."""

    def __init__(self, requests: Sequence[str] = ()) -> None:
        self._requests = list(requests)

    def ask(self, choices: Sequence[str]) -> str | None:
        """Return the next request, or None."""
        del choices
        return self._requests.pop(0) if self._requests else None


class FakeCell:
    """A fake work cell; implements `executive.workcell.Workcell`.

    Attributes:
        world, arm, tool, camera, detector, ledger: The fake parts, for a test to arrange and inspect.
    """

    def __init__(
        self,
        *,
        routes: Mapping[str, str] = ROUTES,
        emit: Emit = ignore,
        operator: Operator | None = None,
        detectors: Sequence[str] = ("embedded",),
    ) -> None:
        self._emit = emit
        self._routes = dict(routes)
        self.world = FakeWorld(dict(CLASSES))
        clock = FakeClock(self.world)
        self.arm = FakeArm(
            self.world, {"home": np.array([0.3, -0.3, 0.3]), "scan": np.array([0.5, 0.0, 0.4])}
        )
        self.tool = FakeTool(self.world, lambda: self.arm.tool_pose.position)
        bins = {name: _bin(name, *place) for name, place in PLACES.items()}
        self.ledger = ItemLedger(LedgerConfig(), bins, self._routes, emit)
        self.camera = FakeCamera(self.world, lambda: self.ledger.epoch)
        self.detectors = {name: FakeDetector(self.world, clock) for name in detectors}
        self.detector = next(iter(self.detectors.values()))
        self.decisions: list[Target] = []
        self._cell = Cell(
            clock=clock,
            arm=self.arm,
            tool=self.tool,
            camera=self.camera,
            detectors=self.detectors,
            ledger=self.ledger,
            operator=operator or SilentOperator(),
            bins=bins,
            classes=CLASSES,
            routes=self._routes,
            localizer=PlaneLocalizer(CLASSES),
            safe_place=np.array([0.45, -0.30, 0.0]),
            travel_height=0.16,
            descent=0.02,
            descent_speed=0.1,
            decided=self._decided,
        )

    @classmethod
    def from_config(
        cls, config: CellConfig, *, seed: int, routes: Mapping[str, str], emit: Emit, options: CellOptions
    ) -> FakeCell:
        """Return a fake cell with a seeded handful of objects, whatever the cell file says of the world."""
        made = cls(routes=routes, emit=emit, operator=options.operator, detectors=tuple(config.detectors))
        random = np.random.default_rng(seed)
        places = [(x, y) for x in (0.45, 0.55) for y in (-0.15, 0.0, 0.15)]
        random.shuffle(places)
        for x, y in places[: int(random.integers(3, 6))]:
            made.world.put(str(random.choice(sorted(CLASSES))), x, y)
        return made

    @property
    def cell(self) -> Cell:
        """What skills see."""
        return self._cell

    @property
    def accounts(self) -> ItemLedger:
        """The books of the cell's ledger."""
        return self.ledger

    def advance(self) -> None:
        """Let one control step pass."""
        self.arm.advance()
        self.world.steps += 1

    def audit(self) -> dict[str, int]:
        """Return what became of the objects."""
        counts = {"right": 0, "wrong_bin": 0, "left": 0, "elsewhere": 0, "unseen": 0}
        for thing in self.world.objects:
            inside = next((n for n, bin in self._cell.bins.items() if bin.contains(thing.position)), None)
            if inside is None:
                counts["left"] += 1
            else:
                counts["right" if inside == self._routes.get(thing.label) else "wrong_bin"] += 1
        return counts

    def close(self) -> None:
        """Have nothing to give back."""

    def _decided(self, target: Target, bin: str) -> None:
        self.decisions.append(target)
        data: dict[str, Any] = {"item": target.item, "label": target.label, "frame": target.frame, "bin": bin}
        self._emit("decision", **data)


def _bin(name: str, x: float, y: float) -> Bin:
    slots = np.array([[x + dx, y + dy] for dx in (-0.05, 0.05) for dy in (-0.07, 0.0, 0.07)])
    return Bin(name, np.array([x, y, 0.0]), np.array([0.22, 0.24, 0.06]), slots)
