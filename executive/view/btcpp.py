"""XML of a mission for BehaviorTree.CPP 4 and its editor Groot2.

Each subtree becomes a `BehaviorTree`, and each `use` a `SubTree` with the arguments as ports. A control node
becomes its counterpart in BehaviorTree.CPP; without a counterpart, it becomes a custom node with its keys as
ports. Each key that contains nodes, except `do`, becomes a node such as `retry-recover`, whose children are
the nodes under the key.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from executive.errors import InputError
from executive.mission.expand import initialize_variables
from executive.mission.mission_file import Mission, Subtree
from executive.mission.ports import find_written_variables
from executive.skill import Direction, Param, Port, Skill
from executive.tree.keys import Children, Key, KeyOwner, KeySection, KeyValue, Part, map_parts
from executive.tree.node import ControlNode, load_control_nodes
from executive.tree.specification import (
    Child,
    Constant,
    Expression,
    InvalidValue,
    Node,
    Reason,
    Reference,
    SkillNode,
    SubtreeNode,
    Value,
    VariableName,
)
from executive.view.drawing import replace_invalid_xml_characters

_REGISTERED_NAMES = frozenset(Path(__file__).with_name("btcpp_names.txt").read_text("utf-8").split())
"""Names that BehaviorTree.CPP 4.10 registers or reserves."""
_TYPE_NAMES: Mapping[object, str] = {bool: "bool", int: "int", float: "double", str: "std::string"}
"""Names of types in C++."""


def format_btcpp(mission: Mission, skills: Mapping[str, type[Skill]]) -> str:
    """Return the XML of a mission, which must have no errors; values replace references to its params."""
    root = _Exporter(mission, skills).export()
    indent(root)
    text = replace_invalid_xml_characters(tostring(root, encoding="unicode"))
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}'


class _Exporter:
    """Exporter of one mission."""

    def __init__(self, mission: Mission, skills: Mapping[str, type[Skill]]) -> None:
        self._mission = mission
        self._skills = skills
        self._models: dict[str, Element] = {}
        self._used_subtrees: list[Subtree] = []
        self._use_counts: Counter[str] = Counter()
        names = {*_REGISTERED_NAMES, *skills, *load_control_nodes()}
        self._tree_ids = {name: _make_unique(name, names) for name in mission.subtrees}
        self._main_id = _make_unique(mission.name, {*names, *self._tree_ids.values()})

    def export(self) -> Element:
        """Return the root element of the file."""
        root = Element("root", BTCPP_format="4", main_tree_to_execute=self._main_id)
        values: dict[str, Value] = {name: param.value for name, param in self._mission.params.items()}
        assert self._mission.tree is not None
        tree = initialize_variables(self._mission.tree, self._mission.variables)
        body = _replace_params(tree, values)
        main = SubElement(root, "BehaviorTree", ID=self._main_id, _description=self._mission.description)
        self._add_node(main, body)
        # The export of a subtree may append further subtrees.
        for subtree in self._used_subtrees:
            visible_names = () if subtree.library else values.keys() - subtree.arguments
            tree = initialize_variables(subtree.body, subtree.variables)
            body = _replace_params(tree, {name: values[name] for name in visible_names})
            tree_id = self._tree_ids[subtree.name]
            self._add_node(SubElement(root, "BehaviorTree", ID=tree_id, _description=subtree.doc), body)
        models = sorted(self._models.values(), key=lambda model: (model.tag, model.attrib["ID"]))
        SubElement(root, "TreeNodesModel").extend(models)
        return root

    def _add_node(self, parent: Element, node: Node) -> None:
        match node:
            case SkillNode():
                element = self._add_skill(parent, node)
            case SubtreeNode():
                element = self._add_subtree_reference(parent, node)
            case ControlNode():
                element = self._add_control_node(parent, node)
        if node.label:
            element.set("name", node.label)

    def _add_skill(self, parent: Element, node: SkillNode) -> Element:
        skill = self._skills[node.skill]
        values = {name: _format_pointer(name) for name in skill.ports}
        values |= {name: _format(value) for name, value in node.settings.items()}
        kind = "Condition" if skill.is_condition else "Action"
        declarations: tuple[Param | Port, ...] = (*skill.params.values(), *skill.ports.values())
        return self._add_element(parent, kind, node.skill, declarations, values)

    def _add_subtree_reference(self, parent: Element, node: SubtreeNode) -> Element:
        subtree = self._mission.subtrees[node.name]
        ports = []
        values: dict[str, str] = {}
        if not self._use_counts[node.name]:
            self._used_subtrees.append(subtree)
        self._use_counts[node.name] += 1
        for name, value in subtree.arguments.items():
            default = _format(value) if value else ""
            ports.append(Port(name, None, Direction.IN, default, "", ""))
            values[name] = _format(node.arguments[name]) if name in node.arguments else default
        if subtree.returns is not None:
            # Local variables get unique names, because `_autoremap` shares all variables that are no ports.
            prefix = f"{node.name}-{self._use_counts[node.name]}."
            for variable in sorted(self._find_written_variables(subtree.body)):
                ports.append(Port(variable, None, Direction.OUT, ..., "", ""))
                is_returned = variable in subtree.returns
                values[variable] = _format_pointer(variable if is_returned else prefix + variable)
        values |= {name: _format(value) for name, value in node.returns.items()}
        element = self._add_element(parent, "SubTree", self._tree_ids[node.name], ports, values)
        element.set("_autoremap", "true")
        return element

    def _find_written_variables(self, body: Node) -> set[str]:
        """Return the variables that a body and the subtrees in the body may write."""
        names = find_written_variables(body, self._skills)
        for use in body.walk():
            if isinstance(use, SubtreeNode):
                names |= self._find_written_variables(self._mission.subtrees[use.name].body)
                names |= {getattr(value, "name", "") for value in use.returns.values()}
        return names

    def _add_control_node(self, parent: Element, node: ControlNode) -> Element:
        counterpart = node.counterpart
        # A value that refers to an argument is unknown here, and must be passed as a port.
        unknown_keys = {
            name for name, value in node.settings.items() if isinstance(value, Reference | Expression)
        }
        if counterpart is None or unknown_keys - {*counterpart.ports.values()}:
            return self._add_custom_node(parent, node.keyword, node)
        element = SubElement(parent, counterpart.name)
        for port, value in counterpart.ports.items():
            setting = node.settings[value] if isinstance(value, str) else None
            text = _format_script(setting) if isinstance(setting, Expression) else str(value)
            element.set(port, _format(setting) if isinstance(setting, Constant | Reference) else text)
        for child in node.children:
            self._add_node(element, child)
        return element

    def _add_custom_node(self, parent: Element, name: str, part: KeyOwner) -> Element:
        """Add a custom node for `part`, which is a control node, or a section that contains nodes."""
        keys = part.keys.values()
        ports = [_make_port(key) for key in keys if not key.has_nodes]
        values = {
            key.name: _format_script(value) if isinstance(value, Expression) else _format(value)
            for key, value in part.list_values()
            if not key.has_nodes
        }
        kinds = [(key.value_type, key.is_required) for key in keys if key.has_nodes]
        kind = "Decorator" if kinds == [(Child, True)] else "Control"
        element = self._add_element(parent, kind, name, ports, values)
        for key, value in part.list_values():
            key_element = element
            if key.value_type in (Child, Children) and key.name != "do":
                kind = "Decorator" if key.value_type == Child else "Control"
                key_element = self._add_element(element, kind, f"{name}-{key.name}", (), {})
            for child in value if isinstance(value, tuple) else (value,):
                if isinstance(child, Node):
                    self._add_node(key_element, child)
                elif isinstance(child, KeySection) and key.has_nodes:
                    self._add_custom_node(element, f"{name}-{key.name}", child)
        return element

    def _add_element(
        self, parent: Element, kind: str, name: str, ports: Iterable[Param | Port], values: Mapping[str, str]
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


def _replace_params(node: Node, values: Mapping[str, Value]) -> Node:
    """Return a node with the values of params in place of references to the params."""

    def replace(part: Part) -> object:
        if isinstance(part, Node):
            return _replace_params(part, values)
        return values.get(part.name, part) if isinstance(part, Reference) else part

    return map_parts(node, replace)


def _format(value: KeyValue) -> str:
    """Return a value as the text of a port: a constant, a list, or a pointer to a variable."""
    match value:
        case Constant(value=constant):
            return _format_constant(constant)
        case Reference(name=name, field=field):
            return _format_pointer(f"{name}.{field}" if field else name)
        case VariableName():
            return _format_pointer(value)
        case Expression(operator="value", operands=(Reference() as reference,)):
            return _format(reference)
        case Expression():
            raise InputError(
                f"a port of BehaviorTree.CPP takes no expression: {value}; set a variable before"
            )
        case KeySection() as section:
            return ",".join(f"{key.name}={_format(one)}" for key, one in section.list_values())
        case tuple() as items:
            return ";".join(_format_end(one) for one in items)
        case InvalidValue():
            return ""
    raise TypeError(f"{value} cannot be written as the value of a port")


_SCRIPT_OPERATORS = {
    **{name: name for name in ("==", "!=", "<", "<=", ">", ">=", "+", "-", "*", "/")},
    "and": "&&", "or": "||",
}  # fmt: skip
"""Operators of the scripts of BehaviorTree.CPP 4, by the name of the operation."""


def _format_script(value: Value) -> str:
    """Return an expression as a script, in which fields and counters are entries such as `target_x`.

    Raises:
        InputError: The scripts have no such operation.
    """
    match value:
        case Constant(value=constant):
            if "'" in str(constant):
                raise InputError(f"scripts of BehaviorTree.CPP cannot contain the text {value}")
            return f"'{constant}'" if isinstance(constant, str) else _format_constant(constant)
        case Reference(name=name, field=field):
            return _escape(f"{name}_{field}" if field else name).replace(".", "_")
        case Expression(operator="value", operands=(operand,)):
            return _format_script(operand)
        case Expression(operator="run" | "bin", operands=(Constant(value=name),)):
            return f"run_{name}" if value.operator == "run" else f"bin_{name}_count"
        case Expression(operator="text"):
            return str(value)
        case Expression(operator="negative" | "not", operands=(operand,)):
            return f"{'-' if value.operator == 'negative' else '!'}({_format_script(operand)})"
        case Expression(operator=name, operands=operands) if name in _SCRIPT_OPERATORS:
            return f" {_SCRIPT_OPERATORS[name]} ".join(
                f"({_format_script(one)})" if isinstance(one, Expression) else _format_script(one)
                for one in operands
            )
    raise InputError(
        f"scripts of BehaviorTree.CPP cannot express {value}; use another expression, or a skill"
    )


def _format_end(value: Node | Reason | Expression | KeySection) -> str:
    """Return a reason or expression in a list, such as that of `until`."""
    if isinstance(value, Reason):
        return str(value)
    return _format_script(value) if isinstance(value, Expression) else _format(value)


def _make_port(key: Key) -> Port:
    """Return the port of a custom node for a key."""
    direction = Direction.OUT if key.value_type is VariableName else Direction.IN
    default = ... if key.is_required else key.field.default
    return Port(key.name, key.value_type, direction, default, "", key.field.description or "")


def _make_port_model(port: Param | Port) -> Element:
    is_output = isinstance(port, Port) and port.direction is Direction.OUT
    model = Element("output_port" if is_output else "input_port", name=_escape(port.name))
    attributes = {"type": _TYPE_NAMES.get(port.type), "default": _format_constant(port.default)}
    model.attrib |= {name: text for name, text in attributes.items() if text}
    model.text = port.doc
    return model


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
    """Return a name with as many underscores at its end as needed, so that `names` does not contain it."""
    return _make_unique(f"{name}_", names) if name in names else name
