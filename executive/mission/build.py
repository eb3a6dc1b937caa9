"""Construction of the behaviour tree of a checked mission."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from executive.cell.protocols import Cell
from executive.errors import InputError
from executive.events import Emit
from executive.mission.grammar import SEQUENCE_KEYWORD
from executive.mission.load import LoadedMission
from executive.mission.ports import convert_setting, find_literals, find_wires
from executive.skill import Direction, Param, Port, Skill
from executive.tree.blackboard import Blackboard, NodeContext, Wiring
from executive.tree.node import ControlNode, ControlNodes, load_control_nodes
from executive.tree.specification import Node, SkillNode, SubtreeNode
from executive.tree.tree_node import SkillLeaf, TreeNode


def build_tree(
    loaded: LoadedMission,
    skills: Mapping[str, type[Skill]],
    cell: Cell,
    blackboard: Blackboard,
    emit: Emit,
    substitutes: Mapping[str, type[Skill]] | None = None,
) -> TreeNode:
    """Return the root of a new behaviour tree; every node of the tree has a unique, readable `path`.

    `skills` contains the installed skills by name. `substitutes` contains skills that run in place of the
    mission's skills, by pattern of node paths. In a pattern, `*` matches any characters, including `/`. The
    first matching pattern applies.

    Raises:
        InputError: A pattern matches no skill node.
    """
    builder = TreeBuilder({**loaded.skills, **skills}, cell, blackboard, emit, substitutes or {})
    root = builder.build_node(loaded.tree)
    paths = [node.path for node in root.iterate() if isinstance(node, SkillLeaf)]
    for pattern in builder.substitutes:
        if not any(fnmatchcase(path, pattern) for path in paths):
            raise InputError(f'no skill node matches "{pattern}"; the skill nodes are: {", ".join(paths)}')
    return root


@dataclass(frozen=True)
class TreeBuilder:
    """Builder of the behaviour tree of one mission.

    Attributes:
        substitutes: Skills that run in place of the mission's skills, by pattern of node paths.
    """

    skills: Mapping[str, type[Skill]]
    cell: Cell
    blackboard: Blackboard
    emit: Emit
    substitutes: Mapping[str, type[Skill]]
    node_classes: ControlNodes = field(default_factory=load_control_nodes)

    def build_node(self, node: Node) -> TreeNode:
        """Return the behaviour for a node of the mission, with the behaviours of all nodes below it."""
        cell = self.cell
        context = NodeContext(node.path, cell.clock, cell.ledger, self.blackboard, node.label, self.emit)
        match node:
            case SkillNode():
                return self._build_skill_leaf(context, node)
            case ControlNode():
                return node.Behaviour(context, node, self.build_node)
            case SubtreeNode(body=Node() as subtree_root):
                body = self.build_node(subtree_root)
                # A node has one label, so the label of the `use` belongs to a sequence around the subtree.
                root = body
                if node.label:
                    sequence = self.node_classes[SEQUENCE_KEYWORD].make({}, do=(subtree_root,))
                    root = sequence.Behaviour(context, sequence, lambda _: body)
                root.subtree_names = (node.name, *root.subtree_names)
                return root
        raise AssertionError(f"a checked mission contains no {type(node).__name__}")

    def _build_skill_leaf(self, context: NodeContext, node: SkillNode) -> TreeNode:
        skill = self.skills[node.skill]
        declarations: Mapping[str, Param | Port] = {**skill.params, **skill.ports}
        input_wires = list(find_wires(node, skill, Direction.IN))
        wiring = Wiring(
            constants={
                name: convert_setting(value.value, declarations[name]) for name, value in find_literals(node)
            },
            inputs={wire.port.name: wire.variable for wire in input_wires},
            fields={wire.port.name: wire.field for wire in input_wires if wire.field},
            outputs={wire.port.name: wire.variable for wire in find_wires(node, skill, Direction.OUT)},
        )
        patterns = (pattern for pattern in self.substitutes if fnmatchcase(node.path, pattern))
        executed_skill = next((self.substitutes[pattern] for pattern in patterns), skill)
        return SkillLeaf(context, node.skill, executed_skill, wiring, self.cell)
