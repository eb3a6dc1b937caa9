"""Control node that succeeds if at least one condition succeeds."""

from __future__ import annotations

from typing import ClassVar

from executive.tree.condition_list import ConditionList
from executive.tree.fallback import Fallback


class AnyCondition(ConditionList, Fallback):
    """Succeed with the first condition that succeeds; fail with the failure of the last condition.

    * BehaviorTree.CPP: `Fallback`.
    * py_trees: `Selector`.
    """

    keyword = "any"
    keyword_hints: ClassVar = {"or": "Write any."}
    symbol = "≥1"
