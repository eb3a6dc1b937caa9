"""Key of the control nodes that combine conditions: all and any."""

from __future__ import annotations

from typing import ClassVar

from executive.tree.keys import Children, KeyOwner, key


class ConditionList(KeyOwner):
    """First base class of `all` and `any`; the second base class is the sequence or the fallback.

    Conditions decide within one tick, so that the key `memory` would have no effect.
    """

    shape: ClassVar[str] = "ellipse"
    is_condition: ClassVar[bool] = True
    memory = True

    do: Children = key(shorthand=True, conditions=True, doc="Conditions, in order.")
