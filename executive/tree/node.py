"""What every control node is: a py_trees composite that ticks its children directly.

`tick_once` is the primitive. It costs one call a level where py_trees' generators cost several, and it
never walks over finished children. `tick` offers the same to py_trees' own tools, which then see one
node, not its descendants: the executive observes a tree through events, not through visitors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from executive.errors import Fault
from executive.events import BranchChosen, Emit, NodeEnded, NodeStarted, ignore
from executive.tree.failure import Failure
from executive.tree.halting import halt


@dataclass(frozen=True)
class Site:
    """Where a node stands and who is told about it.

    Attributes:
        path: Unique path from the root of the tree.
        label: What the mission calls it with `as:`, or "".
        emit: Takes its `status` and `choice` events.
    """

    path: str
    label: str = ""
    emit: Emit = ignore


class ControlNode(Composite):
    """Base of the control nodes; a subclass says in `start` how it begins and in `step` how it goes on.

    Attributes:
        word: What the node is called in a mission; the source of failures of its own.
        path: Unique path from the root of the tree.
        failure: Why it failed, while its status is FAILURE; else None.
        subtrees: Names of the subtrees that begin with it, the outermost first.
    """

    word = "node"
    subtrees: tuple[str, ...] = ()

    def __init__(self, site: Site, children: Sequence[Behaviour]) -> None:
        super().__init__(site.label or self.word, children)
        self.path, self.label = site.path, site.label
        self.failure: Failure | None = None
        self._emit = site.emit

    @property
    def detail(self) -> str:
        """What the mission says about it, in a few words, for outlines."""
        return ""

    def when(self, child: Behaviour) -> str:
        """Return after which failures a child runs, in a few words; "" for one that needs none."""
        del child
        return ""

    def start(self) -> None:
        """Begin anew; called before the first `step` of every activation."""

    def step(self) -> Status:
        """Go on by one tick and return RUNNING, SUCCESS or FAILURE; set `failure` before FAILURE."""
        raise NotImplementedError

    def clean_up(self) -> None:
        """Leave nothing behind; called once at the end of every activation, however it ends."""

    def tick_once(self) -> None:
        """Go on by one tick."""
        if self.status is not Status.RUNNING:
            self.failure = None
            self.status = Status.RUNNING
            self._emit(NodeStarted(self.path))
            self.start()
        status = self.step()
        if status is not Status.RUNNING:
            self._end(status)

    def tick(self) -> Iterator[Behaviour]:
        """Go on by one tick, then yield this node."""
        self.tick_once()
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """End with `new_status`; what still runs below is halted first.

        Raises:
            Fault: The clean-up of a node below failed; all the others were halted none the less.
        """
        was_running = self.status is Status.RUNNING
        try:
            self.halt_children(self.children)
        finally:
            self.status = new_status
            if was_running:
                self.clean_up()
                self._emit(NodeEnded(self.path, new_status.value))

    def run_child(self, child: Behaviour) -> Status:
        """Tick a child and return its status."""
        child.tick_once()
        status = child.status
        if status is Status.INVALID:
            raise Fault(f"{child.name} was ticked and has no status", self.path)
        return status

    def halt_children(self, children: Iterable[Behaviour]) -> None:
        """End whatever runs in and below these children, one after the other.

        Raises:
            Fault: The clean-up of some of them failed; all the others were ended none the less.
        """
        if problems := [problem for child in children for problem in halt(child)]:
            raise Fault("; ".join(problems), self.path)

    def failure_of(self, child: Behaviour) -> Failure:
        """Return why a child failed; a stock py_trees behaviour can only say that it did."""
        failure = getattr(child, "failure", None)
        if isinstance(failure, Failure):
            return failure
        return Failure("failed", child.feedback_message, child.name, self.path)

    def fail(self, failure: Failure) -> Status:
        """Fail for a reason that came from below, and return FAILURE."""
        self.failure = failure.seen_from(self.label)
        return Status.FAILURE

    def fail_for(self, reason: str, message: str) -> Status:
        """Fail for a reason of this node's own, and return FAILURE."""
        return self.fail(Failure(reason, message, self.word, self.path))

    def choose(self, choice: str, why: Failure | None = None) -> None:
        """Tell the observers what the node does next, and about which failure, if it is about one."""
        reason, message = (str(why), why.message) if why else ("", "")
        self._emit(BranchChosen(self.path, choice, reason, message))

    def _end(self, status: Status) -> None:
        self.status = status
        self.clean_up()
        failure = self.failure if status is Status.FAILURE else None
        reason, message, origin = (str(failure), failure.message, failure.path) if failure else ("", "", "")
        self._emit(NodeEnded(self.path, status.value, reason=reason, message=message, origin=origin))
