"""Control node that succeeds if all conditions succeed."""

from __future__ import annotations

from typing import ClassVar

from executive.tree.keys import Children, Key, key
from executive.tree.sequence import Sequence


class AllConditions(Sequence):
    """Succeed if all conditions succeed; fail with the first failure, without a check of later conditions.

    * BehaviorTree.CPP: `Sequence`.
    * py_trees: `Sequence`.
    """

    keyword = "all"
    keyword_hints: ClassVar = {"and": "Write all."}
    symbol, shape = "&", "ellipse"
    is_condition = True
    # Conditions decide within one tick, so that the key `memory` of the sequence would have no effect.
    keys: ClassVar[dict[str, Key]] = {}
    memory = True

    do: Children = key(shorthand=True, conditions=True, doc="Conditions, in order.")
