"""Leaf of the tree that runs a skill."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from pydantic import JsonValue

from executive.cell.json_values import to_json_or_type_name
from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.errors import Fault
from executive.events import NodeEnded, NodeStarted
from executive.skill import Skill, SkillFailed
from executive.tree.failure import Failure
from executive.tree.node import NodeContext
from executive.tree.skill_run import SkillRun


@dataclass(frozen=True)
class Wiring:
    """Connections of the ports of a skill to the constants and variables of a mission.

    Attributes:
        constants: Values of params and inputs from the mission file, by the name of the param or input.
        inputs: Names of the variables from which inputs are read, by the name of the input.
        outputs: Names of the variables to which outputs are written, by the name of the output.
    """

    constants: Mapping[str, object] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)


class SkillLeaf(Behaviour):
    """Runs one skill: creates an instance at every start, and advances its generator by one step per tick.

    Attributes:
        path: Unique path from the root of the tree.
        label: Label of the leaf in the mission, or "".
        skill_name: Name of the skill in the mission.
        failure: The failure while the status is FAILURE; else None.
        skill_type: Class of the skill.
        wiring: Connections of the ports of the skill.
        subtrees: Names of the subtrees whose root is this leaf, the outermost first.
    """

    subtrees: tuple[str, ...] = ()

    def __init__(
        self, context: NodeContext, name: str, skill: type[Skill], wiring: Wiring, cell: Cell
    ) -> None:
        super().__init__(context.label or name)
        self.path, self.label, self.skill_name = context.path, context.label, name
        self.failure: Failure | None = None
        self._emit = context.emit
        self.skill_type, self.wiring, self._cell, self._blackboard = skill, wiring, cell, context.blackboard
        self._run: SkillRun | None = None
        self._item = ""
        # The skill acts on the item of a required port; an optional item only narrows a choice.
        self._item_ports = tuple(
            name for name, port in skill.ports.items() if port.refers == "item" and port.default is ...
        )

    @property
    def detail(self) -> str:
        """The constants, and the variables whose names differ from their ports, as a text for outlines."""
        settings = {name: _format_value(value) for name, value in self.wiring.constants.items()}
        variables = _remove_subtree_names({**self.wiring.inputs, **self.wiring.outputs})
        settings |= {port: f"${name}" for port, name in variables.items() if port != name}
        if self.label:
            return ", ".join([self.skill_name, *(f"{key}: {value}" for key, value in settings.items())])
        return ", ".join(f"{key}: {value}" for key, value in settings.items())

    def tick_once(self) -> None:
        """Start the skill, or continue it by one step.

        Raises:
            Fault: The skill raised an exception that is not a declared failure.
        """
        try:
            run = self._start() if self._run is None else self._run
            has_succeeded = run.step()
        except SkillFailed as failed:
            self._fail(failed)
        except Exception as error:
            text = str(error) if isinstance(error, Fault) else f"{type(error).__name__}: {error}"
            raise self._end_with_fault(text) from error
        else:
            if has_succeeded:
                self._succeed(run.read_outputs())

    def update(self) -> Status:
        """Continue by one tick and return the status; part of the interface of py_trees."""
        self.tick_once()
        return self.status

    def tick(self) -> Iterator[Behaviour]:
        """Continue by one tick, then yield this node."""
        self.tick_once()
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Set the status; close the generator of a running skill, so that its `finally` runs.

        Raises:
            Fault: The skill raised or yielded during its `finally`.
        """
        if self.status is not Status.RUNNING:
            self.status = new_status
            return
        run = self._run
        self._end_run(new_status)
        try:
            if run is not None:
                run.halt()
        except Fault as fault:
            raise self._end_with_fault(str(fault)) from fault
        self._emit_end(new_status)

    def _start(self) -> SkillRun:
        self.failure = None
        self.status = Status.RUNNING
        inputs = self._read_inputs()
        self._item = self._find_item(inputs)
        self._emit(NodeStarted(self.path, self.skill_name, self._item))
        self._run = SkillRun(self.skill_type(**self.wiring.constants, **inputs), self._cell)
        return self._run

    def _read_inputs(self) -> dict[str, object]:
        inputs = {}
        for port, variable in self.wiring.inputs.items():
            if variable in self._blackboard:
                inputs[port] = self._blackboard[variable]
            elif self.skill_type.ports[port].is_required:
                raise Fault(
                    f'the input "{port}" reads ${variable}, which no node has written yet; '
                    f"written so far: {', '.join(self._blackboard) or 'nothing'}"
                )
        return inputs

    def _find_item(self, values: Mapping[str, object]) -> str:
        """Return the item on which the skill acts, given the values of its ports; "" if there is none."""
        for value in values.values():
            if isinstance(value, Target):
                return value.item
        return next((str(values[port]) for port in self._item_ports if values.get(port)), "")

    def _succeed(self, values: Mapping[str, object]) -> None:
        outputs = {port: values[port] for port in self.wiring.outputs}
        self._blackboard.write({self.wiring.outputs[port]: value for port, value in outputs.items()})
        self._item = self._find_item(outputs) or self._item
        self._end_run(Status.SUCCESS)
        reported = {port: to_json_or_type_name(value) for port, value in outputs.items()}
        self._emit_end(Status.SUCCESS, outputs=reported)

    def _fail(self, failed: SkillFailed) -> None:
        labels = (self.label,) if self.label else ()
        self.failure = Failure(failed.reason, failed.message, self.skill_name, self.path, labels)
        self._end_run(Status.FAILURE)
        self._emit_end(Status.FAILURE, failed.reason, failed.message)

    def _end_with_fault(self, message: str) -> Fault:
        self._end_run(Status.INVALID)
        self._emit_end(Status.INVALID, "fault", message)
        return Fault(f"{self.name}: {message}", self.path)

    def _end_run(self, status: Status) -> None:
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


def _remove_subtree_names(variables: Mapping[str, str]) -> dict[str, str]:
    """Return the variables by port, each without the name of its subtree: `target` for `pick.target`."""
    return {port: variable.rpartition(".")[2] for port, variable in variables.items()}


def _format_value(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
