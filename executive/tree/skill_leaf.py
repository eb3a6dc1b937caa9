"""A skill as a leaf of the tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from pydantic import JsonValue

from executive.cell.objects import Target
from executive.cell.plain import plain_or_type
from executive.cell.protocols import Cell
from executive.errors import Fault
from executive.events import NodeEnded, NodeStarted
from executive.skill import Skill, SkillFailed
from executive.tree.failure import Failure
from executive.tree.node import Site
from executive.tree.skill_run import SkillRun


@dataclass(frozen=True)
class Wiring:
    """What a mission connects to a skill.

    Attributes:
        constants: Params and inputs with a value from the mission file.
        inputs: Variable read by each other input.
        outputs: Variable written by each output.
    """

    constants: Mapping[str, object] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)


class SkillLeaf(Behaviour):
    """Runs one skill: a fresh instance per start, one step of its generator per tick.

    Attributes:
        path: Unique path from the root of the tree.
        failure: Why it failed, while its status is FAILURE; else None.
        skill_type: What it runs.
        wiring: What the mission connects to it.
        subtrees: Names of the subtrees that begin with it, the outermost first.
    """

    subtrees: tuple[str, ...] = ()

    def __init__(self, site: Site, name: str, skill: type[Skill], wiring: Wiring, cell: Cell) -> None:
        super().__init__(site.label or name)
        self.path, self.label, self.skill_name = site.path, site.label, name
        self.failure: Failure | None = None
        self._emit = site.emit
        self.skill_type, self.wiring, self._cell, self._blackboard = skill, wiring, cell, site.blackboard
        self._run: SkillRun | None = None
        self._item = ""
        # An item that may be left out narrows a choice; what the skill works on it always has.
        self._item_ports = tuple(
            name for name, port in skill.ports.items() if port.refers == "item" and port.default is ...
        )

    @property
    def detail(self) -> str:
        """The constants and the renamed variables, for outlines."""
        said = {name: _shown(value) for name, value in self.wiring.constants.items()}
        wired = {**self.wiring.inputs, **self.wiring.outputs}
        said |= {port: f"${name}" for port, name in _bare(wired).items() if port != name}
        if self.label:
            return ", ".join([self.skill_name, *(f"{key}: {value}" for key, value in said.items())])
        return ", ".join(f"{key}: {value}" for key, value in said.items())

    def tick_once(self) -> None:
        """Start the skill or go on by one step.

        Raises:
            Fault: The skill raised anything but a declared failure.
        """
        try:
            run = self._start() if self._run is None else self._run
            has_succeeded = run.step()
        except SkillFailed as failed:
            self._fail(failed)
        except Exception as error:
            text = str(error) if isinstance(error, Fault) else f"{type(error).__name__}: {error}"
            raise self._fault(text) from error
        else:
            if has_succeeded:
                self._succeed(run.outputs())

    def update(self) -> Status:
        """Go on by one tick and return the status: py_trees' name for it."""
        self.tick_once()
        return self.status

    def tick(self) -> Iterator[Behaviour]:
        """Go on by one tick, then yield this node."""
        self.tick_once()
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Close the running skill, so that its `finally` runs; a skill that is not running stays as it is.

        Raises:
            Fault: The skill raised, or yielded, while it was being closed.
        """
        if self.status is not Status.RUNNING:
            self.status = new_status
            return
        run = self._run
        self._close(new_status)
        try:
            if run is not None:
                run.halt()
        except Fault as fault:
            raise self._fault(str(fault)) from fault
        self._emit_end(new_status)

    def _start(self) -> SkillRun:
        self.failure = None
        self.status = Status.RUNNING
        inputs = self._read()
        self._item = self._item_of(inputs)
        self._emit(NodeStarted(self.path, self.skill_name, self._item))
        self._run = SkillRun(self.skill_type(**self.wiring.constants, **inputs), self._cell)
        return self._run

    def _read(self) -> dict[str, object]:
        inputs = {}
        for port, variable in self.wiring.inputs.items():
            if variable in self._blackboard:
                inputs[port] = self._blackboard[variable]
            elif self.skill_type.ports[port].required:
                raise Fault(
                    f'the input "{port}" reads ${variable}, which nothing has written yet; '
                    f"written so far: {', '.join(self._blackboard) or 'nothing'}"
                )
        return inputs

    def _item_of(self, values: Mapping[str, object]) -> str:
        """Return the item that these port values are about, or ""."""
        for value in values.values():
            if isinstance(value, Target):
                return value.item
        return next((str(values[port]) for port in self._item_ports if values.get(port)), "")

    def _succeed(self, values: Mapping[str, object]) -> None:
        outputs = {port: values[port] for port in self.wiring.outputs}
        self._blackboard.write({self.wiring.outputs[port]: value for port, value in outputs.items()})
        self._item = self._item_of(outputs) or self._item
        self._close(Status.SUCCESS)
        plain = {port: plain_or_type(value) for port, value in outputs.items()}
        self._emit_end(Status.SUCCESS, outputs=plain)

    def _fail(self, failed: SkillFailed) -> None:
        labels = (self.label,) if self.label else ()
        self.failure = Failure(failed.reason, failed.message, self.skill_name, self.path, labels)
        self._close(Status.FAILURE)
        self._emit_end(Status.FAILURE, failed.reason, failed.message)

    def _fault(self, message: str) -> Fault:
        self._close(Status.INVALID)
        self._emit_end(Status.INVALID, "fault", message)
        return Fault(f"{self.name}: {message}", self.path)

    def _close(self, status: Status) -> None:
        self.status, self._run = status, None

    def _emit_end(
        self,
        status: Status,
        reason: str = "",
        message: str = "",
        outputs: Mapping[str, JsonValue] | None = None,
    ) -> None:
        event = NodeEnded(self.path, status.value, self.skill_name, self._item, reason, message, "", outputs)
        self._emit(event)


def _bare(wired: Mapping[str, str]) -> dict[str, str]:
    """Return the variables by port, those a subtree keeps to itself as its author calls them."""
    return {port: variable.rpartition(".")[2] for port, variable in wired.items()}


def _shown(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
