"""Control node that succeeds if at least one condition succeeds."""

from __future__ import annotations

from typing import ClassVar

from executive.tree.fallback import Fallback
from executive.tree.keys import Children, Key, key


class AnyCondition(Fallback):
    """Succeed with the first condition that succeeds; fail with the failure of the last condition.

    * BehaviorTree.CPP: `Fallback`.
    * py_trees: `Selector`.
    """

    keyword = "any"
    keyword_hints: ClassVar = {"or": "Write any."}
    symbol, shape = "≥1", "ellipse"
    is_condition = True
    # Conditions decide within one tick, so that the key `memory` of the fallback would have no effect.
    keys: ClassVar[dict[str, Key]] = {}
    memory = True

    do: Children = key(shorthand=True, conditions=True, doc="Conditions, in order.")
