"""The variables of a subtree that keeps them to itself: those it does not return get names of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from executive.mission.model.nodes import ForEachNode, Node, SkillNode, UseNode
from executive.mission.model.parts import changed
from executive.mission.model.values import Reference
from executive.skill import Skill

Rename = Callable[[str], str]


def renamed(root: Node, rename: Rename, skills: Mapping[str, type[Skill]]) -> Node:
    """Return the tree with every variable called otherwise: those of ports not wired, those returned, too."""

    def of(part: Any) -> Any:
        if isinstance(part, Reference):
            return replace(part, name=rename(part.name))
        part = changed(part, of)
        if isinstance(part, ForEachNode):
            return replace(part, each=replace(part.each, name=rename(part.each.name)))
        if isinstance(part, UseNode):
            return replace(part, promised=tuple(map(rename, part.promised)))
        if isinstance(part, SkillNode) and part.skill in skills:
            ports = skills[part.skill].ports
            return replace(part, names={port: rename(part.names.get(port, port)) for port in ports})
        return part

    result: Node = of(root)
    return result
