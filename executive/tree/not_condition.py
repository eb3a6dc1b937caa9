"""Control node that exchanges success and failure of a condition."""

from __future__ import annotations

from executive.tree.invert import Invert
from executive.tree.keys import Child, key


class NotCondition(Invert):
    """Succeed if the condition fails; fail with `inverted` if the condition succeeds.

    * BehaviorTree.CPP: `Inverter`.
    * py_trees: `decorators.Inverter`.
    """

    keyword = "not"
    is_condition = True

    do: Child = key(shorthand=True, in_path=False, conditions=True, doc="Condition.")
