"""Behaviours of py_trees as another project may write them."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure
from py_trees.blackboard import Blackboard
from py_trees.common import Access, ParallelPolicy, Status
from py_trees.composites import Parallel
from py_trees.decorators import Inverter
from py_trees.ports import BehaviourWithPorts, PortInformation

if TYPE_CHECKING:
    from nowhere import Thing


class Colour(Enum):
    RED = "r"
    BLUE = "b"


class Painter(Behaviour):
    """Paint.

    Args:
        name: name of the behaviour
        colour (Colour): colour of the paint,
            which dries
        then: statuses, in order
        stroke: length [m]
    """

    def __init__(
        self, name: str, colour: Colour, then: Sequence[Status] = (), stroke: float = 0.1, **others: Any
    ) -> None:
        super().__init__(name, **others)

    def update(self) -> Status:
        return Status.SUCCESS


class Primer(Painter):
    """Paint twice."""

    def __init__(self, coats: int | None = None, **others: Any) -> None:
        super().__init__(**others)


class Untyped(Painter):
    """Take anything."""

    def __init__(self, thing: Thing, other=3) -> None:  # type: ignore[no-untyped-def]
        super().__init__("Untyped", Colour.RED)


class Logged(Behaviour):
    """Note every call; run for two ticks, then end with `last`."""

    calls: ClassVar[list[str]] = []

    def __init__(self, name: str, last: Status = Status.SUCCESS, broken: str = "") -> None:
        super().__init__(name)
        self.last = last
        self.broken = broken
        self.ticks = 0
        self._note("init")

    def _note(self, call: str) -> None:
        Logged.calls.append(call)
        if self.broken and call.startswith(self.broken):
            raise RuntimeError(f"broken {self.broken}")

    def setup(self, **kwargs: object) -> None:
        self._note("setup")

    def initialise(self) -> None:
        self._note("initialise")

    def update(self) -> Status:
        self._note("update")
        self.ticks += 1
        self.feedback_message = f"ticked {self.ticks} times"
        return Status.RUNNING if self.ticks < 2 else self.last

    def terminate(self, new_status: Status) -> None:
        self._note(f"terminate {self.status.name} to {new_status.name}")

    def shutdown(self) -> None:
        self._note("shutdown")


class Quiet(Inverter):
    """Fail without a word of its own."""

    def __init__(self, name: str) -> None:
        super().__init__(name, Failure("the child"))

    def update(self) -> Status:
        return Status.FAILURE


class TwoArms(Parallel):
    """Two endless children that cannot stop."""

    stopped: ClassVar[list[str]] = []

    def __init__(self, name: str) -> None:
        super().__init__(name, ParallelPolicy.SuccessOnAll(), [Stubborn("left"), Stubborn("right")])


class Stubborn(Behaviour):
    """Run for ever, and raise an exception when stopped."""

    def update(self) -> Status:
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        TwoArms.stopped.append(self.name)
        raise RuntimeError(f"{self.name} does not stop")


class Counter(Behaviour):
    """Add one to `/count` on the blackboard; fail above `most`."""

    def __init__(self, name: str, most: int = 100) -> None:
        super().__init__(name)
        self.most = most
        self.board = self.attach_blackboard_client()
        self.board.register_key("count", Access.WRITE)

    def update(self) -> Status:
        count = self.board.get("count") + 1 if self.board.exists("count") else 1
        self.board.set("count", count)
        self.feedback_message = f"count is {count}"
        return Status.SUCCESS if count <= self.most else Status.FAILURE


class Double(BehaviourWithPorts):
    """Double a number."""

    INPUT_PORTS: ClassVar = {
        "number": PortInformation(float, description="number to double"),
        "offset": PortInformation(float, default_value=0.5, description="offset of the result"),
        "note": PortInformation(str, required=False, description="text"),
    }
    OUTPUT_PORTS: ClassVar = {
        "doubled": PortInformation(float, description="result"),
        "remark": PortInformation(str, required=False, description="text"),
    }

    def update(self) -> Status:
        number = self.get_input("number")
        if number < 0:
            return Status.SUCCESS  # The required output stays unset.
        self._set_output("doubled", 2 * number + self.get_input("offset"))
        if note := self.get_input("note", default="none"):
            self._set_output("remark", f"note: {note}")
        return Status.SUCCESS


class Reserved(Painter):
    """Have an argument with a reserved name."""

    def __init__(self, name: str, run: int) -> None:
        super().__init__(name, Colour.RED)


class Secretive(Double):
    """Claim to be a condition in spite of its outputs."""

    is_condition = True


class Odd(Behaviour):
    """Return no status."""

    def update(self) -> Status:
        return None  # type: ignore[return-value]


class Keep(Behaviour):
    """Keep a value on the blackboard that JSON cannot restore."""

    def update(self) -> Status:
        Blackboard.set("/kept", Status.SUCCESS)
        return Status.SUCCESS
