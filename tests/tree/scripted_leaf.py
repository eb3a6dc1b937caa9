"""A leaf that does what a script says."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.blackboard import Failure


class Leaf(Behaviour):
    """Runs once per script: `R` hands back a tick, `S` succeeds, any other word is why it fails.

    The last script is used again and again.
    """

    def __init__(self, name: str, scripts: tuple[str, ...], log: list[str]) -> None:
        super().__init__(name)
        self.path = name
        self.failure: Failure | None = None
        self.breaks = False
        self._scripts, self._log, self._runs, self._steps = scripts, log, 0, iter("")

    def rewind(self) -> None:
        """Begin with the first script again."""
        self._runs = 0

    def initialise(self) -> None:
        script = self._scripts[min(self._runs, len(self._scripts) - 1)]
        self._runs += 1
        self._steps = iter(script.split())
        self._log.append(f"{self.name} starts")

    def update(self) -> Status:
        step = next(self._steps)
        if step == "R":
            return Status.RUNNING
        if step == "S":
            return Status.SUCCESS
        if step == "!":
            raise RuntimeError("broken")
        self.failure = Failure(self.name, step, self.path, message=f"{step} happened")
        return Status.FAILURE

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID and self.status is Status.RUNNING:
            self._log.append(f"{self.name} halted")
            if self.breaks:
                raise RuntimeError("cannot stop")
