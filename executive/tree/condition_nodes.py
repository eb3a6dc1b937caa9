"""Control nodes that combine conditions: all, any and not."""

from __future__ import annotations

from typing import ClassVar

from executive.tree.fallback import Fallback
from executive.tree.invert import Invert
from executive.tree.keys import Child, Children, KeyOwner, key
from executive.tree.sequence import Sequence


class ConditionList(KeyOwner):
    """Mixin of `all` and `any`, which restricts a sequence or a fallback to conditions.

    Conditions decide within one tick, so the key `memory` would have no effect.
    """

    is_condition: ClassVar[bool] = True
    memory = True

    do: Children = key(shorthand=True, requires_conditions=True, doc="Conditions, in order.")


class AllConditions(ConditionList, Sequence):
    """Succeed if all conditions succeed; fail with the first failure, without a check of later conditions.

    * BehaviorTree.CPP: `Sequence`.
    * py_trees: `Sequence`.
    """

    keyword = "all"
    symbol = "&"


class AnyCondition(ConditionList, Fallback):
    """Succeed with the first condition that succeeds; fail with the failure of the last condition.

    * BehaviorTree.CPP: `Fallback`.
    * py_trees: `Selector`.
    """

    keyword = "any"
    symbol = "≥1"


class NotCondition(Invert):
    """Succeed if the condition fails; fail with `inverted` if the condition succeeds.

    * BehaviorTree.CPP: `Inverter`.
    * py_trees: `decorators.Inverter`.
    """

    keyword = "not"
    is_condition = True

    do: Child = key(shorthand=True, in_path=False, requires_conditions=True, doc="Condition.")
