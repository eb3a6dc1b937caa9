"""The variables of a subtree that keeps them to itself: those it does not return get names of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any

from executive.mission.nodes import Backoff, Catch, ForEachNode, Node, SkillNode
from executive.mission.values import Named, Reference, Setting
from executive.skill import Skill

Rename = Callable[[str], str]


def renamed(root: Node, rename: Rename, skills: Mapping[str, type[Skill]]) -> Node:
    """Return the tree with every variable called otherwise, those of ports that are not wired included."""

    def of(part: Any) -> Any:
        if isinstance(part, Reference):
            return replace(part, name=rename(part.name))
        if isinstance(part, Node | Setting | Catch | Backoff):
            return node(part)
        if isinstance(part, tuple):
            return tuple([of(item) for item in part])
        if isinstance(part, dict):
            return {key: of(item) for key, item in part.items()}
        return part

    def node(part: Any) -> Any:
        changed = {field.name: of(getattr(part, field.name)) for field in fields(part)}
        if isinstance(part, ForEachNode):
            changed["each"] = Named(rename(part.each.name), part.each.mark)
        if isinstance(part, SkillNode) and part.skill in skills:
            ports = skills[part.skill].ports
            changed["names"] = {port: rename(part.names.get(port, port)) for port in ports}
        return replace(part, **changed)

    result: Node = node(root)
    return result
