"""XML of a mission for BehaviorTree.CPP 4 and its editor Groot2.

Each subtree becomes a `BehaviorTree`, and each `use` a `SubTree` with the arguments as ports. A control node
becomes its counterpart in BehaviorTree.CPP; without a counterpart, it becomes a custom node with its keys as
ports. Nodes below another key than `do` become children of a node for the key, such as `retry-recover`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from executive.mission.model import nodes
from executive.mission.model.instance import make_inspection_instance
from executive.mission.model.mission import Mission, Subtree
from executive.mission.model.values import Literal, LocatedName, Reference
from executive.mission.model.wiring import find_written_variables
from executive.skill import Direction, Param, Port, Skill
from executive.tree.failure import Reason
from executive.tree.keys import Key, KeyKind
from executive.tree.node_registry import load_control_nodes
from executive.view.text import replace_invalid_xml_characters

_REGISTERED_NAMES = frozenset((
    "Action", "AlwaysFailure", "AlwaysSuccess", "AsyncFallback", "AsyncSequence", "BehaviorTree", "Condition",
    "Control", "Decorator", "Delay", "Fallback", "ForceFailure", "ForceSuccess", "IfThenElse", "Inverter",
    "KeepRunningUntilFailure", "LoopBool", "LoopDouble", "LoopInt", "LoopString", "Parallel", "ParallelAll",
    "Precondition", "ReactiveFallback", "ReactiveSequence", "Repeat", "RetryUntilSuccessful", "Root",
    "RunOnce", "Script", "ScriptCondition", "Sequence", "SequenceStar", "SequenceWithMemory", "SetBlackboard",
    "SkipUnlessUpdated", "Sleep", "SubTree", "Switch2", "Switch3", "Switch4", "Switch5", "Switch6", "Timeout",
    "root", "TryCatch", "Undefined", "UnsetBlackboard", "WaitValueUpdate", "WasEntryUpdated", "WhileDoElse",
))  # fmt: skip
"""Names that BehaviorTree.CPP 4.10 registers or reserves."""
_TYPE_NAMES: Mapping[object, str] = {bool: "bool", int: "int", float: "double", str: "std::string"}
"""Names of types in C++."""

_Port = Param | Port | Key
"""Declaration of a port of an exported node: a param, a port, an argument, or a key of a control node."""


def format_btcpp(mission: Mission, skills: Mapping[str, type[Skill]]) -> str:
    """Return the XML of a mission without errors; the values of its params replace references to them."""
    root = _Exporter(mission, skills).export()
    indent(root)
    text = replace_invalid_xml_characters(tostring(root, encoding="unicode"))
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}'


class _Exporter:
    """Exporter of one mission."""

    def __init__(self, mission: Mission, skills: Mapping[str, type[Skill]]) -> None:
        self._mission, self._skills = mission, skills
        self._models: dict[str, Element] = {}
        self._use_counts: Counter[str] = Counter()
        names = {*_REGISTERED_NAMES, *skills, *load_control_nodes()}
        self._tree_ids = {name: _make_unique(name, names) for name in mission.subtrees}
        self._main_id = _make_unique(mission.name, {*names, *self._tree_ids.values()})

    def export(self) -> Element:
        """Return the root element of the file."""
        root = Element("root", BTCPP_format="4", main_tree_to_execute=self._main_id)
        self._add_tree(root, self._mission.description, self._mission.tree)
        # The export of a subtree extends the used subtrees, which are in the order of their first use.
        while len(root) <= len(self._use_counts):
            subtree = self._mission.subtrees[list(self._use_counts)[len(root) - 1]]
            self._add_tree(root, subtree.doc, subtree.body, subtree)
        models = sorted(self._models.values(), key=lambda model: (model.tag, model.attrib["ID"]))
        SubElement(root, "TreeNodesModel").extend(models)
        return root

    def _add_tree(
        self, root: Element, doc: str, body: nodes.Node | None, subtree: Subtree | None = None
    ) -> None:
        params = {} if subtree and subtree.library else self._mission.params
        arguments = subtree.arguments if subtree else {}
        # Values that replace references in this tree.
        self._values = {name: param.value for name, param in params.items() if name not in arguments}
        tree_id = self._tree_ids[subtree.name] if subtree else self._main_id
        assert body is not None
        self._add_node(SubElement(root, "BehaviorTree", ID=tree_id, _description=doc), body)

    def _add_node(self, parent: Element, node: nodes.Node) -> None:
        match node:
            case nodes.SkillNode():
                element = self._add_skill(parent, node)
            case nodes.SubtreeNode():
                element = self._add_use(parent, node)
            case nodes.InnerNode():
                element = self._add_control_node(parent, node)
        if node.label:
            element.set("name", node.label)

    def _add_skill(self, parent: Element, node: nodes.SkillNode) -> Element:
        skill = self._skills[node.skill]
        values = {name: _format_pointer(name) for name in skill.ports}
        values |= {name: self._format(setting.value) for name, setting in node.settings.items()}
        kind = "Condition" if skill.is_condition else "Action"
        return self._add(parent, kind, node.skill, (*skill.params.values(), *skill.ports.values()), values)

    def _add_use(self, parent: Element, node: nodes.SubtreeNode) -> Element:
        subtree, ports, values = self._mission.subtrees[node.name], [], {}
        self._use_counts[node.name] += 1
        for name, argument in subtree.arguments.items():
            default = self._format(argument.default) if argument.default else ""
            ports.append(Port(name, None, Direction.IN, default, "", ""))
            values[name] = self._format(node.arguments[name].value) if name in node.arguments else default
        if subtree.returns is not None:
            # Local variables get unique names, because `_autoremap` shares all variables that are no ports.
            prefix = f"{node.name}-{self._use_counts[node.name]}."
            for name in sorted(self._find_written_variables(subtree.body)):
                ports.append(Port(name, None, Direction.OUT, ..., "", ""))
                values[name] = _format_pointer(name if name in subtree.returns else prefix + name)
        values |= {name: self._format(setting.value) for name, setting in node.returns.items()}
        element = self._add(parent, "SubTree", self._tree_ids[node.name], ports, values)
        element.set("_autoremap", "true")
        return element

    def _find_written_variables(self, body: nodes.Node) -> set[str]:
        """Return the variables that a body and the subtrees in the body may write."""
        names = find_written_variables(body, self._skills)
        for use in body.walk():
            if isinstance(use, nodes.SubtreeNode):
                names |= self._find_written_variables(self._mission.subtrees[use.name].body)
                names |= {getattr(setting.value, "name", "") for setting in use.returns.values()}
        return names

    def _add_control_node(self, parent: Element, node: nodes.InnerNode) -> Element:
        values = {name: self._resolve(value) for name, value in node.values.items()}
        counterpart = make_inspection_instance(replace(node, values=values)).counterpart
        # A constant that is an argument has no value yet, so that only a copy of the constant is right.
        unknown_keys = {name for name, value in values.items() if isinstance(value, Reference)}
        if counterpart is None or unknown_keys - {*counterpart.ports.values()}:
            return self._add_custom_node(parent, node.declaring_class.keyword, node)
        element = SubElement(parent, counterpart.name)
        for port, value in counterpart.ports.items():
            element.set(port, self._format(values[value]) if isinstance(value, str) else str(value))
        for child in node.children:
            self._add_node(element, child)
        return element

    def _add_custom_node(self, parent: Element, name: str, owner: nodes.NodeOrSection) -> Element:
        """Add a custom node for a control node, or for a section that contains nodes."""
        keys = owner.declaring_class.keys.values()
        ports, node_keys = [key for key in keys if not _has_nodes(key)], list(filter(_has_nodes, keys))
        values = {key.name: self._format(value) for key, value in nodes.iterate_keys(owner) if key in ports}
        has_single_child = [(key.kind, key.is_required) for key in node_keys] == [(KeyKind.NODE, True)]
        element = self._add(parent, "Decorator" if has_single_child else "Control", name, ports, values)
        for key, value in nodes.iterate_keys(owner):
            key_element = element
            if key.kind in (KeyKind.NODE, KeyKind.NODES) and key.name != "do":
                kind = "Decorator" if key.kind is KeyKind.NODE else "Control"
                key_element = self._add(element, kind, f"{name}-{key.name}", (), {})
            for part in (value if isinstance(value, tuple) else (value,)) if key in node_keys else ():
                if isinstance(part, nodes.NodeSection):
                    self._add_custom_node(element, f"{name}-{key.name}", part)
                elif isinstance(part, nodes.Node):
                    self._add_node(key_element, part)
        return element

    def _add(
        self, parent: Element, kind: str, name: str, ports: Iterable[_Port], values: Mapping[str, str]
    ) -> Element:
        """Add a node with the values of its ports, and the model of the node if it is missing."""
        is_subtree = kind == "SubTree"
        node_id = name if is_subtree else _make_unique(name, _REGISTERED_NAMES)
        if node_id not in self._models:
            model = self._models[node_id] = Element(kind, ID=node_id)
            model.extend(map(_make_port_model, ports))
        element = SubElement(parent, kind, ID=node_id) if is_subtree else SubElement(parent, node_id)
        element.attrib |= {_escape(port): text for port, text in values.items()}
        return element

    def _resolve(self, value: nodes.KeyValue) -> nodes.KeyValue:
        """Return the value of a param of the mission; return any other value unchanged."""
        return self._values.get(value.name, value) if isinstance(value, Reference) else value

    def _format(self, value: nodes.KeyValue) -> str:
        """Return a value as the text of a port: a constant, a list, or a pointer to a variable."""
        match self._resolve(value):
            case Literal(value=constant):
                return _format_constant(constant)
            case Reference(name=name, field=field) if field:
                return _format_pointer(f"{name}.{field}")
            case Reference(name=name) | LocatedName(name=name):
                return _format_pointer(name)
            case nodes.NodeSection() as section:
                return ",".join(f"{key.name}={self._format(one)}" for key, one in nodes.iterate_keys(section))
            case tuple() as items:
                return ";".join(str(one) if isinstance(one, Reason) else self._format(one) for one in items)
        raise TypeError(f"{value} has no text")


def _make_port_model(port: _Port) -> Element:
    if isinstance(port, Key):
        value_type, is_output = port.value_type, port.kind is KeyKind.VARIABLE
    else:
        value_type, is_output = port.type, getattr(port, "direction", None) is Direction.OUT
    model = Element("output_port" if is_output else "input_port", name=_escape(port.name))
    attributes = {"type": _TYPE_NAMES.get(value_type), "default": _format_constant(port.default)}
    model.attrib |= {name: text for name, text in attributes.items() if text}
    model.text = port.doc
    return model


def _has_nodes(key: Key) -> bool:
    """Return True if the value of a key contains nodes."""
    if key.kind in (KeyKind.SECTION, KeyKind.SECTIONS):
        return any(map(_has_nodes, key.section.keys.values()))
    return key.kind in (KeyKind.NODE, KeyKind.NODES)


def _escape(name: str) -> str:
    """Return a name with a prefix if BehaviorTree.CPP does not allow the name for ports and variables."""
    return f"var_{name}" if name in ("ID", "name") or name.startswith("_") else name


def _format_pointer(variable: str) -> str:
    return f"{{{_escape(variable)}}}"


def _format_constant(value: object) -> str:
    if isinstance(value, list | tuple):
        return ";".join(map(_format_constant, value))
    if value is None or value is ...:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _make_unique(name: str, names: Collection[str]) -> str:
    """Return the name, with underscores at its end as long as `names` contains the name."""
    return _make_unique(f"{name}_", names) if name in names else name
