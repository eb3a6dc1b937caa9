"""Going over a tree and everything it says, whatever it is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

from executive.mission.model.nodes import Backoff, Catch, Node
from executive.mission.model.values import Setting

Change = Callable[[Any], Any]


def changed(part: Any, change: Change) -> Any:
    """Return a node, or a part of one, with `change` made to everything that stands directly in it."""
    if isinstance(part, tuple):
        return tuple([change(item) for item in part])
    if isinstance(part, dict):
        return {key: change(item) for key, item in part.items()}
    if isinstance(part, Node | Setting | Catch | Backoff):
        return replace(part, **{field.name: change(getattr(part, field.name)) for field in fields(part)})
    return part
