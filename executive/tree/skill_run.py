"""One run of a skill, step by step."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING

from executive.errors import Fault
from executive.skill import Direction, Skill, SkillFailed, get_attribute_name

if TYPE_CHECKING:
    from executive.cell.protocols import Cell


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
        except Exception as error:
            message = f"{type(error).__name__} while it was halted: {error}"
            if isinstance(error, RuntimeError) and "GeneratorExit" in str(error):
                message = 'it yielded while it was halted; "finally" must not contain a yield'
            raise _make_fault(message, error) from error

    @property
    def _outputs(self) -> dict[str, str]:
        """Attributes of the outputs, by the name of the output."""
        ports = self._skill.ports.values()
        return {port.name: get_attribute_name(port.name) for port in ports if port.direction is Direction.OUT}


def _make_fault(message: str, error: Exception) -> Fault:
    """Return a fault whose traceback ends where the error was raised."""
    return Fault(message).with_traceback(error.__traceback__)
