"""Control node that succeeds if all conditions succeed."""

from __future__ import annotations

from typing import ClassVar

from executive.tree.condition_list import ConditionList
from executive.tree.sequence import Sequence


class AllConditions(ConditionList, Sequence):
    """Succeed if all conditions succeed; fail with the first failure, without a check of later conditions.

    * BehaviorTree.CPP: `Sequence`.
    * py_trees: `Sequence`.
    """

    keyword = "all"
    keyword_hints: ClassVar = {"and": "Write all."}
    symbol = "&"
