"""Skills that begin, end or are halted wrongly, each in its own way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

from conforming_skills import Pause, Push, Speed

from executive.cell import Cell, Steps
from executive.messages import Target
from executive.moving import follow, heeding, planned
from executive.skill import ANY, EMPTY, HOLDING, In, Skill, SkillFailed, port


class Scheming(Pause):
    """Wait."""

    plan: In[Mapping[str, Speed]] = port(doc="what is to come")
    words: In[str] = port(doc="what to say")


class Instant(Skill):
    """Do nothing."""

    def run(self, cell: Cell) -> Steps:
        """Do it at once."""
        return None  # type: ignore[return-value]


class Listing(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Hand back what is no iterator."""
        return [None, None]  # type: ignore[return-value]


class Endless(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Wait for what never comes."""
        while True:
            yield


class Faulty(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Trip if the tool holds something."""
        yield
        if cell.tool.holding:
            raise KeyError("bin")


class Undeclared(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Fail in one's own words if the tool holds something."""
        yield
        if cell.tool.holding:
            raise SkillFailed("bored", "nothing happens")


class Wordless(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Fail without a word if the tool holds something."""
        yield
        if cell.tool.holding:
            raise self.failed("tired", " ")


class Numbers(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Iterator[Any]:  # type: ignore[override]
        """Yield what nobody wants if the tool holds something."""
        yield
        if cell.tool.holding:
            yield 7


class Trusting(Skill):
    """Look, and take an answer for granted."""

    uses: ClassVar = ("camera",)
    senses: ClassVar = True

    def run(self, cell: Cell) -> Steps:
        """Ask the first detector."""
        request = next(iter(cell.detectors.values())).request(cell.camera.capture(), "table")
        while not request.ready:
            yield
        request.result()


class Hopeless(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Give up."""
        yield
        raise self.failed("tired", "after 1 step")


class Butterfingers(Skill):
    """Hold what the tool holds."""

    reasons: ClassVar = ()
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (HOLDING, HOLDING)
    tool_left: ClassVar = {"halt": ANY}

    def run(self, cell: Cell) -> Steps:
        """Let go instead."""
        yield
        cell.tool.open()


class Secretive(Skill):
    """Grasp the target."""

    target: In[Target] = port(doc="what the tool touches")
    reasons: ClassVar = ("missed",)
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (EMPTY, HOLDING)
    tool_left: ClassVar = {"halt": ANY, "missed": ANY}

    def run(self, cell: Cell) -> Steps:
        """Tell nobody."""
        yield
        cell.tool.close()
        if not cell.tool.holding:
            raise self.failed("missed", "no seal")


class Hasty(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Start, and wait for nothing."""
        motion = yield from planned(self, cell.arm, lambda: ("aside", heeding(cell)))
        cell.arm.start(motion)


class Lingering(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Wait once more when nobody does."""
        try:
            yield
        finally:
            yield


class Stumbling(Pause):
    """Wait."""

    def run(self, cell: Cell) -> Steps:
        """Trip on the way out."""
        done = False
        try:
            yield
            done = True
        finally:
            if not done:
                raise ValueError("not done")


class Runaway(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Let the arm run."""
        motion = yield from planned(self, cell.arm, lambda: ("aside", heeding(cell)))
        cell.arm.start(motion)
        while not cell.arm.at_rest:
            yield
        if cell.arm.met:
            raise self.failed("blocked", cell.arm.met)


class Clinging(Skill):
    """Grasp the target."""

    target: In[Target] = port(doc="what the tool touches")
    reasons: ClassVar = ("missed",)
    uses: ClassVar = ("tool",)
    tool_state: ClassVar = (EMPTY, HOLDING)

    def run(self, cell: Cell) -> Steps:
        """Hold on to it, whatever comes."""
        cell.tool.close()
        yield
        if not cell.tool.holding:
            cell.tool.open()
            raise self.failed("missed", "no seal")
        cell.ledger.held(self.target.item)


class Unplanned(Push):
    """Push the target aside."""

    def run(self, cell: Cell) -> Steps:
        """Forget to wait for the plan."""
        motion = planned(self, cell.arm, lambda: ("aside", heeding(cell)))
        yield from follow(self, cell, motion)  # type: ignore[arg-type]
