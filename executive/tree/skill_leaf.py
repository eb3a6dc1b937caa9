"""Leaf of a tree that runs a skill, one step per tick."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import replace

from py_trees.common import Status
from pydantic import JsonValue

from executive.cell.json_values import to_json_or_type_name
from executive.cell.objects import Target
from executive.cell.protocols import Cell
from executive.errors import Fault, Interrupted, Stopped, to_text
from executive.events import NodeEnded, NodeStarted
from executive.skill import Direction, Skill, SkillFailed, get_attribute_name
from executive.tree.blackboard import Failure, NodeContext, Wiring
from executive.tree.expression import Scope
from executive.tree.specification import Expression
from executive.tree.tree_node import TreeNode


class SkillRun:
    """One run of a skill, from its first step until its end or halt.

    Args:
        skill: New instance of the skill with params and inputs.
        cell: Cell on which the skill acts.
    """

    def __init__(self, skill: Skill, cell: Cell) -> None:
        self._skill = skill
        self._cell = cell
        self._generator: Iterator[object] | None = None

    def step(self) -> bool:
        """Start the skill, or advance the skill by one step; return True if the skill has succeeded.

        Raises:
            SkillFailed: The skill failed with a declared reason.
            Fault: The skill failed with an undeclared reason, yielded a value, or left an output unset.
        """
        try:
            if self._generator is None:
                # A `run` without `yield` is a plain function: the skill succeeds when the function returns.
                self._generator = iter(self._skill.run(self._cell) or ())
            # The default `self` marks the end of the generator: no skill can yield its own `SkillRun`.
            yielded = next(self._generator, self)
        except SkillFailed as failed:
            if failed.reason in self._skill.reasons:
                raise
            declared = ", ".join(self._skill.reasons) or "none"
            message = f'it failed with the undeclared reason "{failed.reason}"; it declares: {declared}'
            raise _make_fault(message, failed) from failed
        if yielded is None:
            return False
        if yielded is not self:
            name = type(yielded).__name__
            raise Fault(f'it yielded a {name}; to run the steps of another generator, write "yield from"')
        if unset_outputs := [name for name in self._outputs.values() if not hasattr(self._skill, name)]:
            raise Fault(f"it succeeded without setting its output {', '.join(unset_outputs)}")
        return True

    def read_outputs(self) -> dict[str, object]:
        """Return the values of all outputs by name; only allowed after success."""
        return {name: getattr(self._skill, attribute) for name, attribute in self._outputs.items()}

    def halt(self) -> None:
        """Close the generator, so that its `finally` runs.

        Raises:
            Fault: The skill raised or yielded during its `finally`.
        """
        if not isinstance(self._generator, Generator):
            return
        try:
            self._generator.close()
        except Interrupted:
            raise
        except BaseException as error:
            message = f"{type(error).__name__} while it was halted: {to_text(error)}"
            if isinstance(error, RuntimeError) and "GeneratorExit" in str(error):
                message = 'it yielded while it was halted; "finally" must not contain a yield'
            raise _make_fault(message, error) from error

    @property
    def _outputs(self) -> dict[str, str]:
        """Attributes of the outputs, by the name of the output."""
        ports = self._skill.ports.values()
        return {port.name: get_attribute_name(port.name) for port in ports if port.direction is Direction.OUT}


def _make_fault(message: str, error: BaseException) -> Fault:
    """Return a fault whose traceback ends where the error was raised."""
    return Fault(message).with_traceback(error.__traceback__)


class SkillLeaf(TreeNode):
    """Leaf that creates an instance of a skill at every start, and runs one step of the skill per tick.

    Attributes:
        skill_name: Name of the skill in the mission.
        skill_type: Class of the skill.
        wiring: Connections of the ports of the skill.
    """

    def __init__(
        self, context: NodeContext, name: str, skill: type[Skill], wiring: Wiring, cell: Cell
    ) -> None:
        super().__init__(context, name)
        self.skill_name = name
        self.skill_type = skill
        self.wiring = wiring
        self._cell = cell
        self._run: SkillRun | None = None
        self._item = ""
        # A required port names the item on which the skill acts; an optional port limits the selection.
        required_ports = [port for port in skill.ports.values() if port.default is ...]
        self._item_ports = [port.name for port in required_ports if port.refers_to == "item"]

    @property
    def detail(self) -> str:
        """The constants, and each variable whose name differs from its port, as a text for drawings."""
        texts = [self.skill_name] if self.label else []
        texts += [f"{name}: {_format_value(value)}" for name, value in self.wiring.constants.items()]
        texts += [f"{name}: {expression}" for name, expression in self.wiring.expressions.items()]
        for port, variable in {**self.wiring.inputs, **self.wiring.outputs}.items():
            # A variable of a subtree has the name of the subtree as a prefix: `pick.target`.
            name = variable.rpartition(".")[2] + self.wiring.make_field_suffix(port)
            if name != port:
                texts.append(f"{port}: ${name}")
        return ", ".join(texts)

    def tick_once(self) -> None:
        """Start the skill, or continue the skill by one step.

        Raises:
            Fault: The skill raised an exception that is not a declared failure.
        """
        try:
            run = self._start() if self._run is None else self._run
            has_succeeded = run.step()
        except SkillFailed as error:
            status = self.fail(Failure(self.skill_name, error.reason, self.path, message=error.message))
            self._end(status, error.reason, error.message)
        except (Stopped, Interrupted):
            raise
        except BaseException as error:
            # Also `SystemExit`, the cancellation of a coroutine, or the panic of an extension.
            message = str(error) if isinstance(error, Fault) else f"{type(error).__name__}: {to_text(error)}"
            raise self._end_with_fault(message) from error
        else:
            if has_succeeded:
                values = run.read_outputs()
                outputs = {port: values[port] for port in self.wiring.outputs}
                self.blackboard.update({self.wiring.outputs[port]: value for port, value in outputs.items()})
                self._item = self._find_item(outputs) or self._item
                texts = {port: to_json_or_type_name(value) for port, value in outputs.items()}
                self._end(Status.SUCCESS, outputs=texts)

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Set the status; close the generator of a running skill, so that its `finally` runs.

        Raises:
            Fault: The skill raised or yielded during its `finally`.
        """
        if self.status is not Status.RUNNING:
            self.status = new_status
            return
        run = self._run
        self._run = None
        self.status = new_status
        try:
            if run is not None:
                run.halt()
        except Fault as fault:
            raise self._end_with_fault(str(fault)) from fault
        self._end(new_status)

    def _start(self) -> SkillRun:
        self._begin()
        inputs = self._read_inputs()
        self._item = self._find_item(inputs)
        self.emit(NodeStarted(self.path, self.skill_name, self._item))
        computed = {name: self._compute(name, value) for name, value in self.wiring.expressions.items()}
        self._run = SkillRun(self.skill_type(**self.wiring.constants, **inputs, **computed), self._cell)
        return self._run

    def _read_inputs(self) -> dict[str, object]:
        inputs = {}
        for port, variable in self.wiring.inputs.items():
            if variable in self.blackboard:
                field = self.wiring.fields.get(port)
                inputs[port] = self._scope.read(variable, field) if field else self.blackboard[variable]
            elif port not in self.skill_type.ports or self.skill_type.ports[port].is_required:
                raise Fault(f'the input "{port}" reads {self.blackboard.describe_missing(variable)}')
        return inputs

    @property
    def _scope(self) -> Scope:
        """What the expressions of the node can read."""
        return Scope(self.blackboard, self._cell.ledger, self._cell.clock)

    def _compute(self, name: str, expression: Expression) -> object:
        """Return the value of an expression for a param or input, or its function of a candidate."""
        param = self.skill_type.params.get(name)
        if param is None or not param.candidate:
            return self._scope.evaluate(expression)
        candidate = param.candidate
        return lambda value: replace(self._scope, local_values={f".{candidate}": value}).evaluate(expression)

    def _find_item(self, values: Mapping[str, object]) -> str:
        """Return the item on which the skill acts, from the values of its ports; "" for no item."""
        for value in values.values():
            if isinstance(value, Target):
                return value.item
        items = (values.get(port) for port in self._item_ports)
        return next((item for item in items if isinstance(item, str) and item), "")

    def _end_with_fault(self, message: str) -> Fault:
        """End the node, and return the fault, which the caller raises."""
        self._end(Status.INVALID, "fault", message)
        return Fault(f"{self.name}: {message}", self.path)

    def _end(
        self,
        status: Status,
        reason: str = "",
        message: str = "",
        outputs: Mapping[str, JsonValue] | None = None,
    ) -> None:
        self.status = status
        self._run = None
        event = NodeEnded(self.path, status.value, self.skill_name, self._item, reason, message, "", outputs)
        self.emit(event)


def _format_value(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
