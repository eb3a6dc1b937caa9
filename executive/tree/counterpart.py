"""Counterparts of control nodes in BehaviorTree.CPP, for the export of missions as XML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Counterpart:
    """Node type that BehaviorTree.CPP 4 registers, with the semantics of a control node.

    Attributes:
        name: Name of the node type.
        ports: Value of each port: the name of a key that the mission sets and whose value the port has, or
            a number that the control node has computed from its constants.
    """

    name: str
    ports: Mapping[str, str | int] = field(default_factory=dict)
