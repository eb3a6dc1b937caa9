"""Skill that compares two values."""

from __future__ import annotations

from typing import TypeAlias

from executive.cell.protocols import Cell
from executive.skill import In, Skill, port

Plain: TypeAlias = str | int | float | bool
"""Type of the values that a mission file can contain, without lists."""


class IsEqual(Skill):
    """Check that a value, for instance a field of a variable, is equal to another value.

    The skill fails with `different` if the values are not equal.
    """

    value: In[Plain] = port(compared_with="to", doc="the value to compare, for example `$target.label`")
    to: In[Plain] = port(compared_with="value", doc="the expected value, for example `cube`")
    reasons = ("different",)
    is_condition = True

    def run(self, cell: Cell) -> None:
        """Compare the values."""
        del cell
        if self.value != self.to:
            raise self.failure("different", f"the value is {self.value}, not {self.to}")
