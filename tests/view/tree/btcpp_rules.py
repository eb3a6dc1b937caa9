"""The rules that `src/xml_parsing.cpp` of BehaviorTree.CPP 4.10 enforces for a file, as functions.

Each rule quotes the message of the original and names the function of `xml_parsing.cpp` that raises it. The
registered nodes of the original are here the built-in nodes and the nodes in `TreeNodesModel`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, fromstring

CONTROLS = {
    "AsyncFallback", "AsyncSequence", "Fallback", "IfThenElse", "Parallel", "ParallelAll", "Sequence",
    "ReactiveFallback", "ReactiveSequence", "SequenceStar", "SequenceWithMemory", "Switch2", "Switch3",
    "Switch4", "Switch5", "Switch6", "TryCatch", "WhileDoElse",
}  # fmt: skip
DECORATORS = {
    "Delay", "ForceFailure", "ForceSuccess", "Inverter", "KeepRunningUntilFailure", "LoopBool", "RunOnce",
    "LoopDouble", "LoopInt", "LoopString", "Precondition", "Repeat", "RetryUntilSuccessful", "Timeout",
    "SkipUnlessUpdated", "WaitValueUpdate",
}  # fmt: skip
ACTIONS = {
    "AlwaysFailure", "AlwaysSuccess", "Script", "ScriptCondition", "SetBlackboard", "Sleep", "SubTree",
    "UnsetBlackboard", "WasEntryUpdated",
}  # fmt: skip
BUILT_IN = CONTROLS | DECORATORS | ACTIONS
"""Nodes that the constructor of `BehaviorTreeFactory` registers."""
PORTS = {
    "Parallel": {"success_count", "failure_count"}, "ParallelAll": {"max_failures"}, "Timeout": {"msec"},
    "RetryUntilSuccessful": {"num_attempts"}, "Repeat": {"num_cycles"},
}  # fmt: skip
"""Ports of the built-in nodes that have ports."""
KINDS = ("Decorator", "Action", "Condition", "Control", "SubTree")
RESERVED_ATTRIBUTES = {
    "ID", "name", "_autoremap", "_failureIf", "_successIf", "_skipIf", "_while", "_onHalted", "_onFailure",
    "_onSuccess", "_post",
}  # fmt: skip
FORBIDDEN_CHARACTERS = re.compile(r"""[ \t\n\r<>&"'/\\:*?|.\x00-\x1f\x7f]""")
"""`findForbiddenChar` in basic_types.cpp."""
MAX_NESTING_DEPTH = 256


@dataclass
class Document:
    """A file of BehaviorTree.CPP.

    Attributes:
        root: Root element.
        trees: The elements `BehaviorTree` by ID.
        models: The node models in `TreeNodesModel` by ID.
        ports: Names of the ports by ID of the model.
    """

    root: Element
    trees: dict[str, Element] = field(default_factory=dict)
    models: dict[str, Element] = field(default_factory=dict)
    ports: dict[str, set[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.trees = {tree.get("ID", ""): tree for tree in self.root.findall("BehaviorTree")}
        self.models = {model.get("ID", ""): model for model in self.root.findall("TreeNodesModel/*")}
        models = self.models.items()
        self.ports = {name: {port.get("name", "") for port in model} for name, model in models}

    @classmethod
    def parse(cls, text: str) -> Document:
        """Return a file from its text."""
        return cls(fromstring(text.encode()))

    @property
    def registered(self) -> set[str]:
        """Names of all nodes that a tree may contain."""
        models = self.root.findall("TreeNodesModel/*")
        return {model.get("ID", "") for model in models if model.tag != "SubTree"} | BUILT_IN

    def find_kind(self, name: str) -> str:
        """Return `Control`, `Decorator` or `Action`."""
        if name in self.models:
            return self.models[name].tag
        return "Control" if name in CONTROLS else "Decorator" if name in DECORATORS else "Action"

    def nodes(self, *kinds: str) -> Iterator[Element]:
        """Yield every node of every tree, or only the nodes of the given kinds."""
        for tree in self.root.findall("BehaviorTree"):
            for node in tree.iter():
                if node is not tree and (not kinds or self.find_kind(node.tag) in kinds):
                    yield node


def is_allowed_port_name(name: str) -> bool:
    """Return the result of `IsAllowedPortName` in basic_types.cpp."""
    is_letter = name[:1].isascii() and name[:1].isalpha()
    return is_letter and not FORBIDDEN_CHARACTERS.search(name) and name not in RESERVED_ATTRIBUTES


Rule = Callable[[Document], Iterator[object]]
RULES: dict[str, Rule] = {}
"""Rules by function and message; a rule yields the parts of a file that violate the rule."""


def rule(function: str, message: str) -> Callable[[Rule], Rule]:
    """Register a rule."""

    def register(find_violations: Rule) -> Rule:
        RULES[f"{function}: {message}"] = find_violations
        return find_violations

    return register


@rule("loadDocImpl", 'The first tag of the XML (<root>) should contain the attribute [BTCPP_format="4"]')
def _(file: Document) -> Iterator[object]:
    yield from [] if file.root.get("BTCPP_format") == "4" else [file.root.attrib]


@rule("VerifyXML", "The XML must have a root node called <root>")
def _(file: Document) -> Iterator[object]:
    yield from [] if file.root.tag == "root" else [file.root.tag]


@rule("VerifyXML", "Only a single node <TreeNodesModel> is supported")
def _(file: Document) -> Iterator[object]:
    yield from file.root.findall("TreeNodesModel")[1:]


@rule("VerifyXML", "The attribute [ID] is mandatory")
def _(file: Document) -> Iterator[object]:
    yield from (model for model in file.root.iterfind("TreeNodesModel/*") if not model.get("ID"))


@rule("VerifyXML", "Maximum XML nesting depth exceeded")
def _(file: Document) -> Iterator[object]:
    def measure(node: Element) -> int:
        return 1 + max(map(measure, node), default=0)

    yield from (name for name, tree in file.trees.items() if measure(tree) > MAX_NESTING_DEPTH)


@rule("VerifyXML", "The tag <...> must have the attribute [ID]")
def _(file: Document) -> Iterator[object]:
    yield from (node.tag for node in file.nodes() if node.tag in KINDS and not node.get("ID"))


@rule("VerifyXML", "The tag <BehaviorTree> must have the attribute [ID]")
def _(file: Document) -> Iterator[object]:
    yield from (tree for tree in file.root.findall("BehaviorTree") if not tree.get("ID"))


@rule("VerifyXML", "The attribute [ID] of tag <BehaviorTree> must not use the name of a registered Node")
def _(file: Document) -> Iterator[object]:
    yield from file.registered & set(file.trees)


@rule("VerifyXML", "The tag <BehaviorTree> with ID '...' must have exactly 1 child")
def _(file: Document) -> Iterator[object]:
    yield from (name for name, tree in file.trees.items() if len(tree) != 1)


@rule("VerifyXML", "<SubTree> with ID '...' should not have any child")
def _(file: Document) -> Iterator[object]:
    yield from (node.get("ID") for node in file.nodes() if node.tag == "SubTree" and len(node))


@rule("VerifyXML", "The attribute [ID] of tag <SubTree> must not use the name of a registered Node")
def _(file: Document) -> Iterator[object]:
    names = (node.get("ID") for node in file.nodes() if node.tag == "SubTree")
    yield from (name for name in names if name in file.registered)


@rule("VerifyXML", "Node not recognized")
def _(file: Document) -> Iterator[object]:
    yield from (node.tag for node in file.nodes() if node.tag not in file.registered)


@rule("VerifyXML", "The node '...' must have exactly 1 child")
def _(file: Document) -> Iterator[object]:
    yield from (node.tag for node in file.nodes("Decorator") if len(node) != 1)


@rule("VerifyXML", "The node '...' must have 1 or more children")
def _(file: Document) -> Iterator[object]:
    yield from (node.tag for node in file.nodes("Control") if not len(node))


@rule("VerifyXML", "The node 'TryCatch' must have at least 2 children")
def _(file: Document) -> Iterator[object]:
    yield from (node.tag for node in file.nodes() if node.tag == "TryCatch" and len(node) < 2)


@rule("VerifyXML", "A ReactiveSequence cannot have more than one async child.")
def _(file: Document) -> Iterator[object]:
    for node in file.nodes():
        if node.tag == "ReactiveSequence" and [child.tag for child in node].count("AsyncSequence") > 1:
            yield node.tag


@rule("VerifyXML", "The node '...' must not have any child")
def _(file: Document) -> Iterator[object]:
    yield from (node.tag for node in file.nodes("Action", "Condition") if len(node))


@rule("validateModelName", "name cannot be empty; 'Root' is a reserved name; contains forbidden character")
def _(file: Document) -> Iterator[object]:
    for name in (*file.trees, *file.models, *(node.tag for node in file.nodes())):
        if name in ("", "Root", "root") or FORBIDDEN_CHARACTERS.search(name):
            yield name


@rule("validatePortName", "cannot be empty; cannot start with a digit; forbidden character; is reserved")
def _(file: Document) -> Iterator[object]:
    yield from (name for names in file.ports.values() for name in names if not is_allowed_port_name(name))


@rule("validateInstanceName", "Instance name '...' contains invalid control character")
def _(file: Document) -> Iterator[object]:
    names = (node.get("name", "") for node in file.nodes())
    yield from (name for name in names if re.search("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]", name))


@rule("parseSubtreeModelPorts", "Missing attribute [name] in port (SubTree model)")
def _(file: Document) -> Iterator[object]:
    yield from (port for port in file.root.iterfind("TreeNodesModel/*/*") if not port.get("name"))


@rule("registerBuilder (bt_factory.cpp)", "ID [...] already registered")
def _(file: Document) -> Iterator[object]:
    names = [element.get("ID") for element in file.root.iterfind("TreeNodesModel/*")]
    yield from {name for name in names if names.count(name) > 1 or name in BUILT_IN}


@rule("instantiateTree", "[main_tree_to_execute] was not specified correctly")
def _(file: Document) -> Iterator[object]:
    yield from [] if file.root.get("main_tree_to_execute") else [file.root.attrib]


@rule("recursivelyCreateSubtree", "Can't find a tree with name")
def _(file: Document) -> Iterator[object]:
    used = {node.get("ID") for node in file.nodes() if node.tag == "SubTree"}
    yield from (used | {file.root.get("main_tree_to_execute")}) - set(file.trees)


@rule("recursivelyCreateSubtree", "Recursive behavior tree cycle detected")
def _(file: Document) -> Iterator[object]:
    used = {name: {node.get("ID") for node in tree.iter("SubTree")} for name, tree in file.trees.items()}
    while leaves := {name for name, names in used.items() if not names & set(used)}:
        used = {name: names for name, names in used.items() if name not in leaves}
    yield from used


@rule("recursivelyCreateSubtree", "is defining a mandatory port [...], but you are not remapping it")
def _(file: Document) -> Iterator[object]:
    for node in file.nodes():
        if node.tag == "SubTree":
            yield from file.ports[node.attrib["ID"]] - set(node.attrib)


@rule("recursivelyCreateSubtree", "Duplicate SubTree path detected")
def _(file: Document) -> Iterator[object]:
    for tree in file.trees.values():
        names = [node.attrib["name"] for node in tree.iter("SubTree") if "name" in node.attrib]
        yield from {name for name in names if names.count(name) > 1}


@rule("createNodeFromXML", "Attribute [ID] is not allowed in <...>")
def _(file: Document) -> Iterator[object]:
    yield from (node.tag for node in file.nodes() if node.tag not in KINDS and "ID" in node.attrib)


@rule("createNodeFromXML", "a port with name [...] is found in the XML but not in the providedPorts()")
def _(file: Document) -> Iterator[object]:
    for node in file.nodes():
        model = node.attrib["ID"] if node.tag == "SubTree" else node.tag
        ports = file.ports.get(model, PORTS.get(model, set()))
        names = filter(is_allowed_port_name, node.attrib)
        yield from (f"{node.tag}.{name}" for name in names if name not in ports)


@rule("createNodeFromXML", 'The port with name "..." and value "..." can not be converted to ...')
def _(file: Document) -> Iterator[object]:
    patterns = {"int": r"-?\d+", "double": r"-?\d+(\.\d+)?([eE][-+]?\d+)?", "bool": "true|false"}
    for node in file.nodes():
        for port in file.models.get(node.tag, ()):
            pattern, value = patterns.get(port.get("type", ""), ".*"), node.get(port.attrib["name"], "{_}")
            if not re.fullmatch(r"\{.+\}", value) and not re.fullmatch(pattern, value, re.DOTALL):
                yield f"{node.tag}.{port.attrib['name']}={value}"


def list_violations(text: str) -> list[str]:
    """Return a sentence for each part of a file that violates a rule."""
    file = Document.parse(text)
    return [f"{name}: {part}" for name, find in RULES.items() for part in find(file)]
